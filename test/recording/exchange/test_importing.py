"""Measured files become a recording that other people's readers take for one of ROS 2."""

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path

import nptdms
import numpy as np
import pytest

from impact_rig.core.errors import FileError, SignalError
from impact_rig.core.setup.channel_plan import ChannelPlan, ChannelUse
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.recording.exchange.importing import (
    check_series,
    choose_window,
    read_hit,
    write_imported,
)
from impact_rig.recording.reading.mcap_reader import read_recording

REAL_HITS = sorted((Path(__file__).parents[2] / "data" / "pyfrf_hammer").glob("*.npy"))
SETTINGS = AnalysisSettings(cutoff_frequency=0.0)
PLAN = ChannelPlan(hammer=ChannelUse(unit="N"), specimen=ChannelUse(unit="g"))


def read_all(paths):
    return [
        read_hit(path, HitLabel("beam", number, number), PLAN, 0.5)
        for number, path in enumerate(paths, 1)
    ]


def make_setup(hits):
    return RigSetup(
        SampleSet((Sample("beam", math.nan),), ""), 0.5, 0.1, choose_window(SETTINGS, hits)
    )


@pytest.fixture
def imported(tmp_path):
    """Return a recording of the real hits."""
    hits = read_all(REAL_HITS)
    write_imported(tmp_path / "hits.mcap", make_setup(hits), hits)
    return tmp_path / "hits.mcap"


def test_every_number_of_the_files_comes_back_with_its_calibration(imported):
    events = list(read_recording(imported).events())
    blocks = [event for event in events if isinstance(event, Block)]
    assert isinstance(events[0], RigSetup)
    for number, path in enumerate(REAL_HITS, 1):
        _, force, acceleration = np.load(path)
        parts = [block for block in blocks if block.label == HitLabel("beam", number, number)]
        assert np.concatenate([part.hammer.output for part in parts]).tobytes() == force.tobytes()
        specimen = np.concatenate([part.specimen.output for part in parts])
        assert specimen.tobytes() == acceleration.tobytes()
        assert (parts[0].hammer.scale, parts[0].specimen.scale) == (2.0, 9.80665)
        assert [part.last for part in parts] == [False] * (len(parts) - 1) + [True]


def test_long_files_are_split_into_blocks_that_join_without_a_gap(tmp_path):
    rows = np.random.default_rng(1).normal(size=25_000)
    np.save(tmp_path / "long.npy", rows)
    plan = ChannelPlan(hammer=ChannelUse(unit="g"), sampling_rate=1e6)
    hit = read_hit(tmp_path / "long.npy", HitLabel("beam"), plan)
    write_imported(tmp_path / "long.mcap", make_setup([hit]), [hit])
    _, *blocks = read_recording(tmp_path / "long.mcap").events()
    assert [block.first_sample for block in blocks] == [0, 10_000, 20_000]
    assert [block.stamp - blocks[0].stamp for block in blocks] == [0, 10_000_000, 20_000_000]
    (record,) = [
        record
        for detector in [ImpactDetector(choose_window(SETTINGS, [hit]))]
        for block in blocks
        for record in detector.feed(block)
    ]
    assert record.flaws == ()
    assert record.hammer.acceleration.size == 25_000


def test_rosbags_reads_it(imported):
    from rosbags.highlevel import AnyReader

    with AnyReader([imported]) as reader:
        messages = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/acceleration"
        ]
    for path, message in zip(REAL_HITS, messages, strict=True):
        assert np.array_equal(message.hammer.values, np.load(path)[1])
        assert message.last


def test_mcap_ros2_support_reads_it(imported):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with imported.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [
            (channel.topic, decoded, message.log_time)
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]
        header = reader.get_header()
        summary = reader.get_summary()
    assert header.profile == "ros2"
    assert [topic for topic, _, _ in messages] == ["/setup"] + ["/acceleration"] * len(REAL_HITS)
    assert [time for *_, time in messages] == sorted(time for *_, time in messages)
    force = np.load(REAL_HITS[0])[1]
    assert np.array_equal(messages[1][1].hammer.values, force)
    qos = {
        channel.topic: channel.metadata["offered_qos_profiles"]
        for channel in summary.channels.values()
    }
    assert "durability: transient_local" in qos["/setup"]
    assert "durability: volatile" in qos["/acceleration"]


def test_the_recording_tells_which_files_it_was_made_of(imported):
    from mcap.reader import make_reader

    with imported.open("rb") as file:
        records = {item.name: item.metadata for item in make_reader(file).iter_metadata()}
    assert records["impact_rig"]["software_version"]
    for number, path in enumerate(REAL_HITS, 1):
        origin = json.loads(records["impact_rig/import"][str(number)])
        assert origin == {
            "file": path.name,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "channels": ["column 2", "column 3"],
        }


def test_the_same_files_make_the_same_recording(imported, tmp_path):
    hits = read_all(REAL_HITS)
    write_imported(tmp_path / "again.mcap", make_setup(hits), hits)
    assert (tmp_path / "again.mcap").read_bytes() == imported.read_bytes()


def test_nothing_is_overwritten_and_no_part_is_left(imported, tmp_path):
    before = imported.read_bytes()
    hits = read_all(REAL_HITS)
    with pytest.raises(FileError, match=r"hits\.mcap exists already"):
        write_imported(imported, make_setup(hits), hits)
    assert imported.read_bytes() == before
    gone = replace(hits[0], path=tmp_path / "gone.npy")
    with pytest.raises(FileError, match=r"gone\.npy cannot be read"):
        write_imported(tmp_path / "new.mcap", make_setup(hits), [gone])
    assert not list(tmp_path.glob("*new.mcap*"))


@pytest.mark.parametrize("place", [3, 500, 990])
def test_the_whole_file_is_the_record_wherever_its_pulse_lies(tmp_path, place):
    pulse = np.zeros(1000)
    pulse[place : place + 5] = (20.0, 60.0, 100.0, 60.0, 20.0)
    np.save(tmp_path / "hit.npy", pulse + 0.01 * np.random.default_rng(1).normal(size=1000))
    plan = ChannelPlan(sampling_rate=1e6)
    hit = read_hit(tmp_path / "hit.npy", HitLabel("beam"), plan)
    early = read_hit(REAL_HITS[0], HitLabel("beam", 2), ChannelPlan())
    settings = choose_window(SETTINGS, [hit, early])
    (record,) = ImpactDetector(settings).feed(hit.block)
    assert record.hammer.acceleration.size == 1000
    assert record.pulse_index == pytest.approx(place, abs=1)


FIRST = 1_683_293_990_000_000_000
"""The fifth of May 2023, 13:39:50 UTC."""
SECOND = 1_000_000_000
LENGTH = SECOND // 100
"""Of a hit in the files below [ns]."""


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ([None, None], [SECOND, 2 * SECOND + LENGTH]),
        ([FIRST, FIRST + 3600 * SECOND], [FIRST, FIRST + 3600 * SECOND]),
        ([FIRST, FIRST + LENGTH], [FIRST, FIRST + LENGTH]),
        ([FIRST, FIRST], [FIRST, FIRST + LENGTH + SECOND]),
        ([FIRST, FIRST - SECOND], [FIRST, FIRST + LENGTH + SECOND]),
        ([FIRST, None, FIRST + 5 * SECOND], [FIRST, FIRST + LENGTH + SECOND, FIRST + 5 * SECOND]),
        ([None, FIRST], [FIRST, FIRST + LENGTH + SECOND]),
    ],
    ids=["none", "dates", "close", "same", "back", "one without", "first without"],
)
def test_a_hit_was_when_its_file_says_unless_times_would_not_grow(tmp_path, stated, expected):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    hits = []
    for number, time in enumerate(stated, 1):
        path = tmp_path / f"{number}.tdms"
        words = {"wf_increment": 1e-6, "unit_string": "g"}
        if time is not None:
            words["wf_start_time"] = np.datetime64(time, "ns")
        values = np.random.default_rng(number).normal(size=10_000)
        with nptdms.TdmsWriter(str(path)) as writer:
            writer.write_segment([nptdms.ChannelObject("all", "hammer", values, words)])
        hits.append(read_hit(path, HitLabel("beam", number, number), ChannelPlan()))
    write_imported(tmp_path / "hits.mcap", make_setup(hits), hits)

    with (tmp_path / "hits.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages(log_time_order=False))
        origins = next(item for item in reader.iter_metadata() if item.name.endswith("import"))
    stamps = [
        decoded.header.stamp.sec * SECOND + decoded.header.stamp.nanosec
        for *_, decoded in messages
    ]
    assert stamps == [expected[0], *expected]  # the set-up's before the hits'
    log_times = [message.log_time for _, _, message, _ in messages]
    assert log_times == [expected[0], *(stamp + LENGTH for stamp in expected)]
    told = [json.loads(origins.metadata[str(number)]) for number in range(1, len(stated) + 1)]
    assert [origin.get("recorded_at") for origin in told] == stated


def test_hits_that_cannot_be_averaged_are_named(tmp_path):
    rows = np.random.default_rng(1).normal(size=(2, 100))
    np.save(tmp_path / "fast.npy", rows)
    np.save(tmp_path / "alone.npy", rows[0])
    first, other = (
        read_hit(tmp_path / "fast.npy", HitLabel("beam"), ChannelPlan(sampling_rate=rate))
        for rate in (1e6, 2e6)
    )
    alone = read_hit(tmp_path / "alone.npy", HitLabel("beam"), ChannelPlan(sampling_rate=1e6))
    check_series([], first)
    check_series([first], first)
    with pytest.raises(SignalError, match=r"fast\.npy is sampled at 2e\+06 Hz and .* 1e\+06 Hz"):
        check_series([first], other)
    with pytest.raises(SignalError, match=r"fast\.npy has a channel of the sample, .*alone\.npy"):
        check_series([first], alone)
