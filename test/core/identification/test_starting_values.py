"""Where a search starts: from what is believed, if it can be, and from the traces."""

import math
from itertools import islice

import numpy as np
import pytest

from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.identification.starting_values import StartingValues, find_starts
from impact_rig.core.model.impact import ModelVariant

TRUTH = {
    "tau_p": 203e-6, "t0": 1.01e-4, "k2": 45e6, "c2": 1700.0, "F0": 60.0, "k1": 22e6,
    "c1": 1900.0, "sample gain": 1.0,
}  # fmt: skip


def make_traces(variant: ModelVariant) -> tuple[MeasuredModel, np.ndarray]:
    measured = MeasuredModel(variant, 0.1, 0.17, 0.08, 500e3, 600)
    return measured, measured.simulate(np.array([TRUTH.get(name, 0.0) for name in measured.names]))


def read(measured: MeasuredModel, values: np.ndarray, name: str) -> float:
    return float(values[measured.names.index(name)])


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected"),
    [
        (45e6, 1700.0, True),
        (45e6, 0.0, True),
        (0.0, 1700.0, False),
        (45e6, -1.0, False),
        (math.nan, 1700.0, False),
        (45e6, math.nan, False),
        (math.inf, 1700.0, False),
    ],
)
def test_a_body_has_a_positive_stiffness_and_no_negative_damping(
    stiffness: float, damping: float, expected: bool
) -> None:
    assert StartingValues(stiffness, damping).has_specimen is expected
    hammer = StartingValues(hammer_stiffness=stiffness, hammer_damping_coefficient=damping)
    assert hammer.has_hammer is expected


@pytest.mark.parametrize("variant", ModelVariant)
def test_belief_in_a_body_that_cannot_be_is_ignored(variant: ModelVariant) -> None:
    measured, traces = make_traces(variant)
    impossible = StartingValues(45e6, -1700.0, -22e6, 1900.0)
    found = list(islice(find_starts(measured, traces, impossible), 5))
    expected = list(islice(find_starts(measured, traces, StartingValues()), 5))
    np.testing.assert_array_equal(found, expected)


def test_a_true_hammer_and_sample_are_the_most_promising_of_the_printed_model() -> None:
    measured, traces = make_traces(ModelVariant.PRINTED)
    truth = StartingValues(TRUTH["k2"], TRUTH["c2"], TRUTH["k1"], TRUTH["c1"])
    first = next(find_starts(measured, traces, truth))
    for name in ("k1", "c1", "k2", "c2"):
        assert read(measured, first, name) == pytest.approx(TRUTH[name])
