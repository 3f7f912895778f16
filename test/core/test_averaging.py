"""Hits aligned on the middle of the hammer's pulse, and averaged."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.hits import FilteredHit, average_hits
from impact_rig.core.pulse_width import measure_pulse

RATE = 2.5e6


def make_hit(middle: float, count: int = 1000, height: float = 100.0, noise: float = 0.0):
    """Return a hit of two bells: the hammer's around `middle`, the sample's 40 points later."""
    points = np.arange(count)
    random = np.random.default_rng(round(1000 * middle))
    traces = np.stack(
        [
            height * np.exp(-(((points - middle) / 50.0) ** 2)),
            -0.4 * height * np.exp(-(((points - middle - 40) / 60.0) ** 2)),
        ]
    )
    traces += noise * random.standard_normal(traces.shape)
    noises = np.array([noise, noise])
    return FilteredHit(
        traces, RATE, measure_pulse(traces[0]), noises, 2.0 * noises, np.zeros(2), 100
    )


@given(middles=st.lists(st.floats(300, 500), min_size=1, max_size=12))
def test_the_mean_of_hits_that_differ_in_time_alone_is_the_hit(middles):
    mean = average_hits([make_hit(middle) for middle in middles])
    assert mean.count == len(middles)
    points = np.arange(mean.traces.shape[1]) - mean.origin
    expected = [
        100.0 * np.exp(-((points / 50.0) ** 2)),
        -40.0 * np.exp(-(((points - 40) / 60.0) ** 2)),
    ]
    # Middles are found within 3e-3 points, on slopes of at most 2 per point.
    np.testing.assert_allclose(mean.traces, expected, rtol=0, atol=0.01)


def test_the_mean_is_as_long_as_what_all_hits_have_in_common():
    mean = average_hits([make_hit(300.0, 1000), make_hit(500.2, 900)])
    assert mean.origin == 300
    # Behind the middle: 900 - 1 - 500 points of the shorter one, whose shift costs one.
    assert mean.traces.shape == (2, 300 + 399)


def test_noise_falls_with_the_square_root_of_the_hits():
    hits = [make_hit(400.0 + step, noise=2.0) for step in range(16)]
    mean = average_hits(hits)
    np.testing.assert_allclose(mean.noise, 2.0 / 4)
    np.testing.assert_allclose(mean.raw_noise, 4.0 / 4)
    # What is stated is what is there: far from the pulse nothing else is left. Interpolation
    # between points takes up to a third of white noise away.
    assert 0.6 * 0.5 < mean.traces[0, :150].std() < 1.1 * 0.5


def test_no_hit_has_no_mean():
    with pytest.raises(NotDeterminedError, match="mean trace: no hit was accepted"):
        average_hits([])


def test_hits_that_do_not_belong_together_are_refused():
    hit = make_hit(400.0)
    slower = replace(hit, sampling_rate=1e6)
    with pytest.raises(SignalError, match=r"hits sampled at \[1000000.0, 2500000.0\] Hz"):
        average_hits([hit, slower])
    alone = replace(hit, traces=hit.traces[:1], noise=hit.noise[:1])
    with pytest.raises(SignalError, match=r"\[1, 2\] channels cannot be averaged"):
        average_hits([hit, alone])
