"""Which part of traces there is something to see in."""

import numpy as np
import pytest

from impact_rig.present.figures.trace_span import compute_fading_time, cut_trace


def test_only_what_lies_in_the_picture_is_drawn():
    time, values = cut_trace(np.arange(6.0), np.arange(6.0) ** 2, 1.0, 3.0)
    assert time.tolist() == [1.0, 2.0, 3.0]
    assert values.tolist() == [1.0, 4.0, 9.0]


def test_a_decay_has_faded_when_its_exponential_says_so():
    time = np.linspace(0.0, 10.0, 10_001)
    slow, fast = np.exp(-time), -5.0 * np.exp(-3.0 * time)
    assert compute_fading_time(time, np.stack([slow, fast]), 0.01) == pytest.approx(
        np.log(100.0), abs=1e-3
    )


def test_nothing_and_nan_have_faded_at_once():
    time = np.array([-1.0, 0.0, 1.0])
    assert compute_fading_time(time, np.zeros((2, 3)), 0.01) == -1.0
    assert compute_fading_time(time, np.full((1, 3), np.nan), 0.01) == -1.0
