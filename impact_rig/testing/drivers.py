"""The contract of drivers as tests, for pytest: authors of drivers run them on their device.

A test module of the driver subclasses a contract, with a fixture `bench` that says how the device
is made, struck and unplugged::

    from impact_rig.testing import AccelerationSourceContract, Applied, SourceBench, make_plan

    class MyBench(SourceBench):
        driver = MyDigitizer
        applied = Applied(hammer=-480.0, specimen=830.0)  # what a strike is [m/s^2]
        bits = 16

        def make_plan(self, *, continuous=False):
            return make_plan(MyDigitizer.example, continuous=continuous)
        ...

    class TestMyDigitizer(AccelerationSourceContract):
        @pytest.fixture
        def bench(self):
            return MyBench()

What a bench cannot do, or does not state, is skipped, and the skip says so. To see values where an
assertion fails, call ``pytest.register_assert_rewrite("impact_rig.testing")`` in your conftest.py.
"""

import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from impact_rig.configuration.rig_file import parse_sensors
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.records import Block, FloatArray
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices import source_table
from impact_rig.devices.drivers import COMMON_KEYS, HOLDERS, SOURCES
from impact_rig.devices.protocols import (
    AccelerationSource,
    AcquisitionPlan,
    HammerHolder,
    HolderState,
)

QUIET = 0.2  # [s], in which nothing may come
LONGEST_CALL = 3.0  # [s]: half a second, by the protocol, and a busy computer
STREAM_TIME, RATE_ERROR = 1.0, 0.1
"""How long points of a stream are counted [s], and how far their rate may be from the clock's [-]:
half of it, or twice, is found on a busy computer, too."""


@dataclass(frozen=True)
class Applied:
    """What a strike of a bench is: a hammer's pulse, or a generator's."""

    hammer: float  # peak with its sign [m/s^2]
    specimen: float | None = None  # the same; None: not known
    width: float | None = None  # of the hammer's pulse at half its peak [s]; None: not known
    tolerance: float = 0.1  # of all three, relative


def make_plan(example: str, *, continuous: bool = False) -> AcquisitionPlan:
    """Return the plan of a table [source], in the form of a driver's `example`.

    Raises
    ------
    RigError
        If the table is none, or something is missing in it.
    """
    source = parse_toml_table(example).take_table("source")
    setup = replace(PAPER_SETUP, sensors=parse_sensors(source))
    return replace(source_table.make_plan(source, setup), continuous=continuous)


class Bench:
    """A device to test a driver with; subclasses override what they can do."""

    driver: Any  # its class
    patience: ClassVar[float] = 20.0  # [s], before a test fails

    def unplug(self) -> None:
        """Let the device vanish as if its cable was pulled."""
        pytest.skip("this bench cannot unplug its device")

    def plug(self) -> None:
        """Let it come back."""

    def wait_until(self, condition: Callable[[], bool]) -> None:
        """Wait for what a device does, which sends no event."""
        deadline = time.monotonic() + self.patience
        while not condition():
            assert time.monotonic() < deadline, "it never came true"
            time.sleep(0.005)

    def wait_for_loss(self, action: Callable[[], object]) -> None:
        """Repeat an action until its `DeviceError` says in a sentence that the device is lost."""
        deadline = time.monotonic() + self.patience
        with pytest.raises(DeviceError) as found:  # noqa: PT012 - until it is lost
            while time.monotonic() < deadline:
                action()
        check_sentence(found.value)


class SourceBench(Bench):
    """A source, and what strikes the hammer."""

    applied: Applied | None = None  # what `strike` is; None: not known
    bits: int | None = None  # of the converter, over both signs; None: not known
    # Whether a strike reaches both channels, each in its own way, as a hammer's does.
    reaches_both: ClassVar[bool] = True

    def make_source(self) -> AccelerationSource:
        """Return a new source for the device, not configured."""
        raise NotImplementedError(f"{type(self).__name__} needs a method make_source")

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        """Return a plan that the device can do, as by the function `make_plan`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method make_plan")

    def strike(self, source: AccelerationSource) -> None:
        """Let the hammer strike now, well above the trigger level; do not wait for the record."""
        pytest.skip("this bench cannot strike")

    def read_block(self, source: AccelerationSource) -> Block:
        """Return the next block, which must come."""
        block = source.read(self.patience)
        assert block is not None, "no block came"
        return block

    def take_record(self, source: AccelerationSource, plan: AcquisitionPlan) -> list[Block]:
        """Arm and strike; require one whole record with the pulse in its place; return it."""
        source.arm()
        self.strike(source)
        blocks = [self.read_block(source)]
        while not blocks[-1].last:
            blocks.append(self.read_block(source))
        check_blocks(blocks, plan)
        hammer = join_size(blocks)
        assert hammer.size == plan.points
        assert hammer.max() > plan.trigger_level, "the pulse is not in the record"
        # The pulse may begin some points beside the trigger.
        begin = int(np.argmax(hammer > plan.trigger_level))
        assert abs(begin - plan.pre_trigger_points) <= 0.05 * plan.points + 2
        assert source.read(QUIET) is None, "something comes after the last block"
        if plan.specimen is not None and self.reaches_both:
            check_pair(hammer, join_size(blocks, "specimen"))
        return blocks


class HolderBench(Bench):
    """A holder, and what its device really does."""

    def make_holder(self) -> HammerHolder:
        """Return a new holder for the device, not configured."""
        raise NotImplementedError(f"{type(self).__name__} needs a method make_holder")

    def is_holding(self) -> bool:
        """Return whether the device holds, asked at the device and not at the driver."""
        pytest.skip("this bench does not see what its device does")

    def count_releases(self) -> int:
        """Return how often the device has released so far."""
        pytest.skip("this bench does not see what its device does")


class DriverContract:
    """Tests of every driver."""

    group: ClassVar[str]  # of entry points
    protocol: ClassVar[type]

    def test_it_has_every_method(self, bench: Bench) -> None:
        wanted = [name for name in dir(self.protocol) if not name.startswith("_")]
        wanted = [name for name in wanted if callable(getattr(self.protocol, name))]
        missing = [name for name in wanted if not callable(getattr(bench.driver, name, None))]
        assert not missing, f"{bench.driver.__name__} lacks {', '.join(missing)}"

    def test_it_takes_its_own_example_and_no_other_key(self, bench: Bench) -> None:
        driver = bench.driver
        assert driver.description
        name = "source" if self.group == SOURCES else "holder"
        table = parse_toml_table(driver.example).take_table(name)
        driver(table.without(*COMMON_KEYS[self.group]))
        with pytest.raises(ParameterError, match="colour"):
            driver(TomlTable({"colour": "red"}, f"[{name}]"))
        with suppress(DeviceError, ModuleNotFoundError):  # of the vendor's software
            assert all(device.address for device in driver.find_devices())


class AccelerationSourceContract(DriverContract):
    """Tests of a source; subclasses have a fixture `bench`."""

    group = SOURCES
    protocol = AccelerationSource

    def test_each_arming_gives_one_whole_record(self, bench: SourceBench) -> None:
        plan = bench.make_plan()
        with closing(bench.make_source()) as source:
            source.close()
            acquisition = source.configure(plan)
            assert acquisition.identity
            assert acquisition.sampling_rate == pytest.approx(plan.sampling_rate, rel=0.01)
            source.arm()
            assert source.read(QUIET) is None, "something comes though nothing was struck"
            source.disarm()
            for _ in range(3):
                source.check()
                bench.take_record(source, plan)

    def test_it_measures_what_is_applied(self, bench: SourceBench) -> None:
        applied = bench.applied
        if applied is None:
            pytest.skip("this bench does not state what it applies: no sign or scale is tested")
        plan = bench.make_plan()
        with closing(bench.make_source()) as source:
            source.configure(plan)
            blocks = bench.take_record(source, plan)
        hammer = join(blocks, "hammer")
        measured = {"hammer": find_peak(hammer)}
        if applied.specimen is not None:
            measured["specimen"] = find_peak(join(blocks, "specimen"))
        for name, peak in measured.items():
            assert peak == pytest.approx(getattr(applied, name), rel=applied.tolerance), name
        if applied.width is not None:
            width = find_width(hammer) / plan.sampling_rate
            assert width == pytest.approx(applied.width, rel=applied.tolerance), "another rate"

    def test_no_bit_is_lost(self, bench: SourceBench) -> None:
        if bench.bits is None:
            pytest.skip("this bench does not state the bits of its converter")
        plan = bench.make_plan()
        with closing(bench.make_source()) as source:
            source.configure(plan)
            blocks = bench.take_record(source, plan)
        for name in ("hammer", "specimen") if plan.specimen is not None else ("hammer",):
            values = join(blocks, name)
            step = float(np.diff(np.unique(values)).min())
            full_scale = getattr(blocks[0], name).full_scale
            wanted = full_scale / 2.0 ** (bench.bits - 1)
            assert step < 1.5 * wanted, f"{name}: steps of {step:g}, not of {wanted:g} m/s^2"

    def test_its_rate_is_that_of_the_clock(self, bench: SourceBench) -> None:
        plan = bench.make_plan(continuous=True)
        with closing(bench.make_source()) as source:
            try:
                source.configure(plan)
            except RigError:
                pytest.skip("the device does not stream: state the width of what is applied")
            source.arm()
            first = bench.read_block(source)
            begin, passed, count = time.monotonic(), 0.0, 0
            wanted = pytest.approx(plan.sampling_rate, rel=RATE_ERROR)
            # A busy computer reads late, and then what has waited at once: longer is surer.
            while passed < STREAM_TIME or (count / passed != wanted and passed < 5 * STREAM_TIME):
                block = bench.read_block(source)
                count += block.hammer.output.size
                passed = time.monotonic() - begin
            stamped = (block.stamp - first.stamp) * 1e-9
            source.disarm()
        for what, duration in (("clock", passed), ("stamps", stamped)):
            assert count / duration == wanted, f"another rate by the {what}"

    def test_what_was_not_read_is_forgotten_when_it_is_disarmed(self, bench: SourceBench) -> None:
        plan = bench.make_plan()
        with closing(bench.make_source()) as source:
            source.configure(plan)
            source.arm()
            bench.strike(source)
            source.disarm()
            source.arm()
            assert source.read(QUIET) is None
            bench.take_record(source, plan)

    def test_a_stream_has_no_gap_and_no_end_or_is_refused(self, bench: SourceBench) -> None:
        plan = bench.make_plan(continuous=True)
        with closing(bench.make_source()) as source:
            try:
                source.configure(plan)
            except RigError as error:
                check_sentence(error)
                return
            source.arm()
            blocks = [bench.read_block(source)]
            bench.strike(source)
            while join_size(blocks[-1:]).max() < plan.trigger_level:
                blocks.append(bench.read_block(source))
            check_blocks(blocks, plan)
            assert not any(block.last for block in blocks)
            source.disarm()
            assert source.read(QUIET) is None

    def test_it_comes_back_as_often_as_it_is_unplugged(self, bench: SourceBench) -> None:
        plan = bench.make_plan()
        with closing(bench.make_source()) as source:
            source.configure(plan)
            for notice in (source.check, lambda: source.read(QUIET)):
                bench.unplug()
                bench.wait_for_loss(notice)
                source.close()
                bench.wait_for_loss(lambda: source.configure(plan))
                source.close()
                bench.plug()
                source.configure(plan)
                source.arm()
            source.close()
            source.configure(plan)
            bench.take_record(source, plan)


class HammerHolderContract(DriverContract):
    """Tests of a holder; subclasses have a fixture `bench`."""

    group = HOLDERS
    protocol = HammerHolder

    def test_it_releases_when_it_is_asked_and_never_by_itself(self, bench: HolderBench) -> None:
        with closing(bench.make_holder()) as holder:
            holder.configure()
            holder.hold()
            holder.close()
            assert holder.configure()
            for count in range(3):
                assert holder.read_state() is HolderState.HOLDING
                bench.wait_until(bench.is_holding)
                assert bench.count_releases() == count
                begin = time.monotonic()
                holder.release()
                assert time.monotonic() - begin < LONGEST_CALL
                assert holder.read_state() is HolderState.RELEASED
                bench.wait_until(lambda: not bench.is_holding())
                holder.hold()

    def test_it_comes_back_as_often_as_it_is_unplugged_and_holds(self, bench: HolderBench) -> None:
        with closing(bench.make_holder()) as holder:
            holder.configure()
            for _ in range(3):
                bench.unplug()
                bench.wait_for_loss(holder.read_state)
                holder.close()
                bench.wait_for_loss(holder.configure)
                holder.close()
                bench.plug()
                holder.configure()
            bench.wait_until(bench.is_holding)
            assert bench.count_releases() == 0


def check_sentence(error: BaseException) -> None:
    """Require one sentence for people."""
    text = str(error)
    assert text
    assert "\n" not in text


def check_blocks(blocks: list[Block], plan: AcquisitionPlan) -> None:
    """Require blocks without a gap, calibrated, in time."""
    expected, begin = blocks[0].first_sample, blocks[0].stamp
    assert begin * 1e-9 == pytest.approx(time.time(), abs=60.0)
    for block in blocks:
        size = block.hammer.output.size
        assert size > 0
        assert block.first_sample == expected, "points are missing"
        assert block.specimen.output.size == (size if plan.specimen is not None else 0)
        delay = (block.first_sample - blocks[0].first_sample) / plan.sampling_rate
        # Some drivers take the time of the arrival.
        assert (block.stamp - begin) * 1e-9 == pytest.approx(delay, abs=0.1)
        expected += size
    for name in ("hammer", "specimen") if plan.specimen is not None else ("hammer",):
        changes = np.flatnonzero(np.diff(join(blocks, name)))
        repeats = np.gcd.reduce(np.diff(changes)) if changes.size > LEAST_CHANGES else 1
        assert repeats < 2, f"each point of the {name} is there {repeats} times"  # noqa: PLR2004


LEAST_CHANGES = 10
"""Changes of a signal from which repeated points are recognized [-], our choice."""


def check_pair(hammer: FloatArray, specimen: FloatArray) -> None:
    """Require pulses of hammer and sample, as sizes, that differ, and begin together."""
    assert not np.array_equal(hammer, specimen), "both channels are the same"
    floor = 10.0 * np.median(specimen)
    assert specimen.max() > floor, "the sample's channel shows no pulse"
    levels = max(0.1 * hammer.max(), 10.0 * np.median(hammer)), max(0.1 * specimen.max(), floor)
    begins = [int(np.argmax(hammer > levels[0])), int(np.argmax(specimen > levels[1]))]
    late = begins[1] - begins[0]
    assert abs(late) <= 0.2 * find_width(hammer) + 2, f"the sample is {late} points late"


def join(blocks: list[Block], name: str) -> FloatArray:
    """Return the acceleration of a channel over some blocks [m/s^2]."""
    return np.concatenate([getattr(block, name).acceleration for block in blocks])


def find_peak(values: FloatArray) -> float:
    """Return the largest value without offset, with its sign."""
    upright = values - np.median(values)
    return float(upright[np.argmax(np.abs(upright))])


def find_width(values: FloatArray) -> int:
    """Return the points of a pulse above half its peak."""
    size = np.abs(values - np.median(values))
    return int(np.count_nonzero(size > 0.5 * size.max()))


def join_size(blocks: list[Block], name: str = "hammer") -> FloatArray:
    """Return the size of a channel's acceleration over some blocks, without offset [m/s^2]."""
    values = join(blocks, name)
    size: FloatArray = np.abs(values - np.median(values))
    return size
