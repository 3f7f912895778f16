"""What every holder does, as far as there is something to see."""

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.contract.benches import HolderBench
from impact_rig.devices.contract.holder_contract import HammerHolderContract
from impact_rig.devices.virtual.holder import VirtualHolder


class VirtualHolderBench(HolderBench):
    """A holder with nothing behind it."""

    def get_driver(self):
        return VirtualHolder

    def make_holder(self):
        return VirtualHolder(TomlTable({}, "[holder]"))


class TestVirtualHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self):
        with VirtualHolderBench() as bench:
            yield bench
