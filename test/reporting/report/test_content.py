"""What the report says, of one run and of several."""

from dataclasses import replace

import pytest

from impact_rig.reporting.report.page import render_page
from impact_rig.reporting.report.report import make_report
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.run import Run
from impact_rig.results.traced_campaign import TracedCampaign

from .conftest import HOSTILE
from .reader import Reader


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
        assert row["Agrees"] == ("no" if abs(value - float(paper)) > expanded else "yes")


def test_both_verdicts_on_the_differences_are_met(read: Reader):
    # Damping by the log decrement is biased where the body is still driven at its largest peak.
    (head, *rows) = read.find_table("Table 4")
    assert {row[head.index("Agrees")] for row in rows} >= {"no"}
    (head, *rows) = read.find_table("Table 2")
    assert {row[head.index("Agrees")] for row in rows} == {"yes"}


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


def test_the_sensors_stand_with_their_calibration_which_was_too_old_that_day(read: Reader):
    assert read.find_table("Sensors")[1:] == [
        ["hammer", "force", "N", "2.25", "2200", "<i>LW 7", "2022-03-01"],
        ["specimen", "acceleration", "g", "-", "-", "-", "2023-03-01"],
    ]
    told = "the hammer sensor <i>LW 7 was calibrated on 2022-03-01, over a year before 2023-11-14"
    assert told in read.text
    assert "specimen sensor was calibrated" not in read.text


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
