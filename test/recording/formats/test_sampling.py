"""The rate behind a printed step is the roundest one."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.recording.formats.sampling import find_round_rate, find_rounding


@pytest.mark.parametrize("rate", [1.0, 3.0, 25600.0, 44100.0, 48000.0, 51200.0, 65536.0, 2.5e6])
@pytest.mark.parametrize("digits", [6, 7, 17])
def test_usual_rates_come_back_from_few_digits_of_their_step(rate, digits):
    step = float(f"{1.0 / rate:.{digits - 1}e}")
    assert find_round_rate(step, find_rounding(step, digits)) == rate


@given(st.floats(1e-9, 1e9))
def test_the_rate_is_the_inverse_of_the_step_to_the_last_bits(step):
    rate = find_round_rate(step)
    assert rate == pytest.approx(1.0 / step, rel=1e-15)


@given(st.integers(1, 10**9))
def test_whole_rates_come_back_from_their_step(rate):
    assert find_round_rate(1.0 / rate) == rate


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf, 5e-324])
def test_what_is_no_step_gives_no_rate(step):
    assert math.isnan(find_round_rate(step))
