"""What every driver of accelerometers does, as tests; see the package's docstring."""

import time

import numpy as np
import pytest

from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.signals.pulse_search import to_acceleration
from impact_rig.core.signals.record import FloatArray
from impact_rig.devices.acceleration_source import (
    AccelerationSource,
    AcquiredBlock,
    AcquisitionPlan,
)
from impact_rig.devices.contract.benches import SourceBench
from impact_rig.devices.contract.driver_contract import (
    CYCLES,
    LATE,
    PATIENCE,
    DriverContract,
    check_sentence,
)
from impact_rig.devices.drivers import SOURCES

QUIET = 0.2
"""How long nothing may come where nothing should [s]."""
TRIGGER_TOLERANCE = 0.05
"""How far from its place in the record the pulse may begin, part of the record [-]."""
CLOCK_TOLERANCE = 60.0
"""How far a stamp may be from this computer's clock [s]."""

STAMP_TOLERANCE = 0.1
"""How far stamps of one record or stream may lie apart from its points [s]: some devices tell no
times, and their drivers take that of the arrival."""


class AccelerationSourceContract(DriverContract):
    """Tests of one driver."""

    group = SOURCES
    table = "source"

    @pytest.fixture
    def bench(self) -> SourceBench:
        """Return what stands behind the driver: to be overridden."""
        raise NotImplementedError

    def test_it_says_who_it_is_and_how_fast(self, bench: SourceBench) -> None:
        plan = bench.make_plan()
        source = bench.make_source()
        try:
            acquisition = source.configure(plan)
            assert acquisition.identity
            assert acquisition.sampling_rate == pytest.approx(plan.sampling_rate, rel=0.01)
        finally:
            source.close()

    def test_nothing_comes_while_nobody_strikes(self, bench: SourceBench) -> None:
        source, _ = configure(bench)
        try:
            source.arm()
            begin = time.monotonic()
            assert source.read(QUIET) is None
            assert time.monotonic() - begin < QUIET + LATE
        finally:
            source.close()

    def test_a_hit_gives_one_whole_record_with_the_pulse_in_its_place(
        self, bench: SourceBench
    ) -> None:
        source, plan = configure(bench)
        try:
            source.arm()
            bench.strike(source)
            blocks = read_record(source)
            check_record(blocks, plan)
            check_pulse(blocks, plan)
            assert source.read(QUIET) is None
        finally:
            source.close()

    def test_each_arming_gives_a_record_of_its_own(self, bench: SourceBench) -> None:
        source, plan = configure(bench)
        try:
            for _ in range(3):
                source.arm()
                bench.strike(source)
                check_record(read_record(source), plan)
        finally:
            source.close()

    def test_what_was_not_read_is_forgotten_when_it_is_disarmed(self, bench: SourceBench) -> None:
        source, plan = configure(bench)
        try:
            source.arm()
            bench.strike(source)
            source.disarm()
            source.arm()
            assert source.read(QUIET) is None
            bench.strike(source)
            check_record(read_record(source), plan)
        finally:
            source.close()

    def test_it_may_be_disarmed_and_closed_whatever_it_does(self, bench: SourceBench) -> None:
        source = bench.make_source()
        source.close()
        source.configure(bench.make_plan())
        source.disarm()
        source.disarm()
        source.arm()
        source.close()
        source.close()

    def test_it_may_be_configured_again(self, bench: SourceBench) -> None:
        source, plan = configure(bench)
        try:
            source.arm()
            source.close()
            source.configure(plan)
            source.arm()
            bench.strike(source)
            check_record(read_record(source), plan)
        finally:
            source.close()

    def test_a_stream_has_no_gap_and_no_end_or_is_refused_in_a_sentence(
        self, bench: SourceBench
    ) -> None:
        plan = bench.make_plan(continuous=True)
        source = bench.make_source()
        try:
            try:
                source.configure(plan)
            except RigError as error:
                check_sentence(error)
                return
            source.arm()
            blocks: list[AcquiredBlock] = []
            while sum(block.hammer.output.size for block in blocks) < plan.points:
                blocks.append(read_block(source))
            bench.strike(source)
            begin = blocks[-1].first_sample
            peak = 0.0
            deadline = time.monotonic() + PATIENCE
            while peak < plan.trigger_level:
                assert time.monotonic() < deadline, "the hit is not in the stream"
                blocks.append(read_block(source))
                if blocks[-1].first_sample > begin:
                    peak = float(np.max(np.abs(center(join_hammer(blocks[-1:])))))
            check_blocks(blocks, plan)
            assert not any(block.last for block in blocks)
            source.disarm()
            assert source.read(QUIET) is None
        finally:
            source.close()

    def test_it_may_be_asked_whether_it_is_there_between_the_armings(
        self, bench: SourceBench
    ) -> None:
        source, plan = configure(bench)
        try:
            for _ in range(2):
                source.check()
                source.check()
                source.arm()
                bench.strike(source)
                check_record(read_record(source), plan)
            source.arm()
            source.disarm()
            source.check()
        finally:
            source.close()

    def test_a_device_that_goes_while_nothing_is_armed_is_missed_at_once(
        self, bench: SourceBench
    ) -> None:
        source, plan = configure(bench)
        try:
            bench.unplug()
            with pytest.raises(DeviceError) as found:
                wait_for_absence(source)
            check_sentence(found.value)
            source.close()
            bench.plug()
            source.configure(plan)
            source.check()
        finally:
            source.close()

    def test_a_device_that_is_not_there_is_named_in_a_sentence(self, bench: SourceBench) -> None:
        bench.unplug()
        source = bench.make_source()
        try:
            with pytest.raises(DeviceError) as found:
                source.configure(bench.make_plan())
            check_sentence(found.value)
        finally:
            source.close()

    def test_it_comes_back_as_often_as_it_is_unplugged(self, bench: SourceBench) -> None:
        source, plan = configure(bench)
        try:
            for _ in range(CYCLES):
                source.arm()
                bench.unplug()
                with pytest.raises(DeviceError) as found:
                    wait_for_loss(source)
                check_sentence(found.value)
                source.close()
                with pytest.raises(DeviceError):
                    source.configure(plan)
                source.close()
                bench.plug()
                source.configure(plan)
            source.arm()
            bench.strike(source)
            check_record(read_record(source), plan)
        finally:
            source.close()


def configure(bench: SourceBench) -> tuple[AccelerationSource, AcquisitionPlan]:
    """Return a configured source and its plan."""
    source, plan = bench.make_source(), bench.make_plan()
    source.configure(plan)
    return source, plan


def read_block(source: AccelerationSource) -> AcquiredBlock:
    """Return the next block, which must come."""
    block = None
    deadline = time.monotonic() + PATIENCE
    while block is None:
        assert time.monotonic() < deadline, "no block came"
        block = source.read(QUIET)
    return block


def read_record(source: AccelerationSource) -> list[AcquiredBlock]:
    """Return all blocks of a record, which must come."""
    blocks = [read_block(source)]
    while not blocks[-1].last:
        blocks.append(read_block(source))
    return blocks


def wait_for_loss(source: AccelerationSource) -> None:
    """Read until the loss of the device is noticed, which raises."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        assert source.read(QUIET) is None, "a device that is gone delivers"


def wait_for_absence(source: AccelerationSource) -> None:
    """Ask until the loss of the device is noticed, which raises."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        source.check()
        time.sleep(QUIET)


def check_record(blocks: list[AcquiredBlock], plan: AcquisitionPlan) -> None:
    """Require one whole record."""
    check_blocks(blocks, plan)
    assert blocks[0].first_sample == 0
    assert sum(block.hammer.output.size for block in blocks) == plan.points
    assert [block.last for block in blocks] == [False] * (len(blocks) - 1) + [True]


def check_blocks(blocks: list[AcquiredBlock], plan: AcquisitionPlan) -> None:
    """Require blocks without a gap, calibrated, in time, none too long."""
    now = time.time()
    expected = blocks[0].first_sample
    for block in blocks:
        size = block.hammer.output.size
        assert block.first_sample == expected, "points are missing"
        assert 0 < size <= plan.block_size
        assert block.specimen.output.size == (size if plan.specimen is not None else 0)
        assert block.hammer.full_scale >= 0.0
        assert block.hammer.scale != 0.0
        assert abs(block.stamp * 1e-9 - now) < CLOCK_TOLERANCE, "the stamp is not of now"
        delay = (block.first_sample - blocks[0].first_sample) / plan.sampling_rate
        assert (block.stamp - blocks[0].stamp) * 1e-9 == pytest.approx(delay, abs=STAMP_TOLERANCE)
        expected += size


def check_pulse(blocks: list[AcquiredBlock], plan: AcquisitionPlan) -> None:
    """Require the hammer's pulse where the trigger is, and a quiet time before it."""
    deviation = np.abs(center(join_hammer(blocks)))
    assert float(np.max(deviation)) > plan.trigger_level, "the pulse is not in the record"
    begin = int(np.argmax(deviation > plan.trigger_level))
    assert abs(begin - plan.pre_trigger_points) <= TRIGGER_TOLERANCE * plan.points + 2


def join_hammer(blocks: list[AcquiredBlock]) -> FloatArray:
    """Return the hammer's acceleration over some blocks [m/s^2]."""
    return np.concatenate([to_acceleration(block.hammer, block.hammer.output) for block in blocks])


def center(values: FloatArray) -> FloatArray:
    """Return a trace without its offset, which no contract says anything of."""
    centered: FloatArray = values - np.median(values)
    return centered
