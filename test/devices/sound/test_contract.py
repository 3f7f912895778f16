"""The driver of sound cards does what every driver does, at a PulseAudio server of its own."""

from collections.abc import Iterator

import pytest

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.setup.sensors import Sensor
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.contract.benches import SourceBench
from impact_rig.devices.contract.source_contract import AccelerationSourceContract
from impact_rig.devices.peers.sound_card import SoundCardPeer, make_pulse
from impact_rig.devices.sound.source import SoundSource

RATE = 192_000
FULL_SCALE = 100.0


class SoundBench(SourceBench):
    """A card that plays a pulse where a hammer would strike."""

    def __init__(self, card: SoundCardPeer) -> None:
        self._card = card
        self.unplug, self.plug = card.unplug, card.plug

    def get_driver(self) -> type[SoundSource]:
        return SoundSource

    def make_source(self) -> SoundSource:
        return SoundSource(TomlTable({"device": self._card.name}, "[source]"))

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return AcquisitionPlan(
            sampling_rate=RATE,
            record_duration=0.02,
            pre_trigger=0.005,
            trigger_level=5.0,
            hammer=SourceChannel("1", Sensor("hammer", full_scale=FULL_SCALE)),
            specimen=SourceChannel("2", Sensor("specimen", full_scale=FULL_SCALE)),
            continuous=continuous,
            block_size=1000,
        )

    def strike(self, source: SoundSource) -> None:
        store = source._streaming.capture.store
        begin = store.end
        self._card.feed(make_pulse(RATE))

        def has_come() -> bool:
            return any(run.counts.any() for run in store.find_runs(begin, store.end))

        # A sound card is late: the pulse is on its way for some hundredths of a second.
        with source._streaming.capture.changed:
            assert source._streaming.capture.changed.wait_for(has_come, 20.0)


class TestSoundSource(AccelerationSourceContract):
    """The contract, on a card of PulseAudio."""

    @pytest.fixture
    def bench(self, card: SoundCardPeer) -> Iterator[SoundBench]:
        with SoundBench(card) as bench:
            yield bench
