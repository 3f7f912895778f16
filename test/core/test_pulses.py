"""Contact pulses against their differential equation, quadrature and root finding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from impact_rig.core.errors import ParameterError
from impact_rig.core.pulses import (
    HALF_SINE,
    HERTZ,
    PULSE_SHAPES,
    VERSED_SINE,
    compute_pulse,
)

every_shape = pytest.mark.parametrize("shape", PULSE_SHAPES, ids=lambda shape: shape.name)


@pytest.mark.parametrize(
    ("shape", "factor", "ratio"),
    # Published to three figures; Hertz has no short closed form.
    [(VERSED_SINE, 2.0, 1.59), (HALF_SINE, 1.5, 1.40), (HERTZ, 1.82, 1.55)],
)
def test_factor_and_ratio_of_widths_are_the_known_ones(shape, factor, ratio):
    assert shape.pulse_factor == pytest.approx(factor, rel=5e-4)
    assert shape.width_ratio == pytest.approx(ratio, abs=0.005)


@every_shape
def test_widths_are_those_of_the_pulse_itself(shape):
    for level, width in ((0.5, shape.half_amplitude_width), (0.1, shape.tenth_amplitude_width)):
        rise = brentq(
            lambda p, at=level: float(shape.differentiate(np.array(p))[0]) - at, 1e-12, 0.5
        )
        assert width == pytest.approx(1.0 - 2.0 * rise, abs=1e-10)


def test_hertz_pulse_solves_its_differential_equation():
    # m d'' = -k d^(3/2), scaled so that the largest compression is 1 for unit speed.
    def follow(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -1.25 * max(state[0], 0.0) ** 1.5]

    duration = 2.0 * quad(lambda d: 1.0 / np.sqrt(1.0 - d**2.5), 0.0, 1.0)[0]
    assert duration == pytest.approx(2.943, abs=1e-3)  # Goldsmith, Impact, eq. 4.26
    phase = np.linspace(0.0, 1.0, 101)
    times = phase * duration
    path = solve_ivp(
        follow, (0.0, duration), [0.0, 1.0], "DOP853", t_eval=times, rtol=1e-11, atol=1e-14
    )
    force = np.maximum(path.y[0], 0.0) ** 1.5
    # The quadrature's singular end leaves some 1e-8 of the duration.
    np.testing.assert_allclose(HERTZ.differentiate(phase)[0], force, rtol=0, atol=1e-6)


@every_shape
@given(duration=st.floats(1e-6, 1.0), asymmetry=st.floats(-0.5, 0.5))
def test_an_asymmetric_pulse_keeps_height_impulse_and_width(shape, duration, asymmetry):
    time = np.linspace(-0.5, 1.5, 8001) * duration
    pulse = compute_pulse(time, duration, shape, asymmetry)
    step = time[1] - time[0]
    assert np.all(pulse[(time < 0) | (time > duration)] == 0.0)
    # On 4000 points per pulse: half a point in position and width, and in area.
    assert pulse.max() == pytest.approx(1.0, abs=1e-6)
    peak_time = time[np.argmax(pulse)]
    assert peak_time == pytest.approx(duration * (1 + asymmetry) / 2, abs=30 * step)
    width = np.count_nonzero(pulse >= 0.5) * step
    assert width == pytest.approx(duration / shape.pulse_factor, abs=2 * step)
    symmetric = compute_pulse(time, duration, shape)
    assert pulse.sum() == pytest.approx(symmetric.sum(), rel=1e-3)


def test_an_impossible_pulse_is_refused():
    with pytest.raises(ParameterError, match=r"pulse duration is -1.0 s"):
        compute_pulse(np.zeros(3), -1.0)
    with pytest.raises(ParameterError, match=r"asymmetry is 1.0: it must lie between -0.9 and"):
        compute_pulse(np.zeros(3), 1.0, asymmetry=1.0)
