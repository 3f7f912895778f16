"""Tables of results and the numbers in them, held against figures of their own."""

import csv
import io
import math
from dataclasses import replace
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import BudgetLine, Quantity
from impact_rig.core.given.records import IMPORTED, SIMULATED, Origin
from impact_rig.core.given.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.results import tables
from impact_rig.results.campaign import FileResults, HitResults, Results
from impact_rig.results.numbers import format_quantity, format_uncertain
from impact_rig.results.remarks import tabulate_hits
from impact_rig.results.results_file import format_results_table
from impact_rig.results.table import Table

SHAPE = PulseShapeEstimate(
    "half-sine",
    True,
    1.04,
    (
        ShapeFit("versed-sine", 3.21, 200e-6),
        ShapeFit("half-sine", 0.12, 160.5e-6, 70e6),
    ),
)
DECAY = FreeDecayEstimate(
    damping_ratio=Quantity(0.2512, 0.001, 0.0023),
    damping_coefficient=Quantity(1180.4, expanded=25.0),
    frequency=2500.0,
    periods=3.2,
    r_squared=0.99991,
)
BUDGET = (
    BudgetLine("mass of the accelerometer", "B", 0.5e6, 0.8),
    BudgetLine("contact time, hit to hit", "A", 0.25e6, 0.1999),
    BudgetLine("sampling clock", "B", 5e3, 0.0001),
)
SAMPLE = SampleEstimate(
    "steel medium",
    10,
    0,
    paper=PaperEstimate(stiffness=Quantity(45.0e6, expanded=1.2e6, budget=BUDGET)),
    pulse_shape=SHAPE,
    free_decay=DECAY,
    warnings=(Note(Subject.PULSE_SHAPE, "it is no versed-sine"),),
)


NO_HAMMER = HammerEstimate()


def find_row(table: Table, name: str = "steel medium") -> dict[str, str]:
    row = next(row for row in table.rows if row[0].startswith(name))
    return {column.header: cell for column, cell in zip(table.columns, row, strict=True)}


def make_results(
    *samples: SampleEstimate,
    hammer: HammerEstimate = NO_HAMMER,
    known: SampleSet = PAPER_SETUP.samples,
) -> Results:
    return Results(replace(PAPER_SETUP, samples=known), hammer, samples, ())


def test_paper_and_measured_stand_side_by_side_with_their_difference():
    sample = SampleEstimate(
        "steel medium",
        10,
        2,
        paper=PaperEstimate(
            contact_time=Quantity(204.2e-6, expanded=2e-6),
            stiffness=Quantity(45.0e6, expanded=1e6),
            damping_coefficient=Quantity(1200.0, expanded=10.0),
        ),
    )
    hammer = HammerEstimate(Quantity(22.0e6), damping_coefficient=Quantity(1900.0))
    results = make_results(sample, hammer=hammer)
    table = tables.tabulate_contact_times(results)
    row = find_row(table)
    # By hand: (204.2 - 203.2) / 2, (45.0 - 45.29) / 1, (1200 - 1170) / 10.
    assert (row["Paper [µs]"], row["Measured [µs]"]) == ("203.20", "204.2 ± 2.0")
    assert (row["Δ/U"], row["Hits"], row["Rejected"]) == ("0.5", "10", "2")
    assert table.marked == frozenset()
    (stiffness,) = tables.tabulate_stiffness(results)
    assert find_row(stiffness)["Δ/U"] == "-0.3"
    assert find_row(stiffness, "hammer")["Δ/U"] == "-"
    (damping,) = tables.tabulate_damping(results)
    assert find_row(damping)["Paper [N s/m]"] == "1170"
    assert find_row(damping)["Δ/U"] == "3.0"
    assert damping.marked == {0}


def test_the_summary_has_every_result_and_how_far_it_is_from_what_is_expected():
    paper = PaperEstimate(
        Quantity(204.2e-6, expanded=0.5e-6),
        stiffness=Quantity(45.0e6, expanded=1.16e6),
        damping_coefficient=Quantity(1200.0),
    )
    sample = SampleEstimate("steel medium", 10, 0, paper)
    hammer = HammerEstimate(stiffness=Quantity(22.0e6, expanded=1.08e6))
    (table,) = tables.tabulate_summary(make_results(sample, hammer=hammer))
    # By hand: (204.2 - 203.2) / 0.5, (45.0 - 45.29) / 1.16, (22.0 - 22.54) / 1.08.
    assert table.rows == [
        ("steel medium", "204.20 ± 0.50 !", "2.0", "45.0 ± 1.2", "-0.2", "1200.0"),
        ("hammer", "-", "-", "22.0 ± 1.1", "-0.5", "-"),
    ]
    assert table.marked == {0}


@pytest.mark.parametrize("plant", ["contact", "published"])
def test_only_a_plant_with_values_of_its_own_is_held_against_them(plant):
    origin = Origin(SIMULATED, f"virtual rig, plant {plant}")
    sample = SampleEstimate(
        "steel medium", 4, 0, PaperEstimate(Quantity(204.2e-6, expanded=0.5e-6))
    )
    hit = HitResults("steel medium", 1, 1, 1, accepted=True, origin=origin)
    (table,) = tables.tabulate_summary(replace(make_results(sample), hits=(hit,)))
    headers = [column.header for column in table.columns]
    assert ("Δ/U" in headers) is (plant == "published")


def test_the_misprint_is_marked_wherever_its_row_is_shown(results):
    shown = tables.tabulate_results(results)[:3]
    assert all(find_row(table, "brass medium")["Sample"] == "brass medium *" for table in shown)
    assert find_row(shown[0], "brass medium")["Paper [µs]"] == "228.00"
    assert any("prints 288.10 µs for brass medium" in note for note in shown[0].notes)


def test_samples_of_ones_own_are_held_against_their_references():
    known = SampleSet(
        (Sample("brass medium", 0.2, reference_contact_time=2e-4), Sample("zinc", 0.1)), ""
    )
    samples = [
        SampleEstimate(name, 4, 0, PaperEstimate(Quantity(2.1e-4, expanded=5e-6)))
        for name in ("brass medium", "zinc")
    ]
    table = tables.tabulate_contact_times(make_results(*samples, known=known))
    assert find_row(table, "brass medium")["Sample"] == "brass medium"
    assert find_row(table, "brass medium")["Reference [µs]"] == "200"
    assert find_row(table, "brass medium")["Δ/U"] == "2.0"
    assert find_row(table, "zinc")["Δ/U"] == "-"
    alone = tables.tabulate_contact_times(make_results(samples[1], known=known))
    assert "Δ/U" not in find_row(alone, "zinc")


def test_the_best_shape_stands_beside_what_the_versed_sine_leaves():
    (table,) = tables.tabulate_pulse_shapes([SAMPLE])
    row = find_row(table)
    assert (row["Best shape"], row["It leaves [%]"]) == ("half-sine", "0.12")
    assert row["Versed-sine leaves [%]"] == "3.21"
    assert (row["τp, shape [µs]"], row["k2, shape [MN/m]"]) == ("160.50", "70.00")
    doubtful = replace(SAMPLE, pulse_shape=replace(SHAPE, is_clear=False))
    (table,) = tables.tabulate_pulse_shapes([doubtful])
    assert find_row(table)["Best shape"] == "half-sine ?"


def test_a_free_decay_shows_values_with_their_uncertainty():
    (decays,) = tables.tabulate_free_decays([SAMPLE])
    assert find_row(decays)["c2, free decay [N s/m]"] == "1180 ± 25"
    assert find_row(decays)["ζ, free decay"] == "0.2512 ± 0.0023"
    assert find_row(decays)["f [kHz]"] == "2.500"


def test_where_no_k2_is_known_the_first_table_has_k_eq():
    paper = PaperEstimate(equivalent_stiffness=Quantity(8.8e6, 1.4e6, 2.9e6, 6.5e6, 12.6e6))
    sample = SampleEstimate("steel medium", 10, 0, paper=paper)
    (table,) = tables.tabulate_summary(make_results(sample))
    assert find_row(table)["k_eq [MN/m]"] == "8.8 +3.8 -2.3"
    known = replace(sample, paper=replace(paper, stiffness=Quantity(20e6)))
    (table,) = tables.tabulate_summary(make_results(known))
    assert "k_eq [MN/m]" not in find_row(table)


def test_nothing_known_makes_no_table():
    assert tables.tabulate_checks([SampleEstimate("tin", 0, 3)]) == []


def test_a_budget_names_each_source_and_sums_up_what_is_small():
    (table,) = tables.tabulate_budgets("steel medium", SAMPLE)
    assert table.caption == "steel medium: k = 45.0 ± 1.2 MN/m"
    assert table.rows[0] == ("mass of the accelerometer", "B", "0.5", "80.0")
    assert table.notes == ("Below 0.05 %: sampling clock.",)


def test_a_sample_by_itself_has_every_method_with_coverage_factor_and_freedom():
    stiffness = replace(SAMPLE.paper.stiffness, standard=0.5e6, degrees_of_freedom=9.7)
    law = ContactLaw(duration=Quantity(200e-6), equivalent_stiffness=Quantity(30e6))
    sample = replace(SAMPLE, paper=replace(SAMPLE.paper, stiffness=stiffness), contact_law=law)
    table = tables.tabulate_methods(make_results(sample), sample)
    assert [column.header for column in table.columns] == [
        "", "Method", "Value ± U", "U [%]", "k", "DoF", "Expected",
    ]  # fmt: skip
    rows = {row[:2]: row[2:] for row in table.rows}
    # k is U over u; the degrees of freedom are cut, not rounded (GUM G.4.2).
    assert rows["k2 [MN/m]", "the paper's"] == (
        "45.0 ± 1.2", "2.7", f"{1.2 / 0.5:.2f}", "9", "45.29",
    )  # fmt: skip
    assert rows["c2 [N s/m]", "free decay"][0] == "1180 ± 25"
    assert rows["τ [µs]", "contact law"][0] == "200.00"
    assert rows["k_eq [MN/m]", "law's linear spring"][0] == "30.00"  # it is of both bodies
    expected = [row[-1] for row in table.rows if row[1] == "the paper's"]
    assert expected == ["203.20", "45.29", "1170.0"]


def test_where_uncertainties_come_from_stands_in_a_line_a_body():
    (table,) = tables.tabulate_shares(make_results(SAMPLE))
    assert table.rows[0][:1] == ("steel medium",)
    assert "mass of the accelerometer 80" in table.rows[0]


def test_a_contact_law_stands_with_its_uncertainty_and_what_is_said_of_several_once():
    law = ContactLaw(
        exponent=Quantity(1.5, 0.002, 0.004),
        duration=Quantity(212e-6),
        notes=(Note(Subject.CONTACT_LAW, "x"),),
    )
    samples = [SampleEstimate(name, 1, 0, contact_law=law) for name in ("light", "heavy")]
    (table,) = tables.tabulate_contact_laws([*samples, SampleEstimate("none", 1, 0)])
    assert table.rows == [
        ("light", "1.5000 ± 0.0040", "212.00"),
        ("heavy", "1.5000 ± 0.0040", "212.00"),
    ]
    assert table.notes[1:] == ("light, heavy: x.",)
    assert "within 3 %, standard, where nothing states it" in table.notes[0]


@pytest.mark.parametrize(
    ("value", "expanded", "text"),
    [
        (212.1234, 0.4321, "212.12 ± 0.43"),
        (45.286, 1.234, "45.3 ± 1.2"),
        (2423.4, 341.0, "2420 ± 340"),
        # The rounded uncertainty gains a digit: it still has two.
        (0.5, 0.0996, "0.50 ± 0.10"),
        (-0.001, 0.5, "0.00 ± 0.50"),
    ],
)
def test_a_value_is_rounded_where_its_uncertainty_is(value, expanded, text):
    assert format_uncertain(value, expanded, 2) == text


@pytest.mark.parametrize(
    ("lower", "upper", "text"),
    [
        (0.27e6, 0.893e6, "0.45 +0.44 -0.18"),
        (0.27e6, math.nan, "0.45 +∞ -0.18"),
        # The smaller half-width says how many digits there are.
        (0.441e6, 0.95e6, "0.4500 +0.5000 -0.0090"),
    ],
)
def test_an_uneven_interval_is_shown_by_both_of_its_half_widths(lower, upper, text):
    found = Quantity(0.45e6, 0.13e6, 0.26e6, lower, upper)
    assert format_quantity(found, 2, 1e-6) == text


def test_a_deviation_counts_on_the_side_where_the_expected_value_lies():
    # Expected: 45.29 MN/m.
    for lower, upper, deviation in ((20e6, 50.58e6, "-0.5"), (20e6, math.nan, "0.0")):
        paper = PaperEstimate(stiffness=Quantity(40e6, 5e6, 10e6, lower, upper))
        (table,) = tables.tabulate_stiffness(
            make_results(SampleEstimate("steel medium", 10, 0, paper=paper))
        )
        assert find_row(table)["Δ/U"] == deviation


def test_of_few_hits_or_by_few_on_the_control_sample_no_deviation_is_stated():
    paper = PaperEstimate(
        contact_time=Quantity(210e-6, 1e-6, 2e-6), stiffness=Quantity(40e6, 5e6, 10e6)
    )
    bodies = [SampleEstimate("steel medium", 10, 0, paper=paper)]
    for name, hits in (("steel small", 1), ("aluminium large", 3)):
        bodies.append(SampleEstimate(name, hits, 0, paper=paper))
    results = Results(PAPER_SETUP, HammerEstimate(), tuple(bodies), ())
    table = tables.tabulate_contact_times(results)
    assert [row[3] for row in table.rows] == ["3.4", "-", "-"]
    assert [row[2].endswith(", one hit") for row in table.rows] == [False, True, False]
    assert [row[2][-1] for row in table.rows] == ["!", "t", "0"]
    told = "y fewer than 4 hits: how hits scatter is hardly known, so ± may be too small"
    told += " (JCGM 101, 6.4.9.4)."
    assert f"steel small, aluminium large: b{told}" in table.notes
    # k2 of all is by k1, which is by three hits.
    (stiffness,) = tables.tabulate_stiffness(results)
    assert f"B{told}" in stiffness.notes
    assert tables.count_expected(results) == (0, 1)
    known = replace(results, setup=replace(PAPER_SETUP, hammer_stiffness=22.54e6))
    assert find_row(tables.tabulate_stiffness(known)[0])["Δ/U"] != "-"


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e9))
def test_what_is_shown_lies_half_a_last_digit_from_the_truth_at_most(value, expanded):
    shown, wide = (Decimal(part) for part in format_uncertain(value, expanded, 2).split(" ± "))
    # Two digits of the uncertainty: its last one is worth 1 to 10 % of it.
    step = Decimal(10) ** (Decimal(repr(float(wide))).adjusted() - 1)
    assert abs(shown - Decimal(value)) <= Decimal("0.5000001") * step
    assert abs(wide - Decimal(expanded)) <= Decimal("0.5000001") * step
    assert len(wide.normalize().as_tuple().digits) <= 2


GOOD = FileResults(
    Origin(IMPORTED, "npy file", "lab/hit_1.npy", "'a', points 0 to 99"),
    True,
    (),
    half_amplitude_width=Quantity(100e-6, 0.1e-6, 0.2e-6),
    base_width=Quantity(190e-6, 0.5e-6, 1e-6),
    contact_time=Quantity(200e-6, 0.6e-6, 1.2e-6),
    width_ratio=1.59,
    hammer_peak=512.0,
    best_shape="versed-sine",
    shape_residual_percent=0.31,
    measured_peak=512.0,
)
BAD = FileResults(
    Origin(IMPORTED, "npy file", "lab/hit_2.npy"),
    False,
    (Finding(Reason.OVERLOAD, "5 points at the rail"),),
)


def test_each_hit_has_its_row_with_verdict_and_widths():
    table = tabulate_hits((GOOD, BAD))
    assert table.rows[0] == (
        "hit_1.npy", "200.0 ± 1.2", "accepted", "100.00 ± 0.20", "190.0 ± 1.0", "1.590",
        "versed-sine", "0.3", "512", "'a', points 0 to 99",
    )  # fmt: skip
    assert table.rows[1][:3] == ("hit_2.npy", "-", "overload: 5 points at the rail")
    assert table.marked == {1}
    # Folders are shown where the names are the same.
    table = tabulate_hits((GOOD, FileResults(Origin(IMPORTED, file="other/hit_1.npy"), True, ())))
    assert [row[0] for row in table.rows] == ["lab/hit_1.npy", "other/hit_1.npy"]


@pytest.mark.parametrize("name", ['=HYPERLINK("x")', "+1+2", "-cmd", "@sum", "'tis"])
def test_no_cell_is_a_formula_and_the_name_is_behind_an_apostrophe(name):
    samples = SampleSet((Sample(name, 0.1),), "")
    estimate = SampleEstimate(
        name, 1, 0, paper=PaperEstimate(hammer_peak=-2.5, specimen_peak=math.nan)
    )
    results = Results(replace(PAPER_SETUP, samples=samples), HammerEstimate(), (estimate,), ())
    (row,) = csv.DictReader(io.StringIO(format_results_table([results])))
    assert row["name"] == f"'{name}"
    assert row["hammer_peak_m_per_s2"] == "-2.5"
    assert row["specimen_peak_m_per_s2"] == ""
