"""Tables of results: what stands in them, held against figures of their own."""

from dataclasses import replace

import pytest

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.quantity import BudgetLine, Quantity
from impact_rig.core.records import SIMULATED, Origin
from impact_rig.core.sample import FittedModel, FreeDecayEstimate, SampleEstimate
from impact_rig.core.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.references import find_reference
from impact_rig.results.tables import (
    Table,
    tabulate_budgets,
    tabulate_checks,
    tabulate_contact_laws,
    tabulate_contact_times,
    tabulate_damping,
    tabulate_free_decays,
    tabulate_identifications,
    tabulate_methods,
    tabulate_pulse_shapes,
    tabulate_results,
    tabulate_stiffness,
    tabulate_summary,
)

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
DRIVEN = FittedModel(
    "driven",
    is_preferred=True,
    contact_time=Quantity(203.21e-6, expanded=0.42e-6),
    stiffness=Quantity(45.31e6, expanded=0.11e6),
    damping_coefficient=Quantity(1171.0, expanded=3.4),
    force_balance=1.002,
    residual_over_noise=1.0,
    undetermined=("k2 and c2 only together",),
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
    stiffness=Quantity(45.0e6, expanded=1.2e6, budget=BUDGET),
    pulse_shape=SHAPE,
    free_decay=DECAY,
    identifications=(replace(DRIVEN, model="printed", is_preferred=False), DRIVEN),
    warnings=("the pulse is no versed-sine",),
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
        contact_time=Quantity(204.2e-6, expanded=2e-6),
        stiffness=Quantity(45.0e6, expanded=1e6),
        damping_coefficient=Quantity(1200.0, expanded=10.0),
    )
    hammer = HammerEstimate(Quantity(22.0e6), damping_coefficient=Quantity(1900.0))
    results = make_results(sample, hammer=hammer)
    table = tabulate_contact_times(results)
    row = find_row(table)
    # By hand: (204.2 - 203.2) / 2, (45.0 - 45.29) / 1, (1200 - 1170) / 10.
    assert (row["Paper [µs]"], row["Measured [µs]"]) == ("203.20", "204.2 ± 2.0")
    assert (row["Δ/U"], row["Hits"], row["Rejected"]) == ("0.5", "10", "2")
    assert table.marked == frozenset()
    (stiffness,) = tabulate_stiffness(results)
    assert find_row(stiffness)["Δ/U"] == "-0.3"
    assert find_row(stiffness, "hammer")["Δ/U"] == "-"
    (damping,) = tabulate_damping(results)
    assert find_row(damping)["Paper [N s/m]"] == "1170"
    assert find_row(damping)["Δ/U"] == "3.0"
    assert damping.marked == {0}


def test_the_summary_has_every_result_and_how_far_it_is_from_what_is_expected():
    sample = SampleEstimate(
        "steel medium", 10, 0, Quantity(204.2e-6, expanded=0.5e-6),
        stiffness=Quantity(45.0e6, expanded=1.16e6), damping_coefficient=Quantity(1200.0),
    )  # fmt: skip
    hammer = HammerEstimate(stiffness=Quantity(22.0e6, expanded=1.08e6))
    (table,) = tabulate_summary(make_results(sample, hammer=hammer))
    # By hand: (204.2 - 203.2) / 0.5, (45.0 - 45.29) / 1.16, (22.0 - 22.54) / 1.08.
    assert table.rows == [
        ("steel medium", "204.20 ± 0.50", "2.0", "45.0 ± 1.2", "-0.2", "1200.0"),
        ("hammer", "-", "-", "22.0 ± 1.1", "-0.5", "-"),
    ]
    assert table.marked == {0}


@pytest.mark.parametrize("plant", ["contact", "published"])
def test_only_a_plant_with_values_of_its_own_is_held_against_them(plant):
    origin = Origin(SIMULATED, f"virtual rig, plant {plant}")
    sample = SampleEstimate("steel medium", 1, 0, Quantity(204.2e-6, expanded=0.5e-6))
    hit = HitResults("steel medium", 1, 1, 1, accepted=True, origin=origin)
    (table,) = tabulate_summary(replace(make_results(sample), hits=(hit,)))
    headers = [column.header for column in table.columns]
    assert ("Δ/U" in headers) is (plant == "published")


def test_the_misprint_is_marked_wherever_its_row_is_shown(results):
    tables = tabulate_results(results)[:3]
    assert all(find_row(table, "brass medium")["Sample"] == "brass medium *" for table in tables)
    assert find_row(tables[0], "brass medium")["Paper [µs]"] == "228.00"
    assert any("prints 288.10 µs for brass medium" in note for note in tables[0].notes)


def test_samples_of_ones_own_are_held_against_their_references():
    known = SampleSet(
        (Sample("brass medium", 0.2, reference_contact_time=2e-4), Sample("zinc", 0.1)), ""
    )
    samples = [
        SampleEstimate(name, 1, 0, Quantity(2.1e-4, expanded=5e-6))
        for name in ("brass medium", "zinc")
    ]
    table = tabulate_contact_times(make_results(*samples, known=known))
    assert find_row(table, "brass medium")["Sample"] == "brass medium"
    assert find_row(table, "brass medium")["Reference [µs]"] == "200"
    assert find_row(table, "brass medium")["Δ/U"] == "2.0"
    assert find_row(table, "zinc")["Δ/U"] == "-"
    alone = tabulate_contact_times(make_results(samples[1], known=known))
    assert "Δ/U" not in find_row(alone, "zinc")


def test_the_best_shape_stands_beside_what_the_versed_sine_leaves():
    (table,) = tabulate_pulse_shapes([SAMPLE])
    row = find_row(table)
    assert (row["Best shape"], row["It leaves [%]"]) == ("half-sine", "0.12")
    assert row["Versed-sine leaves [%]"] == "3.21"
    assert (row["τp, shape [µs]"], row["k2, shape [MN/m]"]) == ("160.50", "70.00")
    doubtful = replace(SAMPLE, pulse_shape=replace(SHAPE, is_told_apart=False))
    (table,) = tabulate_pulse_shapes([doubtful])
    assert find_row(table)["Best shape"] == "half-sine ?"


def test_free_decay_and_identification_show_values_with_their_uncertainty():
    (decays,) = tabulate_free_decays([SAMPLE])
    assert find_row(decays)["c2, free decay [N s/m]"] == "1180 ± 25"
    assert find_row(decays)["ζ, free decay"] == "0.2512 ± 0.0023"
    assert find_row(decays)["f [kHz]"] == "2.500"
    (fits,) = tabulate_identifications([SAMPLE])
    row = find_row(fits)
    assert (row["τp, fit [µs]"], row["k2, fit [MN/m]"]) == ("203.21 ± 0.42", "45.31 ± 0.11")
    assert (row["c2, fit [N s/m]"], row["Model"]) == ("1171.0 ± 3.4", "driven")


def test_nothing_known_makes_no_table():
    assert tabulate_checks([SampleEstimate("tin", 0, 3)]) == []


def test_a_budget_names_each_source_and_sums_up_what_is_small():
    (table,) = tabulate_budgets("steel medium", SAMPLE)
    assert table.caption == "steel medium: k = 45.0 ± 1.2 MN/m"
    assert table.rows[0] == ("mass of the accelerometer", "B", "0.5", "80.0")
    assert table.notes == ("Below 0.05 %: sampling clock.",)


@pytest.mark.parametrize(("row", "expected"), [(0, "203.20"), (1, "45.29"), (2, "1170.0")])
def test_a_sample_by_itself_has_the_values_of_every_method(row, expected):
    table = tabulate_methods(SAMPLE, find_reference(PAPER_SETUP.samples, "steel medium"))
    assert [column.header for column in table.columns] == [
        "", "paper's method", "free decay", "fit (driven)", "expected",
    ]  # fmt: skip
    assert table.rows[row][-1] == expected
    assert table.rows[1][1] == "45.0 ± 1.2"


def test_a_contact_law_stands_with_its_uncertainty_and_what_is_said_of_several_once():
    law = ContactLaw(exponent=Quantity(1.5, 0.002, 0.004), duration=Quantity(212e-6), notes=("x",))
    samples = [SampleEstimate(name, 1, 0, contact_law=law) for name in ("light", "heavy")]
    (table,) = tabulate_contact_laws([*samples, SampleEstimate("none", 1, 0)])
    assert table.rows == [
        ("light", "1.5000 ± 0.0040", "212.00"),
        ("heavy", "1.5000 ± 0.0040", "212.00"),
    ]
    assert table.notes[1:] == ("light, heavy: x.",)
