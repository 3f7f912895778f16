"""The driver of recordings does what every driver does."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.contract.benches import SourceBench
from impact_rig.devices.contract.source_contract import AccelerationSourceContract
from impact_rig.devices.recording.source import RecordingSource

SAMPLE = "steel small"


class RecordingBench(SourceBench):
    """A recording that can be moved out of the way."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._away = path.with_suffix(".away")
        self._struck = 0

    def get_driver(self) -> type[RecordingSource]:
        return RecordingSource

    def unplug(self) -> None:
        self._path.rename(self._away)

    def plug(self) -> None:
        self._away.rename(self._path)

    def make_source(self) -> RecordingSource:
        return RecordingSource(TomlTable({"file": str(self._path)}, "[source]"))

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return AcquisitionPlan(
            sampling_rate=2.5e6,
            record_duration=2e-3,
            pre_trigger=2e-4,
            trigger_level=30.0,
            hammer=SourceChannel("1", Sensor("hammer")),
            specimen=SourceChannel("2", Sensor("specimen")),
            continuous=continuous,
            block_size=700,
        )

    def strike(self, source: RecordingSource) -> None:
        self._struck += 1
        source.strike(HitLabel(SAMPLE, self._struck, self._struck), 0.0)


class TestRecordingSource(AccelerationSourceContract):
    """The contract, on a recording of the virtual rig."""

    @pytest.fixture
    def bench(self, tmp_path, write, strike_for_recording) -> Iterator[RecordingBench]:
        blocks = [
            block
            for number in range(1, 7)
            for block in strike_for_recording(SAMPLE, number, number)
        ]
        path = write(tmp_path / "session.mcap", [PAPER_SETUP, *blocks])
        with RecordingBench(path) as bench:
            yield bench
