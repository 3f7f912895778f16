"""What the report says, of a run."""

import re
from dataclasses import replace

import pytest

from impact_rig.configuration.particulars import Particulars
from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import PaperEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import IMPORTED, HitLabel, Origin
from impact_rig.core.hit.overrules import Overrule, Verdict
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import ReportForm, _list_facts, conclude, make_report
from impact_rig.results.tables import tabulate_results
from impact_rig.results.traces import TracedCampaign

from .conftest import HOSTILE, STATED
from .reader import Reader


def test_the_first_page_is_one_table_and_what_needs_attention(read):
    titles = [text for tag, text in read.texts if tag == "h2"]
    assert titles[:2] == ["Results", "Items and instruments"]
    start = read.text.index("Items and", read.text.index("What needs attention"))
    first = read.text[:start]
    assert [row[0] for row in read.find_table("Contact time, stiffness, damping")[1:]] == [
        HOSTILE, "brass medium *", "hammer",
    ]  # fmt: skip
    assert re.search(r"2 samples: contact time τp \d.* to \d.* µs; stiffness k ", first)
    assert "The results relate only to the items tested" in first
    for text in ("the recording was never closed", "the end is missing", "1 gap of 1000 points"):
        assert text in first


def test_the_tables_of_the_results_are_there_with_their_marks_and_figures(read, told):
    for table in tabulate_results(told.campaign.results):
        assert read.find_table(table.caption)[1:] == [list(row) for row in table.rows]
    assert "prints 288.10 µs for brass medium, a misprint" in read.text
    for symbol in ("τp", "k", "c", "ζ"):
        shares = [float(row[3]) for row in read.find_table(f"{HOSTILE}: {symbol} = ")[1:]]
        assert sum(shares) == pytest.approx(100.0, abs=0.3)
    figures = [a["alt"] or "" for a in read.find("img")]
    loops = [sample.contact_law.impact_speed.is_known for sample in told.campaign.results.samples]
    of_samples = [
        [alt for alt in figures if alt.startswith(f"{name}, ")]
        for name in (HOSTILE, "brass medium")
    ]
    assert [len(found) for found in of_samples] == [2 + it for it in loops]
    # Who does not see a figure is told what is in it.
    shown = r"a\) hammer.*: a \[m/s²\], .* to .*; below: residual over time from the middle"
    assert re.search(shown, of_samples[0][0])


def test_the_measurement_can_be_traced_back(read):
    for text in (
        "2023-11-14 22:13:20 UTC",
        "12.3 s",
        "SHA-256 " + "ab" * 32,
        "dusty",
        "9.8.7",
        "58 ppm",
    ):
        assert text in read.text
    channels = read.find_table("Sampling and calibration")
    assert channels[1:] == [
        ["hammer", "2500", "counts", "0.9765625", "0", "2000"],
        ["sample", "2500", "numbers", "1.953125", "0.25", "-"],
    ]
    bodies = {row[0]: row for row in read.find_table("Items")}
    assert bodies["hammer"][3:5] == ["100.00", "0.29"]
    assert bodies[HOSTILE][-1] == "control sample"


def test_instruments_stand_with_certificates_and_what_was_calibrated_too_long_ago(read):
    head, *rows = read.find_table("Instruments")
    found = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    assert list(found) == ["hammer sensor", "sample sensor", "balance"]
    hammer = found["hammer sensor"]
    assert (hammer["Maker"], hammer["Serial number"], hammer["Certificate"]) == (
        "PCB", "<i>LW 7", "D-K-0815",
    )  # fmt: skip
    assert (hammer["Measures"], hammer["Calibration date"]) == ("force [N]", "2022-03-01")
    assert found["sample sensor"]["Calibration date"] == "2023-03-01"
    assert found["balance"]["Model"] == "XS 204"
    told = "the hammer sensor <i>LW 7 was calibrated on 2022-03-01, over a year before 2023-11-14"
    assert told in read.text
    assert "specimen sensor was calibrated" not in read.text


def test_what_a_laboratory_states_stands_in_the_report_and_on_every_page_of_it(read, page):
    names, texts = ([text for tag, text in read.texts if tag == kind] for kind in ("dt", "dd"))
    facts = dict(zip(names, texts, strict=False))  # the last one has paragraphs
    assert facts["Laboratory"] == "Lab <7>"
    assert facts["Report number"] == '4711"; }'
    assert facts["Replaces report"] == "4710"
    assert "Customer" not in facts  # none is stated
    assert "B. <Cole> The annex is part of the report." in read.text
    assert 'End of the report 4711"; }.' in read.text
    assert facts["Specification"] == "not stated"  # there are limits
    # Nothing in a number ends the string of the style sheet that it stands in.
    (footer,) = re.findall(r'@bottom-left { content: ("[^"]*"); } }\n</style>', page)
    assert "4711" in footer
    assert read.find_table("Items")[-1][2] == "batch 9"


def test_the_first_page_says_how_far_the_results_reach(read, told):
    assert "relate only to the items tested, as received." in read.text
    by_us = Particulars({"report": {"sampling": "by the laboratory"}})
    alone = Reader(render_page(make_report([told], by_us))).text
    assert "relate only to the items tested. Without" in alone
    # Every ± has its k and degrees of freedom, those of the hammer with its control sample.
    assert "U = k u for 95 %, with k of " in read.text
    methods = [row for table in read.tables for row in table if "of the hammer" in row]
    assert [row[0] for row in methods] == ["k1 [MN/m]"]


def test_limits_are_stated_with_their_rule(read):
    (row,) = read.find_table("Conformity with the limits")[1:]
    assert (row[0], row[3], row[5]) == ("brass medium", "100.00", "200.00")
    assert row[6] == "undecided: fewer than 4 hits"
    assert "guard band U (ILAC-G8" in read.text
    assert "of 1 value with limits 1 undecided" in read.text


def test_what_a_person_says_of_an_instrument_stands_in_place_of_what_was_recorded(told):
    stated = Particulars(
        {
            "source.hammer": {"serial_number": "LW 8"},
            "source.specimen": {"calibration_date": "2021-01-02"},
            "digitizer": {"calibration_date": "2020-03-04", "calibration_due": "2030-03-04"},
            "balance": {"calibration_date": "2023-03-04", "calibration_due": "2023-11-13"},
        }
    )
    read = Reader(render_page(make_report([told], stated)))
    _, hammer, sample, *_ = read.find_table("Instruments, by their calibration sheets")
    assert "LW 8" in hammer
    assert "2022-03-01" not in hammer  # which is of the other sensor
    assert "2021-01-02" in sample
    assert "<i>LW 7" not in read.text
    assert "the hammer sensor" not in read.text
    assert "the sample sensor was calibrated on 2021-01-02" in read.text
    assert "calibration of the balance was due on 2023-11-13, before 2023-11-14" in read.text
    assert "the digitizer was" not in read.text


def test_the_method_names_its_sources_and_the_forms_that_were_used(read, told):
    paper = "“An evaluation of a simple dynamical model for impacts between rigid objects”"
    assert paper in read.text
    assert "Hertz" not in read.text.rpartition(paper)[2]
    # A customer cites the method by its number, and the paper by its place among the sources.
    assert "the paper" not in read.text.lower()
    cited = Particulars({"report": {"method": "LP-12, issue 3", "validated": "round 7"}})
    facts = dict(make_report([told], cited).method)
    assert facts["Method"].startswith(f"LP-12, issue 3, after [1]: {paper}")
    assert facts["Validated by"] == "round 7"
    results = told.campaign.results
    law = ContactLaw(Quantity(1.5), duration=Quantity(2e-4), form="δⁿ δ' + √δ δ'")
    samples = (replace(results.samples[0], contact_law=law),)
    run = replace(told, campaign=TracedCampaign(replace(results, samples=samples)))
    page = Reader(render_page(make_report([run]))).text
    assert "; by the contact law, of 1 sample: duration 200.00 µs" in page
    sources = page.rpartition(paper)[2]
    for name in ("H. Hertz", "F. R. E. Crossley", "K. Kono"):
        assert name in sources
    assert "Zener" not in sources


def test_every_hit_left_out_stands_with_its_reason(read):
    (_, row) = read.find_table("Rejected hits: 1")
    assert row[:3] == [HOSTILE, "1.1", "1"]
    assert row[4].startswith("weak: ")
    assert row[5] == "weak_hit"
    marks = {row[0]: row[1] for row in read.find_table("Hits: 5")}
    assert marks[HOSTILE] == "✗ ✓ ✓"
    assert len(read.find_table("Hits in the means: 4")) == 5


def test_without_an_accepted_hit_the_rejections_are_what_is_told(told):
    results = told.campaign.results
    hits = tuple(
        replace(
            hit, accepted=False, reasons=hit.reasons or (Finding(Reason.OVERLOAD, "at the rail"),)
        )
        for hit in results.hits
    )
    samples = tuple(SampleEstimate(sample.name, 0, 2) for sample in results.samples)
    nothing = replace(results, hits=hits, samples=samples)
    run = replace(told, campaign=TracedCampaign(nothing, (), ()))
    read = Reader(render_page(make_report([run])))
    assert "all samples: strike again, no hit was accepted" in read.text
    assert "overload (4), weak (1)" in read.text
    assert len(read.find_table("Rejected hits: 5")) == 6
    assert not any(caption.startswith("Table") for caption in read.captions)


@pytest.mark.parametrize("start", [0, 1_000_000_000])
def test_a_recording_without_a_date_is_not_of_1970(told, start):
    provenance = replace(told.provenance, start_time=start, end_time=start, notes=())
    campaign = TracedCampaign(told.campaign.results, (), ())
    undated = replace(told, campaign=campaign, provenance=provenance)
    read = Reader(render_page(make_report([undated])))
    assert "date not known" in read.text
    assert "1970" not in read.text
    stated = Particulars({"report": {"tested": "2023-11-14"}})
    assert "date not known" not in Reader(render_page(make_report([undated], stated))).text


def test_the_clock_of_imported_files_may_be_no_universal_one(told):
    origin = Origin(IMPORTED, "lvm file")
    hits = tuple(replace(hit, origin=origin) for hit in told.campaign.results.hits)
    campaign = TracedCampaign(replace(told.campaign.results, hits=hits), (), ())
    read = Reader(render_page(make_report([replace(told, campaign=campaign)])))
    assert "2023-11-14 22:13:20 UTC, if the files' clock was UTC" in read.text


def test_what_the_run_says_otherwise_stands_beside_what_is_stated(told):
    texts = {"tested": "2025-01-01", "deviations": "none", "specification": "drawing 7"}
    decided = ((HitLabel(1, 2, "oak"), Overrule(Verdict.REJECT, "loose", "Ann")),)
    run = replace(told, campaign=replace(told.campaign, overrules=decided))
    facts = dict(_list_facts([run], Particulars({"report": texts})))
    assert facts["Tested on"].endswith(" by the recording, 2025-01-01 as stated")
    assert facts["Deviations from the method"].startswith("none, beside the hits on which a")
    assert "Date of the tests" not in facts
    assert facts["Specification"] == "drawing 7"
    assert dict(_list_facts([run], Particulars()))["Specification"].startswith("none: no conform")
    day = facts["Tested on"][:10]
    same = dict(_list_facts([run], Particulars({"report": {"tested": day}})))
    assert "stated" not in same["Tested on"]


def test_the_conclusion_rounds_as_the_tables_do(told):
    results = told.campaign.results
    wide = [
        SampleEstimate(name, 5, 0, paper=PaperEstimate(Quantity(value, 5e-5, 1e-4)))
        for name, value in (("brass medium", 353.2e-6), (HOSTILE, 567.8e-6))
    ]
    for samples, text in ((wide[:1], "τp 350 ± 100 µs"), (wide, "τp 350 to 570 µs")):
        assert text in conclude(replace(results, samples=tuple(samples)), [])


def test_a_customer_gets_no_advice_and_the_short_form_no_annex(told):
    whole = Reader(render_page(make_report([told], STATED)))
    for_customer = Reader(
        render_page(make_report([told], STATED, form=ReportForm(is_for_customer=True)))
    )
    short = make_report([told], STATED, form=ReportForm(is_for_customer=True, is_short=True))
    assert "Further remarks" in whole.text
    assert "Opinion" in whole.text
    for word in ("Further remarks", "Opinion", "Use the"):
        assert word not in for_customer.text
    # What is wrong with the recording or the instruments a customer has to know.
    for text in ("the recording was never closed", "over a year before 2023-11-14"):
        assert text in for_customer.text
    assert [section.title for section in short.sections] == [
        "Results", "Items and instruments", "Set-up and recording",
    ]  # fmt: skip
    page = Reader(render_page(short))
    assert page.find("img") == []
    assert "Annex" not in page.text
    assert 'B. <Cole> End of the report 4711"; }.' in page.text


def test_the_sensors_that_measured_are_instruments_and_results_are_traced_to_certificates(told):
    bare = replace(told.campaign.results.setup, sensors=())
    results = replace(told.campaign.results, setup=bare)
    run = replace(told, campaign=replace(told.campaign, results=results))
    sections = {section.title: section for section in make_report([run]).sections}
    table, text = sections["Items and instruments"].parts[1:]
    assert [row[0] for row in table.rows] == ["hammer sensor", "sample sensor"]
    assert text.text.startswith("Traceability to the SI is not stated")
    stated = Particulars({"source.hammer": {"certificate": "D-K-0815"}})
    assert (
        "hammer sensor by certificate D-K-0815."
        in Reader(render_page(make_report([run], stated))).text
    )
