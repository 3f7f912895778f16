"""The times of messages that hold points: rate, gaps, and times that tell neither."""

import re
from functools import partial

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


@given(st.sampled_from([1, 7, 100]), st.floats(-8e-4, 8e-4), st.integers(0, 9))
def test_a_rate_within_a_thousandth_is_followed_for_ever(size, off, seed):
    late = np.random.default_rng(seed).uniform(-0.02, 0.02, 3000)
    clock = MessageClock(1000.0, is_stamped=True)
    assert not any(feed(clock, 1000.0 * (1.0 + off), [size] * 3000, jitter=late.__getitem__))


@pytest.mark.parametrize(
    ("off", "size"), [(off, 1) for off in (-0.09, -5e-3, -2e-3, 2e-3, 5e-3, 0.09)] + [(5e-3, 10)]
)
def test_a_rate_that_changes_is_refused_with_both_once_points_are_a_tenth_of_a_step_off(off, size):
    clock = MessageClock(1000.0, is_stamped=True)
    feed(clock, 1000.0, [size] * 300)
    begin, step = START + 300 * size * 1_000_000, 1e6 / (1.0 + off)
    stamps = iter([begin + round(number * size * step) for number in range(1000)])
    with pytest.raises(DeviceError, match="sampling_rate is 1000 Hz") as error:
        all(clock.take(stamp, size) == 0 for stamp in stamps)
    taken = 998 - len(list(stamps))
    assert taken * size * (abs(1.0 / (1.0 + off) - 1.0) - 1e-3) <= 0.1
    found = float(re.search(r"come at (\S+) Hz", str(error.value)).group(1))
    assert found == pytest.approx(1000.0 * (1.0 + off), rel=1e-4)


def test_stamps_that_go_back_are_told_so():
    clock = MessageClock(1000.0, is_stamped=True)
    feed(clock, 1000.0, [1] * 300)
    with pytest.raises(DeviceError, match=r"one is 1 s before it is due"):
        clock.take(START + 300_000_000 - 1_000_000_000, 1)


@pytest.mark.parametrize("before", [1.2, 2.5])
@pytest.mark.parametrize(
    ("rate", "how"),
    [(500.0, r"fell behind by (1|0\.\d+)"), (960.0, ""), (2000.0, r"came early by (0\.\d+|1)")],
)
def test_arrivals_at_another_rate_are_refused_within_two_seconds(rate, how, before):
    clock = MessageClock(1000.0, is_stamped=False)
    feed(clock, 1000.0, [1] * int(1000 * before))
    begin = START + int(before * 1e9)
    take = [partial(clock.take, begin + round(n / rate * 1e9), 1) for n in range(int(3 * rate))]
    if not how:
        assert not any(message() for message in take)
        return
    told = how + r" s, by the arrivals .* sampling_rate is 1000 Hz"
    with pytest.raises(DeviceError, match=told):
        [message() for message in take[: int(2.1 * rate)]]


def test_arrivals_that_a_busy_computer_holds_up_pass():
    random = np.random.default_rng(1)
    clock, held = MessageClock(1000.0, is_stamped=False), 0.0
    for number in range(20_000):
        if random.uniform() < 1e-3:
            held = number / 1000.0 + random.uniform(0.0, 0.7)
        clock.take(START + round(max(held, number / 1000.0) * 1e9), 1)
