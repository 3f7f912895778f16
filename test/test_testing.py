"""The contracts themselves: a good driver passes them, and every kind of bad one fails."""

import time

import numpy as np
import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.core.records import Block, ChannelBlock
from impact_rig.core.sensors import Sensor
from impact_rig.devices.protocols import Acquisition, AcquisitionPlan, HolderState, SourceChannel
from impact_rig.testing import (
    AccelerationSourceContract,
    HammerHolderContract,
    HolderBench,
    SourceBench,
)

RATE = 100_000.0


class Digitizer:
    """A device of this test: it is there, and may have been triggered."""

    def __init__(self):
        self.is_there = True
        self.is_triggered = False


class GoodSource:
    description = "a source of this test"
    example = '[source]\ndriver = "good"\naddress = "here"\n'

    def __init__(self, options, digitizer=None):
        options.check_keys("address")
        self.digitizer = digitizer
        self.plan = None
        self.blocks = []

    @classmethod
    def find_devices(cls):
        return ()

    def check(self):
        if not self.digitizer.is_there:
            raise DeviceError("the digitizer of this test does not answer: plug it in")

    def configure(self, plan):
        self.check()
        if plan.continuous:
            raise DeviceError("the digitizer of this test cannot stream: choose triggered mode")
        self.plan = plan
        return Acquisition("digitizer of this test", plan.sampling_rate)

    def arm(self):
        self.check()
        self.digitizer.is_triggered = False
        self.blocks = []

    def make_trace(self):
        trace = np.zeros(self.plan.points, dtype=np.int32)
        trace[self.plan.pre_trigger_points :][:20] = 500
        return trace

    def make_blocks(self):
        trace, size = self.make_trace(), self.plan.block_size
        stamp = time.time_ns()
        for first in range(0, trace.size, size):
            channel = ChannelBlock(trace[first : first + size], 0.1, 0.0, 200.0)
            yield Block(
                first,
                RATE,
                channel,
                channel,
                last=first + size >= trace.size,
                stamp=stamp + round(first / RATE * 1e9),
            )

    def read(self, timeout):
        self.check()
        if self.digitizer.is_triggered:
            self.digitizer.is_triggered = False
            self.blocks = list(self.make_blocks())
        if self.blocks:
            return self.blocks.pop(0)
        time.sleep(timeout / 10)
        return None

    def disarm(self):
        if self.plan:
            self.digitizer.is_triggered = False
            self.blocks = []

    def close(self):
        self.disarm()


class Bench(SourceBench):
    def __init__(self, driver=GoodSource):
        self.driver = driver
        self.digitizer = Digitizer()

    def get_driver(self):
        return self.driver

    def make_source(self):
        class Options:
            def check_keys(self, *known):
                pass

        return self.driver(Options(), self.digitizer)

    def make_plan(self, *, continuous=False):
        channel = SourceChannel("1", Sensor("hammer", unit="g", sensitivity=0.01))
        return AcquisitionPlan(
            RATE, 2e-3, 0.5e-3, 10.0, channel, channel, continuous=continuous, block_size=64
        )

    def strike(self, source):
        self.digitizer.is_triggered = True

    def unplug(self):
        self.digitizer.is_there = False

    def plug(self):
        self.digitizer.is_there = True


class ImpatientBench(Bench):
    patience = 0.5


class TestGoodSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self):
        return Bench()


class Late(GoodSource):
    """Its pulse lies at the wrong place: the trigger's delay was forgotten."""

    def make_trace(self):
        return np.roll(super().make_trace(), 40)


class Lossy(GoodSource):
    def make_blocks(self):
        blocks = list(super().make_blocks())
        del blocks[1]
        yield from blocks


class Remembering(GoodSource):
    def disarm(self):
        pass

    def arm(self):
        self.check()


class Stoic(GoodSource):
    """It does not notice that its device is gone."""

    def check(self):
        pass


CONTRACT = AccelerationSourceContract


@pytest.mark.parametrize(
    ("driver", "test"),
    [
        (Late, CONTRACT.test_each_arming_gives_one_whole_record),
        (Lossy, CONTRACT.test_each_arming_gives_one_whole_record),
        (Remembering, CONTRACT.test_what_was_not_read_is_forgotten_when_it_is_disarmed),
        (Stoic, CONTRACT.test_it_comes_back_as_often_as_it_is_unplugged),
    ],
)
def test_a_source_that_breaks_its_contract_is_found(driver, test):
    # pytest.raises fails by an exception of its own.
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        test(CONTRACT(), ImpatientBench(driver))


class Magnet:
    def __init__(self):
        self.is_there = True
        self.is_on = True
        self.releases = 0

    def switch(self, is_on):
        if not self.is_there:
            raise DeviceError("the magnet of this test does not answer: plug it in")
        self.releases += self.is_on and not is_on
        self.is_on = is_on


class GoodHolder:
    description = "a holder of this test"
    example = '[holder]\ndriver = "good"\nswing_time = "207 ms"\n'
    is_by_hand = False

    def __init__(self, options, magnet=None):
        options.check_keys()
        self.magnet = magnet
        self.state = HolderState.HOLDING

    @classmethod
    def find_devices(cls):
        raise ModuleNotFoundError("No module named 'magnets'", name="magnets")

    def configure(self):
        self.hold()
        return "magnet of this test"

    def hold(self):
        self.magnet.switch(True)
        self.state = HolderState.HOLDING

    def release(self):
        self.magnet.switch(False)
        self.state = HolderState.RELEASED

    def read_state(self):
        self.magnet.switch(self.magnet.is_on)
        return self.state

    def close(self):
        pass


class MagnetBench(HolderBench):
    def __init__(self, driver=GoodHolder):
        self.driver = driver
        self.magnet = Magnet()

    def get_driver(self):
        return self.driver

    def make_holder(self):
        return self.driver(type("", (), {"check_keys": lambda *_: None})(), self.magnet)

    def is_holding(self):
        return self.magnet.is_on

    def count_releases(self):
        return self.magnet.releases

    def unplug(self):
        self.magnet.is_there = False

    def plug(self):
        self.magnet.is_there = True


class TestGoodHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self):
        return MagnetBench()


class Dropping(GoodHolder):
    """It switches everything off when it is closed."""

    def close(self):
        if self.magnet.is_there:
            self.magnet.switch(False)


class Unchanging(GoodHolder):
    def read_state(self):
        return HolderState.HOLDING


HOLDING = HammerHolderContract


@pytest.mark.parametrize(
    ("driver", "test"),
    [
        (Dropping, HOLDING.test_it_never_releases_by_itself),
        (Unchanging, HOLDING.test_it_holds_once_configured_and_releases_each_time_it_is_asked),
    ],
)
def test_a_holder_that_breaks_its_contract_is_found(driver, test):
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        test(HOLDING(), MagnetBench(driver))
