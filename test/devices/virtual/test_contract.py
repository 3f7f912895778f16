"""The virtual rig keeps the contract that holds for every source."""

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.contract.benches import SourceBench
from impact_rig.devices.contract.source_contract import AccelerationSourceContract
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.source import VirtualSource, make_virtual_plan


class VirtualSourceBench(SourceBench):
    def get_driver(self):
        return VirtualSource

    def make_source(self):
        source = VirtualSource(TomlTable({}, "[source]"))
        source.take_setup(PAPER_SETUP)
        return source

    def make_plan(self, *, continuous=False):
        return make_virtual_plan(
            DigitizerSettings(),
            continuous=continuous,
            block_size=25_000 if continuous else 1000,
            depth=400,
        )

    def strike(self, source):
        source.strike(HitLabel(CONTROL_SAMPLE), swing_time=0.0)


class TestVirtualSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self):
        with VirtualSourceBench() as bench:
            yield bench
