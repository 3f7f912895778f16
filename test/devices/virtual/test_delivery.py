"""The virtual rig's running stream: noise without end, and hits where they were laid."""

import time

import numpy as np
import pytest

from impact_rig.core.records import HitLabel
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.delivery import (
    MOST_NOISE_POINTS,
    StreamingDigitizer,
    VirtualStream,
)
from impact_rig.devices.virtual.rig import (
    DigitizerSettings,
    FaultPlan,
    ScheduledFault,
    VirtualHit,
    VirtualRig,
    VirtualRigSettings,
)

DIGITIZER = DigitizerSettings()


def strike(*faults: Fault) -> VirtualHit:
    plan = FaultPlan(scheduled=tuple(ScheduledFault(fault, 1) for fault in faults))
    return VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=plan)).strike(HitLabel("steel small"))


def read(stream: VirtualStream, count: int) -> np.ndarray:
    """Return both channels of the first blocks, shape (2, points)."""
    blocks = [stream.read(number) for number in range(count)]
    return np.hstack([[channel.output for channel in block] for block in blocks])


@pytest.mark.parametrize("block_size", [700, 25_000])
@pytest.mark.parametrize("point", [0, 1234])
def test_a_hit_lies_where_it_was_laid_and_changes_nothing_else(block_size, point):
    hit = strike()
    count = -(-10_000 // block_size)
    quiet = read(VirtualStream(DIGITIZER, block_size, seed=1), count)
    stream = VirtualStream(DIGITIZER, block_size, seed=1)
    stream.lay(hit, point)
    found = read(stream, count)
    inside = slice(point, point + 5000)
    np.testing.assert_array_equal(found[:, inside], [hit.hammer.output, hit.specimen.output])
    found[:, inside] = quiet[:, inside]
    np.testing.assert_array_equal(found, quiet)


def test_noise_is_that_of_the_digitizer_and_of_its_seed():
    hammer, specimen = VirtualStream(DIGITIZER, 25_000, seed=3).noise[0]
    for channel in (hammer, specimen):
        acceleration = channel.scale * channel.output
        # A standard deviation of 1e-3 and an offset of 2e-3 of full scale; the converter's steps
        # of 1/2048 add a twelfth of their square.
        spread = np.hypot(1e-3, 1 / 2048 / np.sqrt(12)) * channel.full_scale
        assert np.std(acceleration) == pytest.approx(spread, rel=0.05)
        assert np.mean(acceleration) == pytest.approx(2e-3 * channel.full_scale, rel=0.05)
    again = VirtualStream(DIGITIZER, 25_000, seed=3).noise[0][0]
    other = VirtualStream(DIGITIZER, 25_000, seed=4).noise[0][0]
    np.testing.assert_array_equal(hammer.output, again.output)
    assert not np.array_equal(hammer.output, other.output)


def test_long_blocks_take_no_more_memory():
    stream = VirtualStream(DIGITIZER, 500_000, seed=1)
    assert len(stream.noise) * 500_000 <= MOST_NOISE_POINTS


def test_a_lost_block_is_the_one_in_the_middle_of_its_hit():
    stream = VirtualStream(DIGITIZER, 1000, seed=1)
    stream.lay(strike(Fault.LOST_BLOCK), 1000)
    assert [
        number for number in range(10) if stream.has_hit(number) and stream.is_lost(number)
    ] == [3]


def test_a_hit_is_forgotten_when_the_stream_has_passed_it_and_one_without_a_trigger_never_comes():
    stream = VirtualStream(DIGITIZER, 1000, seed=1)
    stream.lay(strike(), 500)
    stream.lay(strike(Fault.MISSED_TRIGGER), 8500)
    assert [number for number in range(10) if stream.has_hit(number)] == [0, 1, 2, 3, 4, 5]
    assert not stream.has_hit(0)


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
