"""Figures and their goals."""

import numpy as np
import pytest

from impact_rig.bench.figures import Figure, at_least, at_most


def test_the_spread_is_between_the_quartiles() -> None:
    values = (3.0, 1.0, 2.0, 10.0, 4.0, 2.5)
    figure = Figure("time", values)
    assert figure.median == np.median(values)
    assert figure.quartiles == pytest.approx(np.percentile(values, [25, 75]))


def test_a_single_measurement_has_no_spread() -> None:
    assert Figure("lost", (0.0,)).quartiles == (0.0, 0.0)


@pytest.mark.parametrize(
    ("goal", "value", "is_reached"),
    [
        (at_most(2.0), 2.0, True),
        (at_most(2.0), 2.001, False),
        (at_least(1.7), 1.7, True),
        (at_least(1.7), 1.699, False),
        (at_most(2.0), float("nan"), False),
        (None, 1.0, None),
    ],
)
def test_the_median_decides_whether_a_goal_is_reached(
    goal: object, value: float, is_reached: bool | None
) -> None:
    assert Figure("ratio", (value,), goal=goal).is_reached is is_reached


def test_a_goal_reads_as_a_sentence() -> None:
    assert str(at_most(0.5)) == "at most 0.5"
    assert str(at_least(1.7)) == "at least 1.7"
