"""What every holder does; to be run in full where there is a line to switch."""

from pathlib import Path

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.contract.benches import HolderBench
from impact_rig.devices.contract.holder_contract import HammerHolderContract
from impact_rig.devices.gpio.holder import GpioHolder

pytest.importorskip("gpiod", reason="the extra `gpio` is not installed")


class GpioBench(HolderBench):
    """A chip that the kernel simulates: no line of a real one is switched by a test."""

    def get_driver(self):
        return GpioHolder

    def make_holder(self):
        import gpiod

        for path in sorted(Path("/dev").glob("gpiochip*")):
            with gpiod.Chip(str(path)) as chip:
                is_simulated = chip.get_info().label.startswith("gpio-sim")
            if is_simulated:
                return GpioHolder(TomlTable({"chip": str(path), "line": 0}, "[holder]"))
        pytest.skip("this kernel simulates no GPIO: load gpio-sim to run this")


class TestGpioHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self):
        with GpioBench() as bench:
            yield bench
