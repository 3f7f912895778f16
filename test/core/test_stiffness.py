"""Equations (5) and (6) against Table 3 and the oscillator they describe."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from impact_rig.core.errors import NotDeterminedError, ParameterError
from impact_rig.core.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)

masses = st.floats(1e-3, 10)
stiffnesses = st.floats(1e3, 1e9)


def test_contact_time_is_when_two_bodies_on_a_spring_part():
    m1, m2, k = 0.1, 0.17, 15e6

    def move(_: float, y: np.ndarray) -> list[float]:
        pull = k * (y[0] - y[1])
        return [y[2], y[3], -pull / m1, pull / m2]

    def part(_: float, y: np.ndarray) -> float:
        return y[0] - y[1]

    part.terminal, part.direction = True, -1
    path = solve_ivp(
        move, (0, 1e-3), [0, 0, 0.08, 0], "DOP853", events=part, rtol=1e-10, atol=1e-16
    )
    expected = np.pi * np.sqrt(estimate_equivalent_mass(m1, m2) / k)
    assert path.t_events[0][0] == pytest.approx(expected, rel=1e-7)


@given(sample=stiffnesses, ratio=st.floats(1e-3, 1e3))
def test_springs_in_series_are_taken_apart_again(sample, ratio):
    hammer = sample * ratio
    equivalent = hammer * sample / (hammer + sample)
    # The difference 1/k_eq - 1/k1 loses the digits of the ratio.
    assert estimate_sample_stiffness(equivalent, hammer) == pytest.approx(sample, rel=1e-10)


@given(factor=st.floats(1, 100))
def test_a_contact_too_short_for_k1_is_named(factor):
    with pytest.raises(NotDeterminedError) as error:
        estimate_sample_stiffness(22e6 * factor, 22e6)
    message = str(error.value)
    assert "(6b) has no positive solution" in message
    assert f"{22 * factor:.4g} MN/m and must be below k1 = 22 MN/m" in message
    assert "check masses, contact time and control sample" in message


@pytest.mark.parametrize("value", [0.0, -0.1, np.nan, np.inf])
def test_impossible_numbers_are_refused(value):
    for call, name in (
        (lambda: estimate_equivalent_mass(value, 1.0), "hammer mass"),
        (lambda: estimate_equivalent_mass(1.0, value), "sample mass"),
        (lambda: estimate_equivalent_stiffness(1.0, value), "contact time"),
        (lambda: estimate_hammer_stiffness(value), "equivalent stiffness"),
        (lambda: estimate_sample_stiffness(1.0, value), "hammer stiffness"),
    ):
        with pytest.raises(ParameterError, match=f"{name} is {value!r}"):
            call()
