"""Equations (5) and (6) against Table 3 and the oscillator they describe."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.equations import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.errors import NotDeterminedError

from .contacts import strike_body

masses = st.floats(1e-3, 10)
stiffnesses = st.floats(1e3, 1e9)


def test_contact_time_is_when_two_bodies_on_a_spring_part():
    m1, m2, k = 0.1, 0.17, 15e6
    equivalent = estimate_equivalent_mass(m1, m2)
    tau = strike_body(1.0, 0.0).time[-1] * np.sqrt(equivalent / k)
    assert estimate_equivalent_stiffness(equivalent, tau) == pytest.approx(k, rel=1e-7)


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
