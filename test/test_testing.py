"""The contracts find every kind of bad driver; the drivers of this package pass them."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.protocols import CommandedHolder, HolderState
from impact_rig.devices.scpi import ScpiSource
from impact_rig.devices.virtual.drivers import VirtualSource, make_virtual_plan
from impact_rig.testing import (
    AccelerationSourceContract,
    Applied,
    HammerHolderContract,
    HolderBench,
    SourceBench,
    make_plan,
)

OPTIONS = TomlTable({"plant": "contact"}, "[source]")


class VirtualBench(SourceBench):
    patience = 0.5
    applied = Applied(hammer=-694.0, specimen=1172.0, width=86e-6)
    bits = 12

    def __init__(self, driver):
        self.driver = driver

    def make_source(self):
        source = self.driver(OPTIONS)
        source.take_setup(PAPER_SETUP)
        return source

    def make_plan(self, *, continuous=False):
        size = 25_000 if continuous else 1000
        return replace(make_virtual_plan(OPTIONS), continuous=continuous, block_size=size)

    def strike(self, source):
        source.strike(HitLabel("steel small"), swing_time=0.0)

    def unplug(self):
        """Do nothing: the virtual rig does not notice."""


class TestVirtualSource(AccelerationSourceContract):
    test_it_comes_back_as_often_as_it_is_unplugged = None  # it has no plug

    @pytest.fixture
    def bench(self):
        return VirtualBench(VirtualSource)


class Altered(VirtualSource):
    """What it delivers is altered, point by point of a whole record."""

    def _make_rig(self):
        rig = super()._make_rig()
        strike = rig.strike
        rig.strike = lambda label: self.alter(strike(label))
        return rig

    def change(self, hit, name, change):
        channel = getattr(hit, name)
        return replace(hit, **{name: replace(channel, output=change(channel.output))})


class Swapped(Altered):
    def alter(self, hit):
        return replace(hit, hammer=hit.specimen, specimen=hit.hammer)


class Negated(Altered):
    def alter(self, hit):
        return self.change(hit, "specimen", np.negative)


class NegatedBoth(Negated):
    def alter(self, hit):
        return self.change(super().alter(hit), "hammer", np.negative)


class Dead(Altered):
    def alter(self, hit):
        noise = np.random.default_rng(1).integers(-3, 4, hit.specimen.output.size, np.int32)
        return self.change(hit, "specimen", lambda _: noise)


class Halved(Altered):
    def alter(self, hit):
        return self.change(hit, "specimen", lambda values: values // 2)


class LateSpecimen(Altered):
    def alter(self, hit):
        return self.change(hit, "specimen", lambda values: np.roll(values, 60))


class Equal(Altered):
    def alter(self, hit):
        return replace(hit, specimen=hit.hammer)


class HalfTheRate(Altered):
    """It samples half as often as it says, before and after the trigger."""

    def alter(self, hit):
        points = 500 + 2 * (np.arange(5000) - 500)
        points = np.where((points < 0) | (points >= 5000), 0, points)
        for name in ("hammer", "specimen"):
            hit = self.change(hit, name, lambda values: values[points])
        return hit


class EightBits(Altered):
    def alter(self, hit):
        return self.change(hit, "hammer", lambda values: values >> 4 << 4)


class LowByte(Altered):
    """It forgets the upper byte of each number."""

    def alter(self, hit):
        return self.change(hit, "hammer", lambda values: (values + 128) % 256 - 128)


class Repeating(Altered):
    """It writes each point twice."""

    def alter(self, hit):
        return self.change(hit, "specimen", lambda values: values[np.arange(5000) // 2 * 2])


class SlowStream(VirtualSource):
    """Its stream is half as fast as it says."""

    def configure(self, plan):
        found = super().configure(replace(plan, sampling_rate=plan.sampling_rate / 2))
        return replace(found, sampling_rate=plan.sampling_rate)


class Unfinished:
    """It has no method `check`."""

    arm = read = disarm = configure = close = find_devices = None


class Late(VirtualSource):
    """Its pulse lies at the wrong place: the trigger's delay was forgotten."""

    def configure(self, plan):
        return super().configure(replace(plan, pre_trigger=1e-3))


class Lossy(VirtualSource):
    def read(self, timeout):
        block = super().read(timeout)
        return super().read(timeout) if block and block.first_sample == 1000 else block


class Remembering(VirtualSource):
    def disarm(self):
        pass

    def arm(self):
        self._digitizer._is_armed = True


CONTRACT = AccelerationSourceContract


@pytest.mark.parametrize(
    ("driver", "test"),
    [
        (Unfinished, CONTRACT.test_it_has_every_method),
        (Swapped, CONTRACT.test_it_measures_what_is_applied),
        (Negated, CONTRACT.test_it_measures_what_is_applied),
        (NegatedBoth, CONTRACT.test_it_measures_what_is_applied),
        (Halved, CONTRACT.test_it_measures_what_is_applied),
        (HalfTheRate, CONTRACT.test_it_measures_what_is_applied),
        (Dead, CONTRACT.test_each_arming_gives_one_whole_record),
        (LateSpecimen, CONTRACT.test_each_arming_gives_one_whole_record),
        (Equal, CONTRACT.test_each_arming_gives_one_whole_record),
        (Repeating, CONTRACT.test_each_arming_gives_one_whole_record),
        (EightBits, CONTRACT.test_no_bit_is_lost),
        (LowByte, CONTRACT.test_it_measures_what_is_applied),
        (SlowStream, CONTRACT.test_its_rate_is_that_of_the_clock),
        (Late, CONTRACT.test_each_arming_gives_one_whole_record),
        (Lossy, CONTRACT.test_each_arming_gives_one_whole_record),
        (Remembering, CONTRACT.test_what_was_not_read_is_forgotten_when_it_is_disarmed),
        (VirtualSource, CONTRACT.test_it_comes_back_as_often_as_it_is_unplugged),
    ],
)
def test_a_source_that_breaks_its_contract_is_found(driver, test):
    # pytest.raises fails by another exception.
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        test(CONTRACT(), VirtualBench(driver))


class Magnet(CommandedHolder):
    releases = 0

    def configure(self):
        self.hold()
        return "magnet of this test"

    def command(self, state):
        self.releases += (self.commanded, state) == (HolderState.HOLDING, HolderState.RELEASED)
        self.commanded = state


class Dropping(Magnet):
    """It switches everything off when it is closed."""

    def close(self):
        self.command(HolderState.RELEASED)


class Unchanging(Magnet):
    def read_state(self):
        return HolderState.HOLDING


class MagnetBench(HolderBench):
    def __init__(self, driver):
        self.magnet = driver()

    def make_holder(self):
        return self.magnet

    def is_holding(self):
        return self.magnet.commanded is HolderState.HOLDING

    def count_releases(self):
        return self.magnet.releases


def test_what_a_bench_does_not_state_is_skipped_aloud():
    bench = VirtualBench(VirtualSource)
    bench.applied = bench.bits = None
    for test in (CONTRACT.test_it_measures_what_is_applied, CONTRACT.test_no_bit_is_lost):
        with pytest.raises(pytest.skip.Exception, match="this bench does not state"):
            test(CONTRACT(), bench)
    with pytest.raises(NotImplementedError, match="SourceBench needs a method make_source"):
        SourceBench().make_source()


def test_a_plan_is_made_of_a_drivers_example():
    plan = make_plan(ScpiSource.example, continuous=True)
    assert plan.hammer.sensor.sensitivity > 0
    assert plan.continuous


@pytest.mark.parametrize("driver", [Dropping, Unchanging])
def test_a_holder_that_breaks_its_contract_is_found(driver):
    test = HammerHolderContract().test_it_releases_when_it_is_asked_and_never_by_itself
    test(MagnetBench(Magnet))
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        test(MagnetBench(driver))
