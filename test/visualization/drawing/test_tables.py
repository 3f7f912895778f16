"""Results as tables in Markdown."""

from dataclasses import replace

import pytest

from impact_rig.results.campaign import HitResults
from impact_rig.results.estimates import HammerResults
from impact_rig.visualization.drawing.tables import write_results, write_summary


def read_rows(markdown):
    """Return the cells of the first Markdown table, its head first."""
    lines = [line for line in markdown.splitlines() if line.startswith("|")]
    del lines[1]
    return [[cell.strip(" *") for cell in line.strip("|").split(" | ")] for line in lines]


@pytest.fixture
def brass_medium(results):
    """Return a function that gives results of that sample alone, changed."""
    found = next(sample for sample in results.samples if sample.name == "brass medium")

    def change(**changes):
        return replace(
            results,
            hammer=HammerResults("aluminium large", 22.5e6, 1e5, 2e5, 1900.0, 5.0, 10.0),
            samples=(replace(found, **changes),),
            hits=(),
        )

    return change


def test_measured_values_stand_beside_the_papers_with_uncertainty_and_difference(brass_medium):
    results = brass_medium(
        impacts_accepted=10,
        impacts_rejected=2,
        contact_time_s=228.57e-6,
        contact_time_expanded_s=0.31e-6,
        stiffness_n_per_m=26.72e6,
        stiffness_expanded_n_per_m=0.25e6,
        damping_coefficient_n_s_per_m=1091.4,
        damping_coefficient_expanded_n_s_per_m=7.0,
        damping_ratio=0.2416,
        damping_ratio_expanded=0.0083,
        mse_hammer_percent=0.0003,
        mse_sample_percent=2.2604,
        notes=(),
    )

    text = write_results(results)

    head, sample, hammer = read_rows(text)
    assert head[2:5] == ["τp [µs]", "paper", "diff. [%]"]
    assert sample == [
        "brass medium \\",
        "10 (+2 rejected)",
        *("228.57 ± 0.31", "228.00", "+0.25"),
        *("26.72 ± 0.25", "26.99", "-1.00"),
        *("1091.4 ± 7.0", "1070", "+2.00"),
        "0.2416 ± 0.0083",
        *("< 0.001", "2.260"),
    ]
    assert hammer[0] == "hammer (k₁, c₁)"
    assert hammer[5:11] == ["22.50 ± 0.20", "22.54", "-0.18", "1900 ± 10", "1909", "-0.47"]
    assert "\\* Table 2 of the paper prints 288.10 µs" in text


def test_what_is_not_determined_is_a_dash_and_the_reason_stands_below(brass_medium):
    nan = float("nan")
    results = brass_medium(
        stiffness_n_per_m=nan, mse_sample_percent=nan, notes=("k2: k1 is not known",)
    )

    text = write_results(results)

    row = read_rows(text)[1]
    assert row[5] == "-"
    assert row[-1] == "-"
    assert "nan" not in text
    assert "- **brass medium**: k2: k1 is not known" in text


def test_a_remark_on_many_samples_is_made_once(results):
    noted = replace(
        results,
        hammer=replace(results.hammer, notes=()),
        samples=tuple(
            replace(sample, warnings=("weak",), notes=()) for sample in results.samples[:2]
        ),
    )

    text = write_results(noted)

    assert text.count("weak") == 1
    assert "- **aluminium small, aluminium medium**: weak" in text


def test_rejected_hits_are_listed_with_every_reason(results):
    hit = HitResults("steel small", 3, 2, 17, reasons=("gap: 9 points missing", "weak: 12 m/s^2"))

    text = write_results(replace(results, samples=(), hits=(hit,)))

    assert text.startswith("Nothing is measured yet.")
    assert "Record 17: steel small, impact 3, attempt 2" in text
    assert "- **gap**: 9 points missing\n- **weak**: 12 m/s^2" in text


def test_a_sample_by_itself_has_the_values_of_every_method(results):
    sample = results.samples[3]

    text = write_summary(results, replace(sample, warnings=("a *warning*",)))

    head, *rows = read_rows(text)
    assert head[1:] == ["paper's method", "free decay", "fit (none)", "expected"]
    assert [row[0] for row in rows] == ["τp [µs]", "k₂ [MN/m]", "c₂ [N s/m]", "ζ₂"]
    assert rows[0][1].startswith(f"{sample.contact_time_s * 1e6:.2f} ± ")
    assert rows[0][4] == "170.00"
    assert "2 hits in the mean, 0 rejected." in text
    assert "- a \\*warning\\*" in text
