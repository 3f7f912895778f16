"""The contracts find every kind of bad driver; the drivers of this package pass them."""

from dataclasses import replace

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.devices.protocols import CommandedHolder, HolderState
from impact_rig.devices.virtual.drivers import VirtualSource, make_virtual_plan
from impact_rig.testing import (
    AccelerationSourceContract,
    HammerHolderContract,
    HolderBench,
    SourceBench,
)

OPTIONS = TomlTable({}, "[source]")


class VirtualBench(SourceBench):
    patience = 0.5

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
        source.strike(HitLabel(CONTROL_SAMPLE), swing_time=0.0)

    def unplug(self):
        """Do nothing: the virtual rig does not notice."""


class TestVirtualSource(AccelerationSourceContract):
    test_it_comes_back_as_often_as_it_is_unplugged = None  # it has no plug

    @pytest.fixture
    def bench(self):
        return VirtualBench(VirtualSource)


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


@pytest.mark.parametrize("driver", [Dropping, Unchanging])
def test_a_holder_that_breaks_its_contract_is_found(driver):
    test = HammerHolderContract().test_it_releases_when_it_is_asked_and_never_by_itself
    test(MagnetBench(Magnet))
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        test(MagnetBench(driver))
