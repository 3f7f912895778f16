"""Tables of results: what stands in them, held against figures of their own."""

from dataclasses import replace

import pytest

from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.estimation.fits import FittedModel, FreeDecayEstimate
from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.quantity import BudgetLine, Quantity
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import Sample, SampleSet
from impact_rig.results.campaign import Results
from impact_rig.results.references import find_reference
from impact_rig.results.results_file import results_to_json
from impact_rig.results.tables import (
    Table,
    find_largest_differences,
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
    tabulate_size_exponents,
    tabulate_stiffness,
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
        contact_time=Quantity(204.2e-6),
        stiffness=Quantity(45.0e6),
        damping_coefficient=Quantity(1200.0),
    )
    hammer = HammerEstimate(Quantity(22.0e6), damping_coefficient=Quantity(1900.0))
    results = make_results(sample, hammer=hammer)
    row = find_row(tabulate_contact_times(results))
    # By hand: 204.2 / 203.2, 45.0 / 45.29, 1200 / 1170, 22.0 / 22.54.
    assert (row["Paper [µs]"], row["Measured [µs]"]) == ("203.20", "204.20")
    assert (row["Difference [%]"], row["Hits"], row["Rejected"]) == ("+0.49", "10", "2")
    (stiffness,) = tabulate_stiffness(results)
    assert find_row(stiffness)["Difference [%]"] == "-0.64"
    assert find_row(stiffness, "hammer")["Difference [%]"] == "-2.40"
    (damping,) = tabulate_damping(results)
    assert find_row(damping)["Paper [N s/m]"] == "1170"
    assert find_row(damping)["Difference [%]"] == "+2.56"
    largest = find_largest_differences(results)
    assert {symbol: round(value, 2) for symbol, (value, _) in largest.items()} == {
        "τp": 0.49, "k": 0.64, "c": 2.56,
    }  # fmt: skip


def test_a_difference_beyond_the_uncertainty_is_marked_and_said():
    sure, unsure = (
        SampleEstimate(name, 10, 0, Quantity(204.2e-6, expanded=expanded))
        for name, expanded in (("steel medium", 0.99e-6), ("steel small", 34.3e-6))
    )
    table = tabulate_contact_times(make_results(sure, unsure))
    # By hand: 204.2 is 1.0 from 203.2 and 34.2 from 170.0.
    assert find_row(table)["Agrees"] == "no"
    assert find_row(table, "steel small")["Agrees"] == "yes"
    assert table.marked == {0}
    alone = tabulate_contact_times(make_results(replace(sure, contact_time=Quantity(204.2e-6))))
    assert "Agrees" not in find_row(alone)
    assert alone.marked == frozenset()


def test_the_misprint_is_marked_wherever_its_row_is_shown(results):
    tables = tabulate_results(results)[:3]
    assert all(find_row(table, "brass medium")["Sample"] == "brass medium *" for table in tables)
    assert find_row(tables[0], "brass medium")["Paper [µs]"] == "228.00"
    assert any("prints 288.10 µs for brass medium" in note for note in tables[0].notes)


def test_samples_of_ones_own_are_held_against_their_references():
    known = SampleSet(
        (Sample("brass medium", 0.2, reference_contact_time=2e-4), Sample("zinc", 0.1)), ""
    )
    samples = [SampleEstimate(name, 1, 0, Quantity(2.1e-4)) for name in ("brass medium", "zinc")]
    table = tabulate_contact_times(make_results(*samples, known=known))
    assert find_row(table, "brass medium")["Sample"] == "brass medium"
    assert find_row(table, "brass medium")["Reference [µs]"] == "200"
    assert find_row(table, "brass medium")["Difference [%]"] == "+5.00"
    assert find_row(table, "zinc")["Difference [%]"] == "-"
    alone = tabulate_contact_times(make_results(samples[1], known=known))
    assert "Difference [%]" not in find_row(alone, "zinc")


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


def test_contact_times_over_mass_give_the_exponent_of_each_material_and_of_all():
    setup = PAPER_SETUP
    names = [name for name in setup.samples.names if name.startswith(("steel", "brass"))]
    samples = []
    for place, name in enumerate(names):
        mass = 1.0 / (1.0 / setup.hammer_mass + 1.0 / setup.samples.get_moving_mass(name))
        scatter = 1.0 + 1e-3 * (-1) ** place
        law = ContactLaw(duration=Quantity(500e-6 * mass**0.4 * scatter))
        times = Quantity(600e-6 * mass**0.5 * scatter)
        samples.append(SampleEstimate(name, 1, 0, contact_time=times, contact_law=law))
    results = Results(setup, HammerEstimate(), tuple(samples), ())
    (table,) = tabulate_size_exponents(results)
    assert [row[0] for row in table.rows] == ["all", "steel", "brass"]
    for row in table.rows:
        by_width, by_law = (float(row[place].split()[0]) for place in (1, 3))
        assert by_width == pytest.approx(0.5, abs=0.02)
        assert by_law == pytest.approx(0.4, abs=0.02)
        assert 0.01 < float(row[2]) < 0.2
    stored = results_to_json(results)["size_exponents"]
    assert [item["material"] for item in stored] == ["", "steel", "brass"]
    assert stored[0]["by_contact_law"] == pytest.approx(0.4, abs=0.02)
    assert 0.0 < stored[0]["by_contact_law_u"] < stored[0]["by_contact_law_expanded"] < 0.02
    assert (stored[0]["hertz"], stored[0]["linear_spring"]) == (0.4, 0.5)
    few = replace(results, samples=tuple(samples[:2]))
    assert tabulate_size_exponents(few) == []
    assert results_to_json(few)["size_exponents"] == []
