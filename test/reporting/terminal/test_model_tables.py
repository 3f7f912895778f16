"""Tables that tell whether the assumptions hold, and the budgets."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from impact_rig.reporting.terminal.budget_tables import print_budgets
from impact_rig.reporting.terminal.model_tables import (
    print_free_decays,
    print_identifications,
    print_pulse_shapes,
)
from impact_rig.reporting.terminal.remarks import print_warnings
from impact_rig.results.cross_checks import (
    FreeDecayResults,
    IdentificationResults,
    PulseShapeResults,
    ShapeFitResults,
)
from impact_rig.results.estimates import BudgetLineResults, HammerResults, SampleResults

SHAPE = PulseShapeResults(
    "half-sine",
    True,
    1.04,
    (
        ShapeFitResults("versed-sine", 3.21, 200e-6),
        ShapeFitResults("half-sine", 0.12, 160.5e-6, 70e6),
    ),
)
DECAY = FreeDecayResults(
    damping_ratio=0.2512,
    damping_ratio_u=0.001,
    damping_ratio_expanded=0.0023,
    damping_coefficient_n_s_per_m=1180.4,
    damping_coefficient_expanded_n_s_per_m=25.0,
    frequency_hz=2500.0,
    periods=3.2,
    r_squared=0.99991,
)
DRIVEN = IdentificationResults(
    "driven",
    is_preferred=True,
    contact_time_s=203.21e-6,
    contact_time_expanded_s=0.42e-6,
    stiffness_n_per_m=45.31e6,
    stiffness_expanded_n_per_m=0.11e6,
    damping_coefficient_n_s_per_m=1171.0,
    damping_coefficient_expanded_n_s_per_m=3.4,
    force_balance=1.002,
    residual_over_noise=1.0,
    undetermined=("k2 and c2 only together",),
)
BUDGET = (
    BudgetLineResults("stiffness", "mass of the accelerometer", "B", 0.5e6, 0.8),
    BudgetLineResults("stiffness", "contact time, hit to hit", "A", 0.25e6, 0.1999),
    BudgetLineResults("stiffness", "sampling clock", "B", 5e3, 0.0001),
)
SAMPLE = SampleResults(
    "steel medium",
    10,
    0,
    stiffness_n_per_m=45.0e6,
    stiffness_expanded_n_per_m=1.2e6,
    pulse_shape=SHAPE,
    free_decay=DECAY,
    identifications=(replace(DRIVEN, model="printed", is_preferred=False), DRIVEN),
    budget=BUDGET,
    warnings=("the pulse is no versed-sine",),
)


def render(function, argument, width=80):
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
    function(console, argument)
    return console.file.getvalue()


def test_the_best_shape_stands_beside_what_the_versed_sine_leaves():
    row = find_row(render(print_pulse_shapes, [SAMPLE]))
    assert row == ["half-sine", "0.12", "3.21", "160.50", "70.00", "1.040"]


def test_shapes_that_are_not_told_apart_are_marked():
    sample = replace(SAMPLE, pulse_shape=replace(SHAPE, is_told_apart=False))
    assert find_row(render(print_pulse_shapes, [sample]))[:2] == ["half-sine", "?"]


def test_free_decay_and_identification_show_values_with_their_uncertainty():
    assert find_row(render(print_free_decays, [SAMPLE])) == [
        "1180", "±", "25", "0.2512", "±", "0.0023", "2.500", "3.2", "0.9999",
    ]  # fmt: skip
    assert find_row(render(print_identifications, [SAMPLE], 100)) == [
        "203.21", "±", "0.42", "45.31", "±", "0.11", "1171.0", "±", "3.4", "1.0", "1.002",
        "driven",
    ]  # fmt: skip


def test_what_the_traces_do_not_determine_is_said():
    text = render(print_identifications, [SAMPLE])
    assert "- steel medium: k2 and c2 only together" in text


@pytest.mark.parametrize(
    "function", [print_pulse_shapes, print_free_decays, print_identifications, print_warnings]
)
def test_nothing_known_prints_nothing(function):
    assert render(function, [SampleResults("tin", 0, 3)]) == ""


@pytest.mark.parametrize(
    "function", [print_pulse_shapes, print_free_decays, print_identifications]
)
@pytest.mark.parametrize("width", [40, 80])
def test_tables_keep_to_the_terminal(function, width):
    assert max(map(len, render(function, [SAMPLE], width).splitlines())) <= width


def test_a_budget_names_each_source_and_sums_up_what_is_small():
    text = render(lambda *args: print_budgets(*args, HammerResults()), [SAMPLE])
    assert "steel medium: k = 45.0 ± 1.2 MN/m" in text
    assert find_row(text, "mass of the accelerometer") == ["B", "0.5", "80.0"]
    assert "below 0.05 %: sampling clock." in text


def test_a_warning_is_printed_once_with_the_samples_it_holds_for():
    text = render(print_warnings, [SAMPLE, replace(SAMPLE, name="zinc")])
    assert "- all samples: the pulse is no versed-sine" in text


def find_row(text, name="steel medium"):
    line = next(line for line in text.splitlines() if line.startswith(name))
    return line.removeprefix(name).split()
