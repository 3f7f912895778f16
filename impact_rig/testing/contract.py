"""The contract of drivers as tests, for pytest: who writes a driver runs them on it.

A test module of the driver subclasses a contract, with a fixture `bench` that says how the device
is made, struck and unplugged::

    from impact_rig.testing.contract import AccelerationSourceContract, SourceBench

    class MyBench(SourceBench):
        ...

    class TestMyDigitizer(AccelerationSourceContract):
        @pytest.fixture
        def bench(self):
            with MyBench() as bench:
                yield bench

What a bench cannot do is skipped, and the skip says so.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.core.signals.detection import to_acceleration
from impact_rig.core.signals.record import Block, FloatArray
from impact_rig.devices.drivers import COMMON_KEYS, HOLDERS, SOURCES
from impact_rig.devices.protocols import (
    AccelerationSource,
    AcquisitionPlan,
    HammerHolder,
    HolderState,
)


class Bench:
    """A device on a bench: it can be there or not.

    Subclasses override what they can do; the rest is skipped.
    """

    def __enter__(self) -> Self:
        """Make the device ready."""
        return self

    def __exit__(self, *_: object) -> None:
        """Put everything away."""

    def get_driver(self) -> Any:
        """Return the driver's class."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Let the device vanish as if its cable was pulled."""
        pytest.skip("this bench cannot unplug its device")

    def plug(self) -> None:
        """Let it come back."""


class SourceBench(Bench):
    """A source, and somebody who strikes the hammer."""

    def make_source(self) -> AccelerationSource:
        """Return a new source for the device, not configured."""
        raise NotImplementedError

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        """Return a plan that the device can do, its record longer than one block."""
        raise NotImplementedError

    def strike(self, source: AccelerationSource) -> None:
        """Let the hammer strike now, well above the trigger level; do not wait for the record."""
        pytest.skip("nobody strikes the hammer of this bench")


class HolderBench(Bench):
    """A holder, and what its device really does."""

    def make_holder(self) -> HammerHolder:
        """Return a new holder for the device, not configured."""
        raise NotImplementedError

    def is_holding(self) -> bool:
        """Return whether the device holds, asked at the device and not at the driver."""
        pytest.skip("this bench does not see what its device does")

    def count_releases(self) -> int:
        """Return how often the device has let go so far."""
        pytest.skip("this bench does not see what its device does")


PATIENCE = 20.0
"""How long a device may take for what it should do at once, before a test fails [s]."""
LATE = 3.0
"""How much later than its time-out a call may return on a busy computer [s]."""
CYCLES = 3
"""How often a device is unplugged and comes back."""


class DriverContract:
    """Tests of one driver.

    Attributes
    ----------
    group : str
        Its entry point group.
    table : str
        Of the rig file.
    """

    group: ClassVar[str]
    table: ClassVar[str]

    def test_it_says_what_it_is_for_and_gives_an_example_that_it_takes(self, bench: Bench) -> None:
        driver = bench.get_driver()
        assert driver.description
        table = parse_toml_table(driver.example).take_table(self.table)
        assert table["driver"]
        driver(table.without(*COMMON_KEYS[self.group]))

    def test_a_key_that_it_does_not_know_is_refused_by_name(self, bench: Bench) -> None:
        with pytest.raises(ParameterError, match="colour"):
            bench.get_driver()(TomlTable({"colour": "red"}, f"[{self.table}]"))

    def test_a_search_finds_devices_or_says_what_is_missing(self, bench: Bench) -> None:
        try:
            devices = bench.get_driver().find_devices()
        except (DeviceError, ModuleNotFoundError) as error:
            check_sentence(error)
        else:
            assert all(device.address for device in devices)


def check_sentence(error: BaseException) -> None:
    """Require one sentence for people."""
    text = str(error)
    assert text
    assert "\n" not in text
    assert "Traceback" not in text


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
        with closing(bench.make_source()) as source:
            acquisition = source.configure(plan)
            assert acquisition.identity
            assert acquisition.sampling_rate == pytest.approx(plan.sampling_rate, rel=0.01)

    def test_nothing_comes_while_nobody_strikes(self, bench: SourceBench) -> None:
        with configure(bench) as (source, _):
            source.arm()
            begin = time.monotonic()
            assert source.read(QUIET) is None
            assert time.monotonic() - begin < QUIET + LATE

    def test_a_hit_gives_one_whole_record_with_the_pulse_in_its_place(
        self, bench: SourceBench
    ) -> None:
        with configure(bench) as (source, plan):
            source.arm()
            bench.strike(source)
            blocks = read_record(source)
            check_record(blocks, plan)
            check_pulse(blocks, plan)
            assert source.read(QUIET) is None

    def test_each_arming_gives_a_record_of_its_own(self, bench: SourceBench) -> None:
        with configure(bench) as (source, plan):
            for _ in range(3):
                source.arm()
                bench.strike(source)
                check_record(read_record(source), plan)

    def test_what_was_not_read_is_forgotten_when_it_is_disarmed(self, bench: SourceBench) -> None:
        with configure(bench) as (source, plan):
            source.arm()
            bench.strike(source)
            source.disarm()
            source.arm()
            assert source.read(QUIET) is None
            bench.strike(source)
            check_record(read_record(source), plan)

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
        with configure(bench) as (source, plan):
            source.arm()
            source.close()
            source.configure(plan)
            source.arm()
            bench.strike(source)
            check_record(read_record(source), plan)

    def test_a_stream_has_no_gap_and_no_end_or_is_refused_in_a_sentence(
        self, bench: SourceBench
    ) -> None:
        plan = bench.make_plan(continuous=True)
        with closing(bench.make_source()) as source:
            try:
                source.configure(plan)
            except RigError as error:
                check_sentence(error)
                return
            source.arm()
            blocks: list[Block] = []
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

    def test_it_may_be_asked_whether_it_is_there_between_the_armings(
        self, bench: SourceBench
    ) -> None:
        with configure(bench) as (source, plan):
            for _ in range(2):
                source.check()
                source.check()
                source.arm()
                bench.strike(source)
                check_record(read_record(source), plan)
            source.arm()
            source.disarm()
            source.check()

    def test_a_device_that_goes_while_nothing_is_armed_is_missed_at_once(
        self, bench: SourceBench
    ) -> None:
        with configure(bench) as (source, plan):
            bench.unplug()
            with pytest.raises(DeviceError) as found:
                wait_for_loss(source.check, lambda: time.sleep(QUIET))
            check_sentence(found.value)
            source.close()
            bench.plug()
            source.configure(plan)
            source.check()

    def test_a_device_that_is_not_there_is_named_in_a_sentence(self, bench: SourceBench) -> None:
        bench.unplug()
        with closing(bench.make_source()) as source:
            with pytest.raises(DeviceError) as found:
                source.configure(bench.make_plan())
            check_sentence(found.value)

    def test_it_comes_back_as_often_as_it_is_unplugged(self, bench: SourceBench) -> None:
        with configure(bench) as (source, plan):
            for _ in range(CYCLES):
                source.arm()
                bench.unplug()
                with pytest.raises(DeviceError) as found:
                    wait_for_loss(lambda: read_nothing(source))
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


@contextmanager
def configure(bench: SourceBench) -> Iterator[tuple[AccelerationSource, AcquisitionPlan]]:
    """Lend a configured source and its plan."""
    plan = bench.make_plan()
    with closing(bench.make_source()) as source:
        source.configure(plan)
        yield source, plan


def read_block(source: AccelerationSource) -> Block:
    """Return the next block, which must come."""
    block = None
    deadline = time.monotonic() + PATIENCE
    while block is None:
        assert time.monotonic() < deadline, "no block came"
        block = source.read(QUIET)
    return block


def read_record(source: AccelerationSource) -> list[Block]:
    """Return all blocks of a record, which must come."""
    blocks = [read_block(source)]
    while not blocks[-1].last:
        blocks.append(read_block(source))
    return blocks


def wait_for_loss(*actions: Callable[[], object]) -> None:
    """Do something again and again until the loss of the device is noticed, which raises."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        for action in actions:
            action()


def read_nothing(source: AccelerationSource) -> None:
    """Require that no block comes."""
    assert source.read(QUIET) is None, "a device that is gone delivers"


def check_record(blocks: list[Block], plan: AcquisitionPlan) -> None:
    """Require one whole record."""
    check_blocks(blocks, plan)
    assert blocks[0].first_sample == 0
    assert sum(block.hammer.output.size for block in blocks) == plan.points
    assert [block.last for block in blocks] == [False] * (len(blocks) - 1) + [True]


def check_blocks(blocks: list[Block], plan: AcquisitionPlan) -> None:
    """Require blocks without a gap, calibrated, in time."""
    now = time.time()
    expected = blocks[0].first_sample
    for block in blocks:
        size = block.hammer.output.size
        assert block.first_sample == expected, "points are missing"
        assert size > 0
        assert block.specimen.output.size == (size if plan.specimen is not None else 0)
        assert block.hammer.full_scale >= 0.0
        assert block.hammer.scale != 0.0
        assert abs(block.stamp * 1e-9 - now) < CLOCK_TOLERANCE, "the stamp is not of now"
        delay = (block.first_sample - blocks[0].first_sample) / plan.sampling_rate
        assert (block.stamp - blocks[0].stamp) * 1e-9 == pytest.approx(delay, abs=STAMP_TOLERANCE)
        expected += size


def check_pulse(blocks: list[Block], plan: AcquisitionPlan) -> None:
    """Require the hammer's pulse where the trigger is, and a quiet time before it."""
    deviation = np.abs(center(join_hammer(blocks)))
    assert float(np.max(deviation)) > plan.trigger_level, "the pulse is not in the record"
    begin = int(np.argmax(deviation > plan.trigger_level))
    assert abs(begin - plan.pre_trigger_points) <= TRIGGER_TOLERANCE * plan.points + 2


def join_hammer(blocks: list[Block]) -> FloatArray:
    """Return the hammer's acceleration over some blocks [m/s^2]."""
    return np.concatenate([to_acceleration(block.hammer, block.hammer.output) for block in blocks])


def center(values: FloatArray) -> FloatArray:
    """Return a trace without its offset, which no contract says anything of."""
    centered: FloatArray = values - np.median(values)
    return centered


LONGEST_CALL = 0.5
"""What a call may take [s], by the protocol."""


class HammerHolderContract(DriverContract):
    """Tests of one driver."""

    group = HOLDERS
    table = "holder"

    @pytest.fixture
    def bench(self) -> HolderBench:
        """Return what stands behind the driver: to be overridden."""
        raise NotImplementedError

    def test_it_says_whether_an_operator_lets_go_and_how_long_he_may_take(
        self, bench: HolderBench
    ) -> None:
        driver = bench.get_driver()
        assert driver.is_by_hand in {True, False}
        holder: Any = bench.make_holder()
        assert not driver.is_by_hand or holder.patience > 0.0

    def test_it_holds_as_soon_as_it_is_configured(self, bench: HolderBench) -> None:
        with closing(bench.make_holder()) as holder:
            assert holder.configure()
            assert holder.read_state() is HolderState.HOLDING
            wait_until(bench.is_holding)
            assert bench.count_releases() == 0

    def test_it_lets_go_and_holds_again_each_time(self, bench: HolderBench) -> None:
        with closing(bench.make_holder()) as holder:
            holder.configure()
            for count in range(1, 4):
                holder.release()
                assert holder.read_state() is HolderState.RELEASED
                wait_for_releases(bench, count)
                assert not bench.is_holding()
                holder.hold()
                assert holder.read_state() is HolderState.HOLDING
                wait_until(bench.is_holding)

    def test_it_never_lets_go_by_itself(self, bench: HolderBench) -> None:
        holder = bench.make_holder()
        holder.close()
        for _ in range(3):
            holder.configure()
            holder.hold()
            holder.hold()
            holder.close()
            holder.close()
        holder.configure()
        try:
            wait_until(bench.is_holding)
            assert bench.count_releases() == 0
        finally:
            holder.close()

    def test_no_call_takes_long(self, bench: HolderBench) -> None:
        holder = bench.make_holder()
        holder.configure()
        try:
            for call in (holder.hold, holder.release, holder.read_state, holder.hold):
                begin = time.monotonic()
                call()
                assert time.monotonic() - begin < LONGEST_CALL + LATE
        finally:
            holder.close()

    def test_a_device_that_is_not_there_is_named_in_a_sentence(self, bench: HolderBench) -> None:
        bench.unplug()
        with closing(bench.make_holder()) as holder:
            with pytest.raises(DeviceError) as found:
                holder.configure()
            check_sentence(found.value)

    def test_it_comes_back_as_often_as_it_is_unplugged_and_holds(self, bench: HolderBench) -> None:
        with closing(bench.make_holder()) as holder:
            holder.configure()
            for _ in range(CYCLES):
                bench.unplug()
                with pytest.raises(DeviceError) as found:
                    wait_for_loss(holder.read_state, holder.hold)
                check_sentence(found.value)
                holder.close()
                with pytest.raises(DeviceError):
                    holder.configure()
                holder.close()
                bench.plug()
                holder.configure()
            wait_until(bench.is_holding)
            assert bench.count_releases() == 0


def wait_for_releases(bench: HolderBench, count: int) -> None:
    """Wait until the device has let go so often."""
    wait_until(lambda: bench.count_releases() == count)


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for what a device does, which sends no event."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.005)
