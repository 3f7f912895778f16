"""What every holder does, as far as an operator shows it."""

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.contract.benches import HolderBench
from impact_rig.devices.contract.holder_contract import HammerHolderContract
from impact_rig.devices.manual.holder import ManualHolder


class ManualBench(HolderBench):
    """Nobody looks at what the operator does."""

    def get_driver(self):
        return ManualHolder

    def make_holder(self):
        return ManualHolder(TomlTable({}, "[holder]"))


class TestManualHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self):
        with ManualBench() as bench:
            yield bench
