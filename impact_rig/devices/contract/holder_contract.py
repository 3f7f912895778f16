"""What every driver of a hammer holder does, as tests; see the package's docstring."""

import time
from collections.abc import Callable
from typing import Any

import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.devices.contract.benches import HolderBench
from impact_rig.devices.contract.driver_contract import (
    CYCLES,
    LATE,
    PATIENCE,
    DriverContract,
    check_sentence,
)
from impact_rig.devices.drivers import HOLDERS
from impact_rig.devices.hammer_holder import HammerHolder, HolderState

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
        holder = bench.make_holder()
        try:
            assert holder.configure()
            assert holder.read_state() is HolderState.HOLDING
            wait_until(bench.is_holding)
            assert bench.count_releases() == 0
        finally:
            holder.close()

    def test_it_lets_go_and_holds_again_each_time(self, bench: HolderBench) -> None:
        holder = bench.make_holder()
        try:
            holder.configure()
            for count in range(1, 4):
                holder.release()
                assert holder.read_state() is HolderState.RELEASED
                wait_for_releases(bench, count)
                assert not bench.is_holding()
                holder.hold()
                assert holder.read_state() is HolderState.HOLDING
                wait_until(bench.is_holding)
        finally:
            holder.close()

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
        holder = bench.make_holder()
        try:
            with pytest.raises(DeviceError) as found:
                holder.configure()
            check_sentence(found.value)
        finally:
            holder.close()

    def test_it_comes_back_as_often_as_it_is_unplugged_and_holds(self, bench: HolderBench) -> None:
        holder = bench.make_holder()
        try:
            holder.configure()
            for _ in range(CYCLES):
                bench.unplug()
                with pytest.raises(DeviceError) as found:
                    wait_for_loss(holder)
                check_sentence(found.value)
                holder.close()
                with pytest.raises(DeviceError):
                    holder.configure()
                holder.close()
                bench.plug()
                holder.configure()
            wait_until(bench.is_holding)
            assert bench.count_releases() == 0
        finally:
            holder.close()


def wait_for_loss(holder: HammerHolder) -> None:
    """Ask until the loss of the device is noticed, which raises."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        holder.read_state()
        holder.hold()


def wait_for_releases(bench: HolderBench, count: int) -> None:
    """Wait until the device has let go so often."""
    wait_until(lambda: bench.count_releases() == count)


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait for what a device does, which sends no event."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.005)
