"""A recording is read by other libraries, and safe once it is synced."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import mcap.reader
import mcap.stream_reader
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability

from impact_rig.configuration.parameters import PARAMETERS
from impact_rig.core.given.errors import FileError
from impact_rig.recordings.provenance import ATTACHMENT_LIMIT, read_attached_file
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import RecordingWriter

LATCHED = OfferedQos("reliable", "transient_local", "keep_last", 16)


@pytest.fixture(params=PARAMETERS["recorder"]["compression"].choices)
def recording(request, make_recording) -> Path:
    """Return a recording of 41 messages on three topics in several chunks."""
    maker = make_recording(compression=request.param, chunk_size=4000)
    maker.add_setup()
    for record in range(1, 21):
        maker.add_virtual_impact(record)
        maker.add_block(record)
    return maker.close()


def test_mcap_finds_a_sound_file(recording):
    with recording.open("rb") as file:
        records = list(mcap.stream_reader.StreamReader(file, validate_crcs=True).records)
    assert type(records[0]).__name__ == "Header"
    assert (records[0].profile, records[0].library) == ("ros2", "impact_rig")
    with recording.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        messages = list(reader.iter_messages())
    assert summary.statistics.message_count == len(messages) == 41
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) > 5
    assert sorted(summary.statistics.channel_message_counts.values()) == [1, 20, 20]
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)
    assert summary.statistics.message_start_time == times[0]
    assert summary.statistics.message_end_time == times[-1]
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}


def test_rosbags_decodes_every_message(recording):
    with AnyReader([recording]) as reader:
        messages = list(reader.messages())
        assert len(messages) == 41
        connection, _, data = messages[-1]
        block = reader.deserialize(data, connection.msgtype)
    assert connection.topic == "/acceleration"
    assert block.specimen.counts[:3].tolist() == [-20, -21, -22]


def test_quality_of_service_and_type_hash_stand_with_each_topic(tmp_path):
    path = tmp_path / "qos.mcap"
    definition = find_message_definition("std_msgs/msg/String")
    weak = OfferedQos("best_effort", history="unknown", depth=0, lifespan=10_000_000_250)
    with RecordingWriter(path) as writer:
        channel = writer.add_channel("/text", definition, (LATCHED, weak))
        writer.add_message(channel, b"\0\1\0\0\1\0\0\0\0", 5, 4)
    with AnyReader([path]) as reader:
        offers = reader.connections[0].ext.offered_qos_profiles
    assert [(it.reliability, it.durability, it.history, it.depth) for it in offers] == [
        (QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, QosHistory.KEEP_LAST, 16),
        (QosReliability.BEST_EFFORT, QosDurability.VOLATILE, QosHistory.UNKNOWN, 0),
    ]
    assert (offers[1].lifespan.sec, offers[1].lifespan.nsec) == (10, 250)


def test_topics_without_messages_and_empty_recordings_are_sound(tmp_path):
    definition = find_message_definition("std_msgs/msg/String")
    with RecordingWriter(tmp_path / "silent.mcap") as writer:
        writer.add_channel("/text", definition, ())
    with RecordingWriter(tmp_path / "empty.mcap"):
        pass
    for name, topics in (("silent.mcap", ["/text"]), ("empty.mcap", [])):
        with (tmp_path / name).open("rb") as file:
            summary = mcap.reader.make_reader(file).get_summary()
            assert [channel.topic for channel in summary.channels.values()] == topics
            assert summary.statistics.message_count == 0
            assert all(not it.metadata["offered_qos_profiles"] for it in summary.channels.values())


@pytest.mark.skipif(shutil.which("rerun") is None, reason="the Rerun viewer is not installed")
def test_rerun_finds_nothing_wrong_with_it(make_recording):
    recording = make_recording()
    add_hits(recording, 1, 2, 3)
    command = ["rerun", "mcap", "check", str(recording.close())]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    findings = [line.split() for line in done.stdout.splitlines() if "/text" in line]
    assert findings
    assert all((words[0], words[-1]) == ("ok", "—") for words in findings), done.stdout


KILLED = """
import os, signal
from pathlib import Path
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import RecordingWriter
writer = RecordingWriter(Path({output!r}), compression="none")
channel = writer.add_channel("/text", MessageDefinition("std_msgs/msg/String", "string data"), ())
for number in range(4):
    writer.add_message(channel, b"%d" % number * 3000, number, number)
    if number < 3:
        writer.sync()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_after_kill_9_everything_synced_is_in_the_file(tmp_path):
    path = tmp_path / "session.mcap"
    script = KILLED.format(output=str(path))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    found = [message.data for message in Scan(path).read_messages()]
    assert found == [b"%d" % number * 3000 for number in range(3)]


def add_hits(recording, *numbers):
    """Add texts of 3 kB."""
    for number in numbers:
        recording.add("/text", "std_msgs/msg/String", {"data": f"{number} " + 3000 * "x"})


def test_a_sync_returns_when_the_disk_has_the_hit(make_recording, monkeypatch):
    recording = make_recording(compression="none")
    sizes = []
    monkeypatch.setattr(os, "fdatasync", lambda file: sizes.append(os.fstat(file).st_size))
    add_hits(recording, 1)
    recording.writer.flush()
    assert sizes == []
    add_hits(recording, 2)
    recording.writer.sync()
    assert sizes == [recording.writer.size]
    assert 2 * 3000 < sizes[0] == recording.path.stat().st_size


def test_an_attachment_that_is_too_large_is_refused(tmp_path):
    with (tmp_path / "photo.png").open("wb") as file:
        file.truncate(ATTACHMENT_LIMIT + 1)
    with pytest.raises(FileError, match=r"photo\.png has 16777217 byte: it must not have more"):
        read_attached_file(tmp_path / "photo.png")


def test_an_existing_file_is_never_overwritten(tmp_path):
    (tmp_path / "session.mcap").write_bytes(b"precious")
    with pytest.raises(FileError, match=r"session\.mcap exists already"):
        RecordingWriter(tmp_path / "session.mcap")
    assert (tmp_path / "session.mcap").read_bytes() == b"precious"
