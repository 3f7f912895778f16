"""The page as HTML: read by a parser that knows nothing of its templates."""

import itertools
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from impact_rig.reporting.report.document import Document, Identifiers, Paragraph, Section
from impact_rig.reporting.report.page import render_page
from impact_rig.reporting.report.report import make_report
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.run import Run
from impact_rig.results.traced_campaign import TracedCampaign

from .conftest import HOSTILE, HOSTILE_NOTE

VOID = {"meta", "link", "br", "img", "hr", "input"}
HEADINGS = ("h1", "h2", "h3", "h4", "h5", "h6")


class Reader(HTMLParser):
    """Gathers elements with their attributes and text, and checks that they are nested."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.tables: list[list[list[str]]] = []
        self.captions: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in VOID:
            return
        self._open.append(tag)
        if tag == "table":
            self.tables.append([])
            self.captions.append("")
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("th", "td"):
            self.tables[-1][-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if not self._open:
            assert not data.strip()
            return
        self.texts.append((self._open[-1], data))
        if "caption" in self._open:
            self.captions[-1] += data
        elif {"th", "td"} & set(self._open):
            self.tables[-1][-1][-1] += data

    def find(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def find_table(self, start: str) -> list[list[str]]:
        place = next(i for i, text in enumerate(self.captions) if text.startswith(start))
        return self.tables[place]

    @property
    def text(self) -> str:
        shown = (text for tag, text in self.texts if tag not in ("style", "title"))
        return re.sub(r"\s+", " ", " ".join(shown))


@pytest.fixture(scope="module")
def read(page: str) -> Reader:
    return Reader(page)


@pytest.fixture(scope="module", params=["page", "comparison_page"])
def any_page(request: pytest.FixtureRequest) -> Reader:
    return Reader(request.getfixturevalue(request.param))


def test_headings_go_down_one_level_at_a_time_from_a_single_first_one(any_page: Reader):
    levels = [HEADINGS.index(tag) + 1 for tag, _ in any_page.elements if tag in HEADINGS]
    assert levels.count(1) == 1
    assert levels[0] == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))


def test_ids_are_unique_and_every_reference_leads_to_one(any_page: Reader):
    ids = Counter(attributes["id"] for _, attributes in any_page.elements if "id" in attributes)
    assert max(ids.values()) == 1
    for tag, attributes in any_page.elements:
        for name in ("href", "clip-path", "aria-labelledby"):
            for target in re.findall(r"#([^)\"]+)", attributes.get(name) or ""):
                assert target in ids, f"{tag} {name} leads to {target}"
        if "aria-labelledby" in attributes:
            assert attributes["aria-labelledby"] in ids


def test_tables_have_a_caption_a_head_and_cells_that_say_what_they_head(any_page: Reader):
    tables = any_page.find("table")
    assert len(tables) == len(any_page.find("caption")) == len(any_page.find("thead")) > 10
    assert all(cell.get("scope") in ("col", "row") for cell in any_page.find("th"))
    for caption, rows in zip(any_page.captions, any_page.tables, strict=True):
        assert caption
        assert len({len(row) for row in rows}) == 1, caption
        assert len(rows) > 1, caption


def test_every_figure_is_described_in_words_with_numbers(any_page: Reader):
    described = [a["aria-label"] for a in any_page.find("div") if a.get("role") == "img"]
    assert len(described) == len(any_page.find("figure")) >= 6
    assert all(text and re.search(r"\d", text) for text in described)


def test_the_page_speaks_of_no_other_place_and_runs_nothing(any_page: Reader, page: str):
    assert not {"script", "iframe", "object", "embed", "img"} & {
        tag for tag, _ in any_page.elements
    }
    for tag, attributes in any_page.elements:
        for name, value in attributes.items():
            assert not name.startswith("on")
            assert name == "xmlns" or not re.search(r"(https?:)?//", value or ""), (tag, name)
        if tag in ("a", "use"):
            assert (attributes.get("href") or attributes.get("xlink:href", "")).startswith("#")
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    assert "url(" not in style
    assert "@import" not in style


def test_its_language_and_the_way_past_the_contents_are_named(read: Reader):
    assert read.find("html") == [{"lang": "en"}]
    assert {"class": "skip", "href": "#report"} in read.find("a")
    assert read.find("main") == [{"id": "report"}]


def test_names_and_notes_of_files_are_text_and_nothing_else(read: Reader, page: str):
    assert HOSTILE in read.text
    assert HOSTILE_NOTE in read.text
    assert "<script" not in page
    assert 'evil.example/x.png"' not in page


def test_warnings_come_before_everything_else(read: Reader):
    titles = [text for tag, text in read.texts if tag == "h2"]
    assert titles[0] == "Warnings"
    assert read.text.index("the recording was never closed") < read.text.index(
        "Largest differences"
    )
    for text in ("the end is missing", "1 gap of 1000 points"):
        assert text in read.text


def test_tables_hold_the_results_with_their_uncertainties(read: Reader, told: Run):
    sample = told.campaign.results.samples[0]
    for title, value, expanded, paper in (
        ("Table 2", sample.contact_time_s * 1e6, sample.contact_time_expanded_s * 1e6, "212"),
        (
            "Table 3",
            sample.stiffness_n_per_m / 1e6,
            sample.stiffness_expanded_n_per_m / 1e6,
            "22.54",
        ),
        (
            "Table 4",
            sample.damping_coefficient_n_s_per_m,
            sample.damping_coefficient_expanded_n_s_per_m,
            "802",
        ),
    ):
        head, first, *_ = read.find_table(title)
        row = dict(zip([text.partition(" [")[0] for text in head], first, strict=True))
        assert row["Sample"] == HOSTILE
        assert row["Reference"] == paper
        shown, wide = map(float, row["Measured"].split(" ± "))
        assert shown == pytest.approx(value, abs=wide / 20)
        assert wide == pytest.approx(expanded, rel=0.05)
        assert float(row["Difference"]) == pytest.approx(
            100 * (value / float(paper) - 1), abs=0.005
        )
        assert row["Hits"] == "2"


def test_the_misprint_is_marked_and_explained(read: Reader):
    rows = [row[0] for row in read.find_table("Table 2")]
    assert "brass medium *" in rows
    assert "prints 288.10 µs for brass medium, a misprint" in read.text


def test_the_measurement_can_be_traced_back(read: Reader):
    for text in (
        "2023-11-14 22:13:20 UTC, for 12.3 s",
        "before/session.mcap",
        "SHA-256 " + "ab" * 32,
        "dusty",
        "9.8.7",
        "swing_time: 0.25",
        "58 ppm",
    ):
        assert text in read.text
    channels = read.find_table("Sampling and calibration")
    assert channels[1:] == [
        ["hammer", "2500", "counts", "0.9765625", "0", "2000"],
        ["sample", "2500", "numbers", "1.953125", "0.25", "-"],
    ]
    bodies = {row[0]: row for row in read.find_table("Bodies")}
    assert bodies["hammer"][2:4] == ["100.00", "0.29"]
    assert bodies[HOSTILE][-1] == "control sample"


def test_every_hit_left_out_stands_with_its_reason(read: Reader):
    (_, row) = read.find_table("Hits left out: 1")
    assert row[:4] == [HOSTILE, "1", "1", "1"]
    assert row[5].startswith("weak: ")
    assert row[6] == "weak_hit"
    assert len(read.find_table("Hits in the means: 4")) == 5


def test_every_sample_has_its_traces_and_the_budget_of_every_result(read: Reader):
    for symbol in ("τp", "k", "c", "ζ"):
        rows = read.find_table(f"{HOSTILE}: {symbol} = ")
        shares = [float(row[3]) for row in rows[1:]]
        assert sum(shares) == pytest.approx(100.0, abs=0.3)
    figures = {a.get("id", "") for a in read.find("figure")}
    assert sum("sample" in name for name in figures) == 2


def test_the_identification_stands_beside_the_papers_method(read: Reader, told: Run):
    head, first, *_ = read.find_table("Identification")
    assert [text.partition(" [")[0] for text in head[:3]] == ["Sample", "τp, paper", "τp, fit"]
    fitted = told.campaign.results.samples[0].identification
    assert float(first[2].split(" ± ")[0]) == pytest.approx(fitted.contact_time_s * 1e6, rel=1e-3)


def test_on_paper_nothing_stays_folded(told: Run, undrawn: None):
    document = make_report([told])
    folded = Reader(render_page(document)).find("details")
    unfolded = Reader(render_page(document, is_unfolded=True)).find("details")
    assert len(folded) == len(unfolded) > 0
    assert not any("open" in attributes for attributes in folded)
    assert all("open" in attributes for attributes in unfolded)


def test_results_alone_say_what_is_missing_and_where_it_is(told: Run, undrawn: None):
    campaign = TracedCampaign(told.campaign.results, (), ())
    read = Reader(render_page(make_report([Run("alone", "alone/results.json", campaign)])))
    assert "They hold no traces" in read.text
    assert "date not known" in read.text
    assert read.find_table("Table 2")
    assert read.find_table(f"{HOSTILE}: τp")


def test_without_an_accepted_hit_the_rejections_are_what_is_told(told: Run, undrawn: None):
    results = told.campaign.results
    hits = tuple(
        replace(hit, accepted=False, reasons=hit.reasons or ("overload: at the rail",))
        for hit in results.hits
    )
    samples = tuple(SampleResults(sample.name, 0, 2) for sample in results.samples)
    nothing = replace(results, hits=hits, samples=samples)
    run = replace(told, campaign=TracedCampaign(nothing, (), ()))
    read = Reader(render_page(make_report([run])))
    assert "no hit was accepted, so that nothing is estimated" in read.text
    assert "overload (4), weak (1)" in read.text
    assert len(read.find_table("Hits left out: 5")) == 6
    assert not any(caption.startswith("Table") for caption in read.captions)


def test_a_sample_without_a_model_says_why(told: Run, undrawn: None):
    results = told.campaign.results
    first, *others = results.samples
    note = "identification: not determined, since it is a test"
    changed = replace(first, identifications=(), notes=(note,))
    campaign = replace(told.campaign, results=replace(results, samples=(changed, *others)))
    read = Reader(render_page(make_report([replace(told, campaign=campaign)])))
    assert read.text.count(note) == 2  # with the sample, and in the list of what is missing
    rows = [row[0] for row in read.find_table("Identification")]
    assert first.name not in rows


def test_what_no_hit_determines_has_no_table_but_a_word(told: Run, undrawn: None):
    results = told.campaign.results
    samples = tuple(
        SampleResults(sample.name, 2, 0, contact_time_s=1e-4) for sample in results.samples
    )
    bare = replace(results, samples=samples, hammer=HammerResults(notes=("k1: no control",)))
    run = replace(told, campaign=TracedCampaign(bare, (), ()))
    read = Reader(render_page(make_report([run])))
    assert read.text.count("Of no sample; why stands under") == 2
    assert "hammer: k1: no control" in read.text
    assert [caption for caption in read.captions if caption.startswith("Table")] == [
        "Table 2. Contact time τp"
    ]


@pytest.mark.parametrize("start", [0, 1_000_000_000])
def test_a_recording_without_a_date_is_not_of_1970(told: Run, undrawn: None, start: int):
    provenance = replace(told.provenance, start_time=start, end_time=start, notes=())
    read = Reader(render_page(make_report([replace(told, provenance=provenance)])))
    assert "date not known, for 0.0 s" in read.text
    assert "1970" not in read.text


def test_several_runs_are_compared_before_each_is_told_of(comparison_page: str):
    read = Reader(comparison_page)
    titles = [text for tag, text in read.texts if tag == "h2"]
    assert titles == [
        "Warnings",
        "Comparison of the runs",
        "Run 1: before",
        "Run 2: after",
        "How to read this",
    ]
    assert "not in this report: there is no file <gone>" in read.text
    assert "after against before" in [text for tag, text in read.texts if tag == "h3"]


def test_a_change_is_called_one_where_the_normalised_error_is_above_1(
    comparison_page: str, told: Run, later: Run
):
    read = Reader(comparison_page)
    changed = 0
    for title, field in (
        ("Contact time", "contact_time"),
        ("Damping coefficient", "damping_coefficient"),
    ):
        rows = read.find_table(title + " ")
        unit = "_s" if field == "contact_time" else "_n_s_per_m"
        assert len(rows) >= 3
        for row, a, b in zip(
            rows[1:3], told.campaign.results.samples, later.campaign.results.samples, strict=True
        ):
            difference = getattr(b, field + unit) - getattr(a, field + unit)
            wide = (
                getattr(a, f"{field}_expanded{unit}") ** 2
                + getattr(b, f"{field}_expanded{unit}") ** 2
            ) ** 0.5
            assert float(row[4]) == pytest.approx(difference / wide, abs=0.005)
            assert row[5] == ("changed" if abs(difference / wide) > 1 else "no change seen")
            changed += row[5] == "changed"
    assert 0 < changed < 4  # both words are met


def test_what_differs_in_the_set_ups_is_listed(told: Run, undrawn: None):
    results = told.campaign.results
    setup = replace(results.setup, hammer_mass_kg=0.2)
    other = replace(
        told,
        name="heavier",
        campaign=TracedCampaign(replace(results, setup=setup), (), ()),
        acquisitions=(replace(told.acquisitions[0], sampling_rate=1e6),),
    )
    read = Reader(render_page(make_report([told, other])))
    rows = {row[0]: row[1:] for row in read.find_table("What differs")}
    assert rows["mass of the hammer m1"] == ["g", "100", "200"]
    assert rows["sampling and full scale"][2].startswith("1000 kHz")
    assert len(rows) == 3  # with the head


def test_identifiers_are_made_of_words_and_given_once():
    identifiers = Identifiers({"report"})
    assert [
        identifiers.make(text) for text in ("Contact time", "Contact time", "report", "τ")
    ] == [
        "contact-time",
        "contact-time-2",
        "report-2",
        "part",
    ]


def test_a_section_that_is_not_listed_is_not_in_the_contents():
    sections = (
        Section("listed", (Paragraph("a"),), (Section("hidden", (Paragraph("b"),), (), False),)),
    )
    read = Reader(render_page(Document("t", "s", "n", (), sections)))
    links = [attributes["href"] for attributes in read.find("a")]
    assert links == ["#report", "#listed"]


def test_the_templates_are_installed_with_the_package():
    root = Path(__file__).parents[3]
    (pattern,) = re.findall(r"reporting/report/templates/\*", (root / "setup.py").read_text())
    assert list((root / "impact_rig").glob(pattern))
