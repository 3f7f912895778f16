"""The times of messages that hold points: rate, gaps, and times that tell neither."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.message_clock import MessageClock

START = 1_700_000_000_000_000_000


def feed(clock, rate, sizes, *, lost=None, jitter=lambda _: 0.0):
    """Feed messages of some sizes as they come at a rate, some of them late by parts of a step."""
    lost, place, found = lost or {}, 0, []
    for number, size in enumerate(sizes):
        place += lost.get(number, 0)
        found.append(clock.take(START + round((place + jitter(number)) / rate * 1e9), size))
        place += size
    return found


@given(
    st.sampled_from([100.0, 4e3, 2.5e6]),
    st.sampled_from([1, 7, 1000]),
    st.floats(-4e-4, 4e-4),
    st.dictionaries(st.integers(150, 199), st.integers(1, 90), max_size=5),
    st.integers(0, 9),
)
def test_gaps_are_told_to_the_point_and_even_stamps_pass(rate, size, off, lost, seed):
    late = np.random.default_rng(seed).uniform(-0.02, 0.02, 200)
    clock = MessageClock(rate, is_stamped=True)
    found = feed(clock, rate * (1.0 + off), [size] * 200, lost=lost, jitter=late.__getitem__)
    assert {place: count for place, count in enumerate(found) if count} == lost


@pytest.mark.parametrize("size", [1, 100])
def test_another_rate_than_is_stated_is_refused_with_both(size):
    clock = MessageClock(1000.0, is_stamped=True)
    with pytest.raises(DeviceError, match=r"at 998 Hz, by the stamps .* sampling_rate is 1000 Hz"):
        feed(clock, 998.0, [size] * 200)
    assert not clock.is_known


@pytest.mark.parametrize("first", [20, 150])
def test_uneven_stamps_are_refused_at_the_beginning_and_later(first):
    clock = MessageClock(1000.0, is_stamped=True)
    with pytest.raises(DeviceError, match=r"uneven: .*ignore_stamps = true"):
        feed(clock, 1000.0, [1] * 200, jitter=lambda number: 0.3 * (number == first))


def test_without_stamps_the_middleware_tells_gaps_and_arrivals_may_vary():
    clock = MessageClock(1000.0, is_stamped=False)
    found = feed(clock, 1000.0, [10] * 200, jitter=lambda number: number % 7)
    assert clock.is_known
    assert not any(found)
    assert clock.take(START, 10, 3) == 30
    with pytest.raises(DeviceError, match="by the arrivals"):
        feed(MessageClock(1200.0, is_stamped=False), 1000.0, [10] * 600)
