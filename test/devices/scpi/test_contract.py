"""The driver of instruments that speak SCPI does what every driver does."""

import pytest

from impact_rig.devices.acceleration_source import AcquisitionPlan
from impact_rig.devices.contract.benches import SourceBench
from impact_rig.devices.contract.source_contract import AccelerationSourceContract
from impact_rig.devices.scpi.source import ScpiSource


class ScpiBench(SourceBench):
    """An instrument whose cable can be pulled."""

    def __init__(self, rig, profile) -> None:
        self._rig, self._profile = rig, profile

    def get_driver(self) -> type[ScpiSource]:
        return ScpiSource

    def unplug(self) -> None:
        self._rig.digitizer.unplug()

    def plug(self) -> None:
        self._rig.digitizer.plug()

    def make_source(self) -> ScpiSource:
        return self._profile()[0]

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return self._profile(continuous=continuous, block_size=700)[1]

    def strike(self, source: ScpiSource) -> None:
        self._rig.strike()


class TestScpiSource(AccelerationSourceContract):
    """The contract, on a peer that speaks SCPI, with each profile."""

    @pytest.fixture
    def bench(self, rig, profile) -> ScpiBench:
        return ScpiBench(rig, profile)
