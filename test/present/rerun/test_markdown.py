"""What is said in words: results, verdicts, lines of the log."""

import re
from dataclasses import replace

from impact_rig.core.given.findings import Finding, Reason, join_findings
from impact_rig.core.given.records import SIMULATED, Origin
from impact_rig.present.rerun.markdown import (
    escape_markdown,
    format_log_line,
    format_results,
    format_summary,
    format_verdict,
)
from impact_rig.results.campaign import HitResults
from impact_rig.results.tables import tabulate_results, tabulate_summary

DRAWN = "±²µΔδζτⁿ"
"""Signs that the viewer draws, as `test_rendering` has seen."""
HIT = {"sample": "steel small", "record": 17, "impact": 3, "attempt": 2}
REASONS = (
    Finding(Reason.DOUBLE_HIT, "a second pulse of 40 % of the first"),
    Finding(Reason.WEAK, "hammer peak 12 m/s^2"),
)


def read_rows(markdown):
    """Return the cells of the tables, without their heads, and without bold."""
    lines = [line for line in markdown.replace("\\", "").splitlines() if line.startswith("|")]
    heads = {place - 1 for place, line in enumerate(lines) if "--:" in line}
    return [
        [cell.strip(" *") for cell in line.strip("|").split(" | ")]
        for place, line in enumerate(lines)
        if not {place, place - 1} & heads
    ]


def test_every_table_of_the_results_is_there_row_by_row(results):
    text = format_results(results)

    tables = [*tabulate_summary(results), *tabulate_results(results)]
    expected = [[cell.strip(" *") for cell in row] for table in tables for row in table.rows]
    assert read_rows(text) == expected
    assert all(f"## {escape_markdown(table.caption)}" in text for table in tables)
    assert "\\* Table 2 of the paper prints 288.10 µs" in text


def test_a_rejected_hit_names_every_reason_and_no_figure_that_is_not_there():
    text = format_verdict(HitResults(**HIT, reasons=REASONS, injected_faults=("double_hit",)))

    assert "## Rejected" in text
    assert "- **double hit**: a second pulse of 40 % of the first" in text
    assert "- **weak**: hammer peak 12 m/s^2" in text
    assert "Fault of the virtual rig, on purpose: double hit." in text
    assert "nan" not in text
    assert "Contact time" not in text


def test_a_log_line_is_one_line_of_plain_text():
    start = "record 17: steel small, impact 3, attempt 2"
    accepted = HitResults(**HIT, accepted=True, contact_time=170.254e-6)
    assert format_log_line(accepted) == f"{start}: accepted, contact time 170.25 µs"
    simulated = format_log_line(replace(accepted, origin=Origin(SIMULATED, "virtual rig")))
    assert simulated == f"simulated {start}: accepted, contact time 170.25 µs"
    rejected = format_log_line(HitResults(**HIT, reasons=REASONS))
    assert rejected == f"{start}: rejected, {join_findings(REASONS)}"


def test_a_sample_name_cannot_break_the_text():
    text = format_verdict(HitResults(**{**HIT, "sample": "a_b\n*c*"}))

    assert text.startswith("# a\\_b \\*c\\*\n")


def test_results_have_no_sign_that_the_viewer_s_font_has_not(results):
    # A viewer without a screen ends with a panic at one: seen with the sign of proportionality.
    texts = [
        format_results(results),
        *(format_summary(results, sample) for sample in results.samples),
    ]
    assert set(re.findall(r"[^\x00-\x7f]", "".join(texts))) <= set(DRAWN)


def test_hits_are_counted_as_in_the_table_of_rejected_ones(results):
    sample = results.samples[0]
    hits = (replace(results.hits[0], accepted=False, reasons=REASONS), *results.hits[1:])

    text = format_summary(replace(results, hits=hits), sample)

    assert sample.impacts_rejected == 0
    assert "1 hit in the mean, 1 rejected." in text
