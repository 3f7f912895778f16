"""The driver of sound cards, with a separate PulseAudio server."""

import ctypes.util
import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fakes.sound_card import FakeSoundCard, is_installed, make_pulse

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.sensors import Sensor
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.devices.sound import SoundSource, compute_count_scale
from impact_rig.testing import AccelerationSourceContract, SourceBench

PACKAGES = ("libportaudio2", "pulseaudio", "pulseaudio-utils", "libasound2-plugins")
"""What brings a virtual sound card."""


@pytest.fixture
def card(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeSoundCard]:
    """Return a card that PortAudio finds in this process."""
    if not ctypes.util.find_library("portaudio") or not is_installed():
        pytest.skip(f"no virtual sound card: on Debian, apt-get install {' '.join(PACKAGES)}")
    peer = FakeSoundCard()
    for key, value in peer.environment.items():
        monkeypatch.setitem(os.environ, key, value)
    yield peer
    peer.stop()


GRAVITY = 9.80665
PLACE = "[source.hammer]"


def make_channel(sensor: Sensor, **options) -> SourceChannel:
    return SourceChannel("1", sensor, options=TomlTable(options, PLACE))


def test_a_voltage_is_one_by_the_input_range():
    sensor = Sensor("hammer", unit="g", sensitivity=0.01, full_scale=500.0)
    found = compute_count_scale(make_channel(sensor, input_range="1.4 V"))
    assert found.scale * 2**31 == pytest.approx(140 * GRAVITY)
    assert found.full_scale == pytest.approx(140 * GRAVITY)
    found = compute_count_scale(make_channel(sensor, input_range="10 V"))
    assert found.full_scale == pytest.approx(500 * GRAVITY), "the sensor takes no more"


def test_without_a_sensitivity_the_full_scale_is_the_largest_count():
    found = compute_count_scale(make_channel(Sensor("hammer", unit="g", full_scale=20.0)))
    assert found.scale * 2**31 == pytest.approx(20 * GRAVITY)


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        (Sensor("hammer", unit="g", sensitivity=0.1), "lacks input_range"),
        (Sensor("hammer"), r"\[source.hammer\] lacks sensitivity or"),
    ],
)
def test_a_scale_that_is_unknown_is_refused(sensor, words):
    with pytest.raises(ParameterError, match=words):
        compute_count_scale(make_channel(sensor))


@pytest.mark.parametrize("bits", [16, 32])
def test_the_largest_count_of_every_converter_is_an_overload(bits):
    scale = compute_count_scale(make_channel(Sensor("hammer", full_scale=1.0)))
    unused = 32 - bits
    for rail in ((2 ** (bits - 1) - 1) << unused, -(2**31)):
        counts = np.array([0, rail], np.int64).astype(np.int32)
        assert scale.make_block(counts).overloaded
    below = np.array([int(0.999 * 2**31), -int(0.999 * 2**31)], np.int32)
    assert not scale.make_block(below).overloaded


RATE = 192_000
FULL_SCALE = 2000.0
PATIENCE = 20.0
PLAN = AcquisitionPlan(
    sampling_rate=RATE,
    record_duration=0.02,
    pre_trigger=0.002,
    trigger_level=50.0,
    hammer=SourceChannel("1", Sensor("hammer", full_scale=FULL_SCALE)),
    specimen=SourceChannel("2", Sensor("specimen", full_scale=2 * FULL_SCALE)),
    block_size=1500,
)


@pytest.fixture
def make_source(card):
    """Return a function that makes a configured source of the card."""
    sources = []

    def make(plan=PLAN) -> SoundSource:
        sources.append(SoundSource(TomlTable({"device": card.name}, "[source]")))
        sources[-1].configure(plan)
        return sources[-1]

    yield make
    for source in sources:
        source.close()


def read_next(source: SoundSource):
    """Return the next block, which must come."""
    block = source.read(PATIENCE)
    assert block is not None
    return block


def join(blocks, channel: str) -> np.ndarray:
    """Return a channel's counts."""
    return np.concatenate([getattr(block, channel).output for block in blocks])


def test_a_stream_is_what_the_card_heard_bit_by_bit(card, make_source):
    generator = np.random.default_rng(5)
    heard = generator.integers(-(2**31), 2**31, (RATE // 4, 2), dtype=np.int64).astype(np.int32)
    source = make_source(replace(PLAN, continuous=True))
    source.arm()
    card.feed(heard)
    blocks = [read_next(source)]
    wanted = np.count_nonzero(heard[:, 0])
    while sum(np.count_nonzero(block.hammer.output) for block in blocks) < wanted:
        blocks.append(read_next(source))
    hammer, specimen = join(blocks, "hammer"), join(blocks, "specimen")
    begin = int(np.flatnonzero(hammer)[0]) - int(np.flatnonzero(heard[:, 0])[0])
    assert np.array_equal(hammer[begin : begin + len(heard)], heard[:, 0])
    assert np.array_equal(specimen[begin : begin + len(heard)], heard[:, 1])
    assert blocks[0].hammer.scale == FULL_SCALE / 2**31
    assert blocks[0].specimen.full_scale == 2 * FULL_SCALE


def test_one_channel_may_be_all(card, make_source):
    source = make_source(replace(PLAN, hammer=replace(PLAN.hammer, name="2"), specimen=None))
    source.arm()
    card.feed(make_pulse())
    blocks = [read_next(source)]
    while not blocks[-1].last:
        blocks.append(read_next(source))
    # It is the right one, which records half of the pulse.
    assert np.max(np.abs(join(blocks, "hammer"))) == pytest.approx(0.25 * 2**31, rel=1e-6)
    assert all(block.specimen.output.size == 0 for block in blocks)


def test_what_port_audio_lost_is_a_gap(make_source):
    source = make_source(replace(PLAN, continuous=True))
    source.arm()
    lost = 480
    source._stream.stop()  # PortAudio's thread would go on counting meanwhile
    # PortAudio says that points were lost in front of a block, and when it was taken.
    before, points = source._last_block
    taken = before + (points + lost) / source.sampling_rate
    place = source.count
    source.take_block(
        np.ones((50, 2), np.int32).tobytes(),
        50,
        SimpleNamespace(inputBufferAdcTime=taken, currentTime=taken),
        SimpleNamespace(input_overflow=True),
    )
    assert source.count == place + lost + 50
    blocks = [read_next(source)]
    while not blocks[-1].hammer.output.any():
        blocks.append(read_next(source))
    ends = [0] + [block.first_sample + block.hammer.output.size for block in blocks]
    assert blocks[-1].first_sample - ends[-2] == lost


def test_a_card_that_falls_silent_is_lost(card, make_source):
    source = make_source()
    source.longest_silence = 0.5
    source.arm()
    card.is_silent = True
    with pytest.raises(DeviceError, match=r"rig_card, ALSA is silent: .* nothing for \d+\.\d s"):
        source.read(PATIENCE)


def test_the_card_is_found_by_its_name_or_a_part_of_it(card):
    found = SoundSource.find_devices()
    assert card.name in [device.address for device in found]
    for device in (card.name, "RIG_", "rig_card, ALSA"):
        source = SoundSource(TomlTable({"device": device}, "[source]"))
        assert source.configure(PLAN).identity == "sound device rig_card, ALSA"
        source.close()


def test_a_card_that_is_not_there_is_named_with_the_line(card):
    table = parse_toml_table('[source]\ndevice = "Digiducer"\n').take_table("source")
    with pytest.raises(DeviceError, match=r"line 2: there is no sound device 'Digiducer': this"):
        SoundSource(table).configure(PLAN)


def test_a_channel_that_the_card_has_not_is_refused(make_source):
    for name in ("0", "99", "left", "-1"):
        hammer = replace(PLAN.hammer, name=name)
        with pytest.raises(ParameterError, match=r"rig_card, ALSA has 1 to "):
            make_source(replace(PLAN, hammer=hammer))


def test_port_audio_that_is_not_installed_is_told_with_its_package(monkeypatch):
    monkeypatch.delitem(sys.modules, "sounddevice", raising=False)
    monkeypatch.setattr(ctypes.util, "find_library", lambda _: None)
    with pytest.raises(DeviceError, match="package libportaudio2"):
        SoundSource.find_devices()


class SoundBench(SourceBench):
    """A card that plays a pulse where a hammer would strike."""

    driver = SoundSource

    def __init__(self, card: FakeSoundCard) -> None:
        self._card = card
        self.unplug, self.plug = card.unplug, card.plug

    def make_source(self) -> SoundSource:
        return SoundSource(TomlTable({"device": self._card.name}, "[source]"))

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return replace(PLAN, continuous=continuous, block_size=1000)

    def strike(self, source: SoundSource) -> None:
        begin = source.count
        self._card.feed(make_pulse())

        def has_come() -> bool:
            new = [block for block in source.blocks if block.first_sample >= begin]
            return any(block.hammer.output.any() for block in new)

        # A sound card is late: the pulse is on its way for some hundredths of a second.
        with source.changed:
            assert source.changed.wait_for(has_come, 20.0)


class TestSoundSource(AccelerationSourceContract):
    """The contract, on a card of PulseAudio."""

    @pytest.fixture
    def bench(self, card: FakeSoundCard) -> SoundBench:
        return SoundBench(card)
