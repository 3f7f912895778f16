"""The virtual rig's running stream: noise without end, and hits where they were laid."""

import time

import numpy as np
import pytest

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.delivery import StreamingDigitizer
from impact_rig.devices.virtual.rig import (
    FaultPlan,
    ScheduledFault,
    VirtualHit,
    VirtualRig,
    VirtualRigSettings,
)


def strike(*faults: Fault) -> VirtualHit:
    plan = FaultPlan(scheduled=tuple(ScheduledFault(fault, 1) for fault in faults))
    return VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=plan)).strike(HitLabel("steel small"))


def stream(block_size: int, count: int, *hits: tuple[int, VirtualHit], seed: int = 1) -> list:
    """Return the first blocks of a stream with hits laid at points of it."""
    digitizer = StreamingDigitizer(VirtualRigSettings(seed=seed), block_size, depth=count)
    digitizer._hits = list(hits)
    return [digitizer.make_block(number) for number in range(count)]


def join(blocks) -> np.ndarray:
    """Return both channels, shape (2, points)."""
    return np.hstack([[block.hammer.output, block.specimen.output] for block in blocks])


@pytest.mark.parametrize("block_size", [700, 25_000])
@pytest.mark.parametrize("point", [0, 1234])
def test_a_hit_lies_where_it_was_laid_and_changes_nothing_else(block_size, point):
    hit, count = strike(), -(-10_000 // block_size)
    quiet, found = join(stream(block_size, count)), join(stream(block_size, count, (point, hit)))
    inside = slice(point, point + 5000)
    np.testing.assert_array_equal(found[:, inside], [hit.hammer.output, hit.specimen.output])
    found[:, inside] = quiet[:, inside]
    np.testing.assert_array_equal(found, quiet)


def test_noise_has_the_digitizers_offset_and_is_that_of_its_seed():
    (block,) = stream(25_000, 1, seed=3)
    for channel in (block.hammer, block.specimen):
        assert np.mean(channel.acceleration) == pytest.approx(2e-3 * channel.full_scale, rel=0.05)
    again, other = (stream(25_000, 1, seed=seed)[0].hammer.output for seed in (3, 4))
    np.testing.assert_array_equal(block.hammer.output, again)
    assert not np.array_equal(block.hammer.output, other)


def test_a_lost_block_is_the_one_in_the_middle_of_its_hit():
    blocks = stream(1000, 10, (1000, strike(Fault.LOST_BLOCK)))
    assert [number for number, block in enumerate(blocks) if block is None] == [3]


def test_a_full_buffer_loses_the_oldest_blocks():
    digitizer = StreamingDigitizer(VirtualRigSettings(), block_size=25_000, depth=3)
    digitizer.arm()
    time.sleep(0.1)  # ten blocks
    blocks = [block for _ in range(5) if (block := digitizer.read(20.0)) is not None]
    numbers = [block.first_sample // 25_000 for block in blocks]
    assert numbers[0] >= 7
    assert numbers == sorted(set(numbers))
    stamps = [block.stamp - blocks[0].stamp for block in blocks]
    assert stamps == [10_000_000 * (number - numbers[0]) for number in numbers]
    digitizer.disarm()
    assert digitizer.read(0.0) is None
