"""The driver of recordings: hits as they were measured, one by one, by its contract and beyond."""

import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.protocols import AcquisitionPlan, HammerlessSource, SourceChannel
from impact_rig.devices.recording import RecordingSource
from impact_rig.devices.virtual.rig import (
    FaultPlan,
    VirtualRig,
    VirtualRigSettings,
    scheduled_fault_from_text,
)
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.writer import McapWriter
from impact_rig.testing.contract import AccelerationSourceContract, SourceBench

MILLISECOND = 1_000_000
"""[ns]"""
BLOCK_SIZE = 1000


def write_events(path: Path, events: Sequence[RigSetup | Block]) -> Path:
    """Write set-ups and blocks as a recorder does, a millisecond after each other."""
    encoder = MessageEncoder()
    path.parent.mkdir(exist_ok=True)
    with McapWriter(path, chunk_size=100_000) as writer:
        setups = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        blocks = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        for number, event in enumerate(events, start=1):
            time = number * MILLISECOND
            if isinstance(event, RigSetup):
                writer.add_message(setups, encoder.encode_setup(event, time), time, time)
            else:
                writer.add_message(blocks, encoder.encode_block(event), time, time)
    return path


@cache
def strike(sample: str, record: int, impact: int, attempt: int = 1, fault: str = "") -> tuple:
    """Return the blocks of one hit."""
    scheduled = (scheduled_fault_from_text(f"{impact}:{fault}"),) if fault else ()
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=FaultPlan(scheduled=scheduled)))
    return rig.strike(HitLabel(sample, record, impact, attempt)).split(BLOCK_SIZE, 0)


PLAN = AcquisitionPlan(
    sampling_rate=1e6,
    record_duration=1e-3,
    pre_trigger=1e-4,
    trigger_level=10.0,
    hammer=SourceChannel("1", Sensor("hammer")),
    specimen=None,
)
STEEL, BRASS = "steel small", "brass large"


@pytest.fixture
def make_source(tmp_path):
    """Return a function that makes a configured source of set-ups and blocks."""

    def make(events, **keys) -> RecordingSource:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        path = write_events(folder / "session.mcap", events)
        source = RecordingSource(TomlTable({"file": str(path), **keys}, "[source]"))
        source.configure(PLAN)
        return source

    return make


def deliver(source: RecordingSource, label: HitLabel) -> list[Block]:
    """Return the blocks of one hit."""
    source.arm()
    source.strike(label, 0.0)
    blocks = []
    while (block := source.read(0.0)) is not None:
        blocks.append(block)
    source.disarm()
    return blocks


def tell_hits(source: RecordingSource, labels, recorded) -> list[HitLabel]:
    """Return which recorded hits are delivered for some labels, by their counts."""
    known = {hit[0].hammer.output.tobytes(): hit[0].label for hit in recorded}
    return [known[deliver(source, label)[0].hammer.output.tobytes()] for label in labels]


def is_same(recorded: Block, delivered: Block) -> bool:
    """Return whether both have the same output, bit by bit, with the same meaning."""
    return (recorded.first_sample, recorded.last) == (
        delivered.first_sample,
        delivered.last,
    ) and all(
        np.array_equal(mine.output, other.output)
        and mine.output.dtype == other.output.dtype
        and mine.has_calibration_of(other)
        and mine.overloaded == other.overloaded
        for mine, other in (
            (recorded.hammer, delivered.hammer),
            (recorded.specimen, delivered.specimen),
        )
    )


def test_a_hit_comes_bit_by_bit_with_gap_and_overload(make_source):
    hit = list(strike(STEEL, 1, 1, fault="lost_block"))
    hit[1] = replace(hit[1], specimen=replace(hit[1].specimen, overloaded=True))
    source = make_source([PAPER_SETUP, *hit])
    assert isinstance(source, HammerlessSource)
    delivered = deliver(source, HitLabel(STEEL, 9, 1))
    assert len(delivered) == len(hit) == 4
    assert all(map(is_same, hit, delivered))
    assert [block.first_sample for block in delivered] == [0, 1000, 3000, 4000]


def test_a_source_that_does_not_count_comes_with_its_own_numbers(make_source):
    values = np.array([0.1, -1e-300, 2.0**-1074, np.pi])
    block = replace(strike(STEEL, 1, 1)[-1], first_sample=0)
    block = replace(
        block,
        hammer=replace(block.hammer, output=values, full_scale=0.0),
        specimen=replace(block.specimen, output=np.empty(0)),
    )
    (delivered,) = deliver(make_source([PAPER_SETUP, block]), HitLabel(STEEL))
    assert delivered.hammer.output.tobytes() == values.tobytes()
    assert delivered.specimen.output.size == 0


def test_a_hit_comes_by_sample_impact_and_attempt_else_the_next_of_its_sample(make_source):
    labels = [
        HitLabel(STEEL, 1, 1),
        HitLabel(BRASS, 2, 1),
        HitLabel(STEEL, 3, 2, 1),
        HitLabel(STEEL, 4, 2, 2),
        HitLabel(STEEL, 5, 3),
    ]
    recorded = [
        strike(label.sample, label.record, label.impact, label.attempt) for label in labels
    ]
    source = make_source([PAPER_SETUP, *(block for hit in recorded for block in hit)])
    asked = [
        HitLabel(STEEL, 1, 2, 2),
        HitLabel(STEEL, 2, 2, 3),
        HitLabel(STEEL, 3, 7, 1),
        HitLabel(BRASS, 4, 1),
    ]
    assert tell_hits(source, asked, recorded) == [labels[3], labels[0], labels[2], labels[1]]


def test_a_sample_without_further_hits_is_refused_until_the_next_set_up(make_source):
    recorded = [strike(STEEL, number, number) for number in (1, 2)]
    source = make_source([PAPER_SETUP, *(block for hit in recorded for block in hit)])
    for hit in recorded:
        source.check_sample(STEEL)
        deliver(source, hit[0].label)
    with pytest.raises(
        DeviceError, match=r"session.mcap holds no further hit of 'steel small': it has 2"
    ):
        source.check_sample(STEEL)
    with pytest.raises(DeviceError, match=r"no hit of 'copper': it has hits of steel small"):
        source.check_sample("copper")
    source.take_setup(PAPER_SETUP)
    source.check_sample(STEEL)


def test_a_hit_that_was_not_read_to_its_end_is_not_lost(make_source):
    recorded = [strike(STEEL, number, number) for number in (1, 2)]
    source = make_source([PAPER_SETUP, *(block for hit in recorded for block in hit)])
    source.arm()
    source.strike(HitLabel(STEEL, 1, 1), 0.0)
    assert is_same(recorded[0][0], source.read(0.0))
    source.disarm()
    asked = [HitLabel(STEEL, 2, 1, 2), HitLabel(STEEL, 3, 2)]
    assert tell_hits(source, asked, recorded) == [hit[0].label for hit in recorded]


def test_a_missed_trigger_is_missed_again(make_source):
    recorded = [
        strike(STEEL, 1, 1, fault="missed_trigger"),
        strike(STEEL, 2, 1, 2),
    ]
    source = make_source([PAPER_SETUP, *(block for hit in recorded for block in hit)])
    assert deliver(source, HitLabel(STEEL, 1, 1)) == []
    assert len(deliver(source, HitLabel(STEEL, 2, 1, 2))) == 5


def test_a_hit_whose_end_was_not_recorded_ends_where_the_recording_does(make_source):
    first, second = strike(STEEL, 1, 1), strike(STEEL, 2, 2)
    source = make_source([PAPER_SETUP, *first[:3], *second])
    delivered = deliver(source, HitLabel(STEEL, 1, 1))
    assert [block.last for block in delivered] == [False, False, True]
    assert len(deliver(source, HitLabel(STEEL, 2, 2))) == 5


def test_each_campaign_is_one_of_its_own(make_source):
    first, second = strike(STEEL, 1, 1), strike(BRASS, 1, 1)
    # A rig tells its set-up when it starts, too: no campaign comes of that.
    events = [PAPER_SETUP, PAPER_SETUP, *first, PAPER_SETUP, *second]
    make_source(events).check_sample(STEEL)
    source = make_source(events, campaign=2)
    source.check_sample(BRASS)
    with pytest.raises(DeviceError, match="no hit of 'steel small'"):
        source.check_sample(STEEL)
    with pytest.raises(ParameterError, match=r"campaign of \[source\] is 3: .* 2 or less"):
        make_source(events, campaign=3)


def test_the_hit_comes_when_the_hammer_has_swung_and_is_stamped_so(make_source):
    source = make_source([PAPER_SETUP, *strike(STEEL, 1, 1)])
    source.arm()
    swing = 0.2
    begin, begin_stamp = time.monotonic(), time.time_ns()
    threading.Timer(0.05, source.strike, (HitLabel(STEEL), swing)).start()
    block = source.read(20.0)
    assert time.monotonic() - begin >= swing + 0.05 - 0.001
    assert begin_stamp + 0.2e9 < block.stamp <= time.time_ns()
    later = source.read(0.0)
    assert later.stamp - block.stamp == 1000 / 2.5e6 * 1e9


def test_a_strike_that_is_not_waited_for_is_refused(make_source):
    source = make_source([PAPER_SETUP, *strike(STEEL, 1, 1)])
    with pytest.raises(DeviceError, match="not armed"):
        source.strike(HitLabel(STEEL), 0.0)


def test_hits_of_different_rates_cannot_come_from_one_source(make_source):
    other = [replace(block, sampling_rate=1e6) for block in strike(STEEL, 2, 2)]
    source = make_source([PAPER_SETUP, *strike(STEEL, 1, 1), *other])
    source.arm()
    with pytest.raises(DeviceError, match=r"1e\+06 Hz, the first hit at 2.5e\+06 Hz"):
        source.strike(HitLabel(STEEL, 2, 2), 0.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "line 3: there is no file"),
        (b"no recording", "line 3: .*is no MCAP recording"),
    ],
)
def test_a_recording_that_cannot_be_read_is_named_with_the_line(tmp_path, content, message):
    path = tmp_path / "session.mcap"
    if content is not None:
        path.write_bytes(content)
    text = f'[source]\ndriver = "recording"\nfile = "{path}"\n'
    table = parse_toml_table(text).take_table("source").without(*COMMON_KEYS[SOURCES])
    with pytest.raises(DeviceError, match=message):
        RecordingSource(table).configure(PLAN)


def test_a_recording_has_no_running_stream(make_source):
    source = make_source([PAPER_SETUP, *strike(STEEL, 1, 1)])
    with pytest.raises(ParameterError, match="must be 'triggered'"):
        source.configure(replace(PLAN, continuous=True))


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
        source.strike(HitLabel(STEEL, self._struck, self._struck), 0.0)


class TestRecordingSource(AccelerationSourceContract):
    """The contract, on a recording of the virtual rig."""

    @pytest.fixture
    def bench(self, tmp_path) -> Iterator[RecordingBench]:
        blocks = [block for number in range(1, 7) for block in strike(STEEL, number, number)]
        path = write_events(tmp_path / "session.mcap", [PAPER_SETUP, *blocks])
        with RecordingBench(path) as bench:
            yield bench
