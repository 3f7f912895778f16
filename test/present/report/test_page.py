"""The page as HTML: read by a parser that knows nothing of its templates."""

import itertools
import re
from collections import Counter
from pathlib import Path

import pytest

from impact_rig.present.report.document import Document, Identifiers, Paragraph, Section
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import make_report

from .conftest import HOSTILE, HOSTILE_NOTE
from .reader import HEADINGS, Reader


@pytest.fixture(scope="module", params=["page", "comparison_page"])
def any_page(request: pytest.FixtureRequest) -> Reader:
    return Reader(request.getfixturevalue(request.param))


def test_headings_go_down_one_level_at_a_time_from_a_single_first_one(any_page):
    levels = [HEADINGS.index(tag) + 1 for tag, _ in any_page.elements if tag in HEADINGS]
    assert levels.count(1) == 1
    assert levels[0] == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))


def test_ids_are_unique_and_every_reference_leads_to_one(any_page):
    ids = Counter(attributes["id"] for _, attributes in any_page.elements if "id" in attributes)
    assert max(ids.values()) == 1
    for tag, attributes in any_page.elements:
        for name in ("href", "clip-path", "aria-labelledby"):
            for target in re.findall(r"#([^)\"]+)", attributes.get(name) or ""):
                assert target in ids, f"{tag} {name} leads to {target}"
        if "aria-labelledby" in attributes:
            assert attributes["aria-labelledby"] in ids


def test_tables_have_a_caption_a_head_and_cells_that_say_what_they_head(any_page):
    tables = any_page.find("table")
    assert len(tables) == len(any_page.find("caption")) == len(any_page.find("thead")) > 10
    assert all(cell.get("scope") in ("col", "row") for cell in any_page.find("th"))
    for caption, rows in zip(any_page.captions, any_page.tables, strict=True):
        assert caption
        assert len({len(row) for row in rows}) == 1, caption
        assert len(rows) > 1, caption


def test_every_figure_is_described_in_words_with_numbers(any_page):
    described = [a["aria-label"] for a in any_page.find("div") if a.get("role") == "img"]
    assert len(described) == len(any_page.find("figure")) >= 6
    assert all(text and re.search(r"\d", text) for text in described)


def test_the_page_speaks_of_no_other_place_and_runs_nothing(any_page, page):
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


def test_its_language_and_the_way_past_the_contents_are_named(read):
    assert read.find("html") == [{"lang": "en"}]
    assert {"class": "skip", "href": "#report"} in read.find("a")
    assert read.find("main") == [{"id": "report"}]


def test_names_and_notes_of_files_are_text_and_nothing_else(read, page):
    assert HOSTILE in read.text
    assert HOSTILE_NOTE in read.text
    assert "<script" not in page
    assert 'evil.example/x.png"' not in page


def test_on_paper_nothing_stays_folded(told, undrawn):
    document = make_report([told])
    folded = Reader(render_page(document)).find("details")
    unfolded = Reader(render_page(document, is_unfolded=True)).find("details")
    assert len(folded) == len(unfolded) > 0
    assert not any("open" in attributes for attributes in folded)
    assert all("open" in attributes for attributes in unfolded)


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
    read = Reader(render_page(Document("t", "s", "n", "b", True, (), sections)))
    links = [attributes["href"] for attributes in read.find("a")]
    assert links == ["#report", "#listed"]


def test_the_templates_are_installed_with_the_package():
    root = Path(__file__).parents[3]
    (pattern,) = re.findall(r"present/report/templates/\*", (root / "setup.py").read_text())
    assert list((root / "impact_rig").glob(pattern))
