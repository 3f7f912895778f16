"""What the writer writes is read by three other libraries, and survives a failing disk."""

import os
import random
import subprocess
import sys
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import mcap.reader
import mcap.stream_reader
import pytest
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.interfaces.message_definitions import (
    MessageDefinition,
    find_message_definition,
)
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.writing.chunk_builder import COMPRESSIONS
from impact_rig.recording.writing.disk_file import ROOM_FOR_ENDING
from impact_rig.recording.writing.mcap_writer import McapWriter

LATCHED = OfferedQos("reliable", "transient_local", "keep_last", 16)


@pytest.fixture(params=COMPRESSIONS)
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


def test_mcap_seeks_by_topic_and_time(recording):
    with recording.open("rb") as file:
        reader = mcap.reader.make_reader(file)
        blocks = [message for _, _, message in reader.iter_messages(topics=["/acceleration"])]
        late = reader.iter_messages(topics=["/acceleration"], starting_at=blocks[15].log_time)
        assert [message.sequence for message in blocks] == list(range(20))
        assert [message.sequence for _, _, message in late] == list(range(15, 20))
        assert all(message.publish_time == message.log_time - 1000 for message in blocks)


def test_mcap_ros2_decodes_every_message(recording):
    with recording.open("rb") as file:
        reader = mcap.reader.make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = list(reader.iter_decoded_messages())
    assert len(decoded) == 41
    setup = decoded[0].decoded_message
    assert (setup.hammer_mass, [sample.name for sample in setup.samples]) == (
        0.3,
        ["steel, large", "brass"],
    )
    block = decoded[-1].decoded_message
    assert (block.record, list(block.hammer.counts[:3])) == (20, [20, 21, 22])


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
    with McapWriter(path) as writer:
        channel = writer.add_channel("/text", definition, (LATCHED, OfferedQos()))
        writer.add_message(channel, b"\0\1\0\0\1\0\0\0\0", 5, 4)
    with AnyReader([path]) as reader:
        offers = reader.connections[0].ext.offered_qos_profiles
    assert [(offer.durability, offer.depth) for offer in offers] == [
        (QosDurability.TRANSIENT_LOCAL, 16),
        (QosDurability.VOLATILE, 10),
    ]
    assert {offer.reliability for offer in offers} == {QosReliability.RELIABLE}
    assert {offer.history for offer in offers} == {QosHistory.KEEP_LAST}


def test_topics_without_messages_and_empty_recordings_are_sound(tmp_path):
    definition = find_message_definition("std_msgs/msg/String")
    with McapWriter(tmp_path / "silent.mcap") as writer:
        writer.add_channel("/text", definition, ())
    with McapWriter(tmp_path / "empty.mcap"):
        pass
    for name, topics in (("silent.mcap", ["/text"]), ("empty.mcap", [])):
        with (tmp_path / name).open("rb") as file:
            summary = mcap.reader.make_reader(file).get_summary()
            assert [channel.topic for channel in summary.channels.values()] == topics
            assert summary.statistics.message_count == 0


def test_two_versions_of_a_type_keep_their_own_schemas(tmp_path):
    old = MessageDefinition("rig_msgs/msg/Note", "string data\n")
    new = MessageDefinition("rig_msgs/msg/Note", "string data\nuint8 level\n")
    with McapWriter(tmp_path / "both.mcap") as writer:
        for topic, definition in (("/old", old), ("/new", new), ("/more", old)):
            writer.add_channel(topic, definition, ())
    with (tmp_path / "both.mcap").open("rb") as file:
        summary = mcap.reader.make_reader(file).get_summary()
    texts = {
        item.topic: summary.schemas[item.schema_id].data.decode()
        for item in summary.channels.values()
    }
    assert texts == {"/old": old.text, "/new": new.text, "/more": old.text}
    assert len(summary.schemas) == 2


def test_the_free_space_shrinks_by_what_waits_to_be_written(make_recording, monkeypatch):
    free = SimpleNamespace(f_bavail=ROOM_FOR_ENDING + 1_000_000, f_frsize=1)
    monkeypatch.setattr(os, "fstatvfs", lambda descriptor: free)
    maker = make_recording(keep_free=100_000)
    before = maker.writer.free_space
    assert 899_000 < before <= 900_000
    data = maker.add("/text", "std_msgs/msg/String", {"data": "x" * 1000})
    assert 0 <= before - maker.writer.free_space - len(data) < 200
    maker.close()
    assert maker.writer.free_space == 0


def test_an_existing_file_is_never_overwritten(tmp_path):
    path = tmp_path / "evidence.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(FileError, match=r"evidence\.mcap exists already"):
        McapWriter(path)
    assert path.read_bytes() == b"precious"


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileError, match="No such file or directory"):
        McapWriter(tmp_path / "nowhere" / "session.mcap")


@pytest.mark.parametrize(
    ("options", "told"),
    [({"compression": "gzip"}, "zstd, lz4, none"), ({"chunk_size": 0}, "must be positive")],
)
def test_impossible_options_leave_no_file_behind(tmp_path, options, told):
    with pytest.raises(ParameterError, match=told):
        McapWriter(tmp_path / "session.mcap", **options)
    assert list(tmp_path.glob("*.mcap")) == []


def test_the_counters_tell_what_was_written(make_recording):
    maker = make_recording()
    maker.add_setup()
    assert maker.writer.messages == 1
    maker.add_block(1)
    maker.close()
    assert (maker.writer.messages, maker.writer.size) == (2, maker.path.stat().st_size)
    assert maker.writer.closed


def test_what_was_flushed_is_read_while_the_file_is_still_open(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1)
    before = maker.writer.size
    maker.writer.flush()
    maker.writer.flush()
    assert maker.writer.size > before
    maker.add_block(2)
    messages = list(McapFile(maker.path).read_messages())
    assert [message.channel.topic for message in messages] == ["/setup", "/acceleration"]


MANY = 1000


def add_many_blocks(maker) -> None:
    for record in range(MANY):
        maker.add_block(record)


def test_a_disk_that_fills_up_is_left_in_time_for_a_sound_end(make_recording, monkeypatch):
    maker = make_recording(compression="none", chunk_size=3000)

    def tell_free_space(descriptor: int) -> SimpleNamespace:
        used = os.fstat(descriptor).st_size
        return SimpleNamespace(f_bavail=ROOM_FOR_ENDING + 25_000 - used, f_frsize=1)

    monkeypatch.setattr(os, "fstatvfs", tell_free_space)
    with pytest.raises(FileError, match=r"session\.mcap cannot be written: No space left"):
        add_many_blocks(maker)
    maker.close()
    with maker.path.open("rb") as file:
        messages = list(mcap.reader.make_reader(file, validate_crcs=True).iter_messages())
    assert 10 < len(messages) < MANY
    assert maker.writer.messages == len(messages)


def test_a_disk_that_fails_without_warning_keeps_all_finished_chunks(tmp_path):
    """A file-size limit of the process stands for the quota; its child meets it for real."""
    path = tmp_path / "session.mcap"
    script = f"""
import resource, signal
from pathlib import Path
from impact_rig.core.errors import FileError
from impact_rig.recording.writing.mcap_writer import McapWriter
from impact_rig.recording.interfaces.message_definitions import find_message_definition
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (25_000, 25_000))
writer = McapWriter(Path({str(path)!r}), compression="none", chunk_size=3000)
channel = writer.add_channel("/text", find_message_definition("std_msgs/msg/String"), ())
try:
    for number in range(1000):
        writer.add_message(channel, bytes(300), number, number)
except FileError as error:
    print(error)
writer.close()
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "session.mcap cannot be written: File too large" in done.stdout
    assert done.stderr == ""
    file = McapFile(path)
    assert not file.is_complete
    times = [message.log_time for message in file.read_messages()]
    assert times == list(range(len(times)))
    assert len(times) > 50


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_messages_of_any_size_and_time_are_found_by_their_time(tmp_path, compression):
    generator = random.Random(1)
    messages = [
        (channel, moment, generator.randbytes(generator.choice([0, 1, 40, 3000])))
        for moment in generator.sample(range(10**6), 300)
        for channel in [generator.randint(1, 3)]
    ]
    definition = find_message_definition("std_msgs/msg/String")
    path = tmp_path / "session.mcap"
    with McapWriter(path, compression=compression, chunk_size=2000) as writer:
        for number in (1, 2, 3):
            assert writer.add_channel(f"/{number}", definition, ()) == number
        for channel, moment, data in messages:
            writer.add_message(channel, data, moment, moment + 5)
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        items = [item for *_, item in reader.iter_messages()]
        some = reader.iter_messages(["/2"], starting_at=200_000, ending_before=700_000)
        part = [item.log_time for *_, item in some]
        statistics = reader.get_summary().statistics
    found = [(item.channel_id, item.log_time, item.data) for item in items]
    assert found == sorted(messages, key=lambda item: item[1])
    assert part == sorted(
        moment for channel, moment, _ in messages if channel == 2 and 200_000 <= moment < 700_000
    )
    times = [moment for _, moment, _ in messages]
    assert (statistics.message_start_time, statistics.message_end_time) == (min(times), max(times))


HITS = 500
TOPICS = 12
"""In the chunk of a hit, as a rig has them."""


def test_ten_thousand_hits_would_take_little_memory(tmp_path):
    """Each hit is a chunk; its index is kept to the end: 12 topics of 10 byte, and 80 byte."""
    definition = find_message_definition("std_msgs/msg/String")
    with McapWriter(tmp_path / "long.mcap", compression="none") as writer:
        channels = [writer.add_channel(f"/{number}", definition, ()) for number in range(TOPICS)]

        def measure_growth() -> float:
            """Return the memory that some hits leave behind, for each of them [byte]."""
            before = tracemalloc.get_traced_memory()[0]
            for number in range(HITS):
                for channel in channels:
                    writer.add_message(channel, bytes(300), number, number)
                writer.flush()
            return (tracemalloc.get_traced_memory()[0] - before) / HITS

        tracemalloc.start()
        try:
            measure_growth()
            assert measure_growth() < 300.0
        finally:
            tracemalloc.stop()
