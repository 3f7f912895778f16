"""Verdicts and tables in words."""

import math

from impact_rig.core.signals.record import HitLabel
from impact_rig.visualization.text import (
    EstimateRow,
    EstimateTable,
    Quantity,
    Verdict,
    write_log_line,
    write_table,
    write_verdict,
)

LABEL = HitLabel("steel small", record=17, impact=3, attempt=2)


def read_rows(markdown):
    """Return the cells of a Markdown table, its head first."""
    lines = [line for line in markdown.splitlines() if line.startswith("|")]
    del lines[1]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_an_accepted_hit_shows_which_hit_it_is_and_its_figures():
    verdict = Verdict(LABEL, True, (), 170.254e-6, 812.4, 1290.6)

    text = write_verdict(verdict)

    assert "# steel small" in text
    assert "Impact 3, attempt 2 (record 17)" in text
    assert "## Accepted" in text
    assert "170.25 µs" in text
    assert "812 m/s²" in text
    assert "1291 m/s²" in text


def test_a_rejected_hit_names_every_reason_and_no_figure_that_is_not_there():
    reasons = ("double_hit: a second pulse of 40 % of the first", "weak: hammer peak 12 m/s^2")

    text = write_verdict(Verdict(LABEL, False, reasons))

    assert "## Rejected" in text
    assert "- **double hit**: a second pulse of 40 % of the first" in text
    assert "- **weak**: hammer peak 12 m/s^2" in text
    assert "nan" not in text
    assert "Contact time" not in text


def test_a_log_line_is_one_line_of_plain_text():
    accepted = write_log_line(Verdict(LABEL, True, (), 170.254e-6))
    rejected = write_log_line(Verdict(LABEL, False, ("gap: 9 points", "weak: 12 m/s^2")))

    assert accepted == (
        "record 17: steel small, impact 3, attempt 2: accepted, contact time 170.25 µs"
    )
    assert rejected == (
        "record 17: steel small, impact 3, attempt 2: rejected, gap: 9 points; weak: 12 m/s^2"
    )


def test_the_table_sets_measured_beside_expected_values_with_their_difference():
    row = EstimateRow(
        "brass medium",
        10,
        2,
        contact_time=Quantity(228.57e-6, 228.0e-6),
        stiffness=Quantity(26.72e6, 26.99e6),
        damping_coefficient=Quantity(1091.4, 1070.0),
        mse_hammer_percent=0.0003,
        mse_sample_percent=2.2604,
        mark="*",
    )
    table = EstimateTable(
        (row,),
        Quantity(22.5e6, 22.54e6),
        Quantity(1900.0, 1909.0),
        "paper",
        ("* a misprint",),
    )

    text = write_table(table)

    head, cells = read_rows(text)
    assert head[2:5] == ["τp [µs]", "paper", "diff. [%]"]
    assert cells == [
        "brass medium\\*",
        "10 (+2 rejected)",
        *("228.57", "228.00", "+0.25"),
        *("26.72", "26.99", "-1.00"),
        *("1091", "1070", "+2.00"),
        *("< 0.001", "2.260"),
    ]
    assert "k₁ = 22.50 MN/m (paper 22.54)" in text
    assert "\\* a misprint" in text


def test_what_is_not_determined_is_a_dash():
    head, cells = read_rows(write_table(EstimateTable((EstimateRow("a", 0, 3),))))

    assert len(cells) == len(head)
    assert set(cells[2:]) == {"-"}


def test_a_sample_name_cannot_break_the_table():
    head, cells = read_rows(
        write_table(EstimateTable((EstimateRow("a_b\n*c*", 1, 0, Quantity(math.inf, 0.0)),)))
    )

    assert len(cells) == len(head)
    assert cells[0] == "a\\_b \\*c\\*"
