"""Verdicts in words."""

from impact_rig.results.campaign import HitResults
from impact_rig.visualization.drawing.text import format_percent, write_log_line, write_verdict

HIT = {"sample": "steel small", "record": 17, "impact": 3, "attempt": 2}


def test_an_accepted_hit_shows_which_hit_it_is_and_its_figures():
    hit = HitResults(
        **HIT,
        accepted=True,
        contact_time_s=170.254e-6,
        hammer_peak_m_per_s2=812.4,
        specimen_peak_m_per_s2=1290.6,
    )

    text = write_verdict(hit)

    assert "# steel small" in text
    assert "Impact 3, attempt 2 (record 17)" in text
    assert "## Accepted" in text
    assert "170.25 µs" in text
    assert "812 m/s²" in text
    assert "1291 m/s²" in text


def test_a_rejected_hit_names_every_reason_and_no_figure_that_is_not_there():
    reasons = ("double_hit: a second pulse of 40 % of the first", "weak: hammer peak 12 m/s^2")

    text = write_verdict(HitResults(**HIT, reasons=reasons, injected_faults=("double_hit",)))

    assert "## Rejected" in text
    assert "- **double hit**: a second pulse of 40 % of the first" in text
    assert "- **weak**: hammer peak 12 m/s^2" in text
    assert "on purpose by the virtual rig: double hit." in text
    assert "nan" not in text
    assert "Contact time" not in text


def test_a_log_line_is_one_line_of_plain_text():
    accepted = write_log_line(HitResults(**HIT, accepted=True, contact_time_s=170.254e-6))
    rejected = write_log_line(HitResults(**HIT, reasons=("gap: 9 points", "weak: 12 m/s^2")))

    assert accepted == (
        "record 17: steel small, impact 3, attempt 2: accepted, contact time 170.25 µs"
    )
    assert rejected == (
        "record 17: steel small, impact 3, attempt 2: rejected, gap: 9 points; weak: 12 m/s^2"
    )


def test_a_sample_name_cannot_break_the_text():
    text = write_verdict(HitResults(**{**HIT, "sample": "a_b\n*c*"}))

    assert text.startswith("# a\\_b \\*c\\*\n")


def test_an_error_too_small_to_be_shown_is_not_shown_as_none():
    assert format_percent(0.0004) == "< 0.001"
    assert format_percent(2.2604) == "2.260"
    assert format_percent(float("nan")) == "-"
