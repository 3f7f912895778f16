"""The digitizer's clock: each block once, in order, or lost and counted."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.errors import ParameterError
from impact_rig.devices.virtual.block_clock import BlockClock


@given(steps=st.lists(st.floats(0.0, 0.5), min_size=1, max_size=50), depth=st.integers(1, 100))
def test_every_block_is_fetched_once_or_counted_as_lost(steps: list[float], depth: int) -> None:
    clock = BlockClock(0.01, depth, now=5.0)
    now, fetched = 5.0, []
    for step in steps:
        now += step
        numbers = clock.fetch(now)
        assert len(numbers) <= depth
        fetched += numbers
    assert fetched == sorted(set(fetched))
    assert len(fetched) + clock.dropped == clock.next_block
    # What is complete, and nothing that is not; a rounding of the time apart.
    assert abs((now - 5.0) / 0.01 - clock.next_block) < 1.001


def test_a_full_buffer_loses_the_oldest() -> None:
    clock = BlockClock(0.1, depth=3, now=0.0)
    assert list(clock.fetch(1.05)) == [7, 8, 9]
    assert clock.dropped == 7
    # Block 7 was complete at 0.8 s.
    assert clock.delay == pytest.approx(0.25)


@pytest.mark.parametrize(("period", "depth"), [(0.0, 1), (float("nan"), 1), (0.01, 0)])
def test_refuses_what_is_no_clock(period: float, depth: int) -> None:
    with pytest.raises(ParameterError):
        BlockClock(period, depth, 0.0)
