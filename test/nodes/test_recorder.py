"""The recorder writes every message of every topic, and always leaves a sound file.

It publishes when a record is on the disk, what the recording lacks, and why it ends.
"""

import json
import threading
from array import array
from contextlib import suppress
from pathlib import Path

import mcap.reader
import numpy as np
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from impact_rig_msgs.msg import AccelerationBlock, StreamBlock
from mcap.exceptions import McapError
from mcap.records import Channel, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from impact_rig import __version__
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.recordings.contents import LONGEST_NOTE

COUNT = 20
POINTS = 1000
PARAMETERS = "impact_rig/parameters"
OWN_TOPICS = (
    interfaces.RECORDER_STATE,
    interfaces.RECORD_STORED,
    interfaces.OVERRULE_STORED,
)


def read_by_mcap_ros2(path: Path) -> dict[str, list]:
    """Return decoded messages by topic."""
    messages: dict[str, list] = {}
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file, decoder_factories=[DecoderFactory()])
        for item in reader.iter_decoded_messages():
            messages.setdefault(item.channel.topic, []).append(item.decoded_message)
    return messages


def read_by_rosbags(path: Path) -> dict[str, list]:
    """Return decoded messages by topic."""
    messages: dict[str, list] = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            messages.setdefault(connection.topic, []).append(
                reader.deserialize(data, connection.msgtype)
            )
    return messages


def read_records(path: Path) -> list[McapRecord]:
    """Return the records of a file, also while it grows."""
    found = []
    with path.open("rb") as stream, suppress(McapError):
        found.extend(StreamReader(stream, validate_crcs=True).records)
    return found


def count_whole_messages(path: Path, topic: str) -> int:
    """Return how many messages of a topic are in an unfinished file, by another library."""
    records = read_records(path)
    channels = {item.id for item in records if isinstance(item, Channel) and item.topic == topic}
    return sum(isinstance(item, Message) and item.channel_id in channels for item in records)


def read_metadata(path: Path, name: str) -> list[dict[str, str]]:
    """Return all metadata of one name, also while the file grows."""
    return [
        item.metadata
        for item in read_records(path)
        if isinstance(item, Metadata) and item.name == name
    ]


def make_blocks(record, count=3, *, without=()):
    """Return the blocks of a record, some of them missing."""
    blocks = []
    for i in set(range(count)) - set(without):
        block = AccelerationBlock(
            record=record, sample="brass", impact=record, attempt=1, first_sample=i * POINTS,
            sampling_rate=2.5e6, last=i == count - 1,
        )  # fmt: skip
        block.header.stamp.sec = 1000 * record + i
        block.hammer.scale = block.specimen.scale = 1.0
        block.hammer.counts = array("i", range(record, record + POINTS))
        block.specimen.counts = array("i", range(POINTS))
        blocks.append(block)
    return blocks


def connect(harness, topic=interfaces.ACCELERATION):
    """Return a publisher to which the recorder has subscribed."""
    publisher = harness.advertise(topic)
    harness.wait_until(lambda: publisher.get_subscription_count() > 0)
    return publisher


def publish(publisher, messages):
    for message in messages:
        publisher.publish(message)


def list_values(diagnostics):
    return [(item.key, item.value) for item in diagnostics.status[0].values]


def test_a_recorder_that_is_not_started_says_so_to_those_who_would_wait_for_it(harness):
    states = harness.listen(interfaces.RECORDER_STATE)
    harness.add(RecorderNode, autostart=False)
    (state,) = states.wait_for_count(1)
    assert not state.recording
    assert "not active" in state.message


def test_other_libraries_read_all_messages_of_all_topics(harness, recorder, tmp_path):
    # Latched before the recorder starts.
    harness.tell_setup()
    _, stored, node = recorder(include_topics="impact/trace, /comparison")
    blocks = connect(harness)
    before = harness.peer.get_clock().now().nanoseconds
    publish(blocks, [block for record in range(COUNT) for block in make_blocks(record, 1)])
    for topic in interfaces.RECORDED_TOPICS:
        if topic not in (interfaces.ACCELERATION, interfaces.SETUP, *OWN_TOPICS):
            sound = {"sampling_rate": 1e6} if topic is interfaces.COMPARISON else {}
            publisher = connect(harness, topic)
            publisher.publish(topic.type(**sound))
            assert publisher.wait_for_all_acked()
    stored.wait_for_count(COUNT)
    harness.wait_until(lambda: node._writer.count_messages("/recorder/stored") == COUNT)
    harness.wait_until(lambda: node._writer.count_messages("/setup") == 1)
    after = harness.peer.get_clock().now().nanoseconds
    harness.change_state("recorder", "deactivate")

    path = tmp_path / "session.mcap"
    names = {f"/{topic.name}" for topic in interfaces.RECORDED_TOPICS}
    for messages in (read_by_mcap_ros2(path), read_by_rosbags(path)):
        assert names <= set(messages)
        assert [item.record for item in messages["/acceleration"]] == list(range(COUNT))
        assert list(messages["/acceleration"][7].hammer.counts) == list(range(7, 7 + POINTS))
        own = {f"/{topic.name}" for topic in OWN_TOPICS}
        assert {len(messages[name]) for name in names - {"/acceleration"} - own} == {1}
        assert messages["/setup"][0].name == "paper"
        assert messages["/recorder/state"][0].recording
        assert [item.record for item in messages["/recorder/stored"]] == list(range(COUNT))
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file)
        for number, (_, _, item) in enumerate(reader.iter_messages(["/acceleration"])):
            # Times are those of the middleware.
            assert before <= item.publish_time <= item.log_time <= after
            assert item.sequence == number


def test_further_topics_below_the_namespace_are_discovered(harness, recorder, tmp_path):
    _, _, node = recorder(namespace="/hall", exclude_topics="/hall/imu")
    stream = harness.peer.create_publisher(StreamBlock, "/hall/acceleration/stream", 10)
    inside, outside, hidden, excluded = (
        harness.peer.create_publisher(String, name, 10)
        for name in ("/hall/notes", "/elsewhere/notes", "/hall/_hidden/notes", "/hall/imu")
    )
    best_effort = harness.peer.create_publisher(
        String, "/hall/temperature", QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    latched = harness.peer.create_publisher(
        String, "/hall/name", QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    latched.publish(String(data="bench 3"))
    for publisher in (inside, latched, best_effort):
        harness.wait_until(lambda publisher=publisher: publisher.get_subscription_count() > 0)
    inside.publish(String(data="hello"))
    # The running stream is left alone, unless it is asked for.
    computed = [
        harness.peer.create_publisher(topic.type, f"/hall/{topic.name}", topic.qos)
        for topic in interfaces.COMPUTED_TOPICS
    ]
    for publisher in (outside, hidden, excluded, stream, *computed):
        assert not publisher.get_subscription_count()
    for topic in ("/hall/notes", "/hall/name"):
        harness.wait_until(lambda topic=topic: node._writer.count_messages(topic) > 0)
    harness.change_state("/hall/recorder", "deactivate")

    path = tmp_path / "session.mcap"
    messages = read_by_rosbags(path)
    assert [item.data for item in messages["/hall/notes"]] == ["hello"]
    assert [item.data for item in messages["/hall/name"]] == ["bench 3"]
    with path.open("rb") as file:
        channels = mcap.reader.make_reader(file).get_summary().channels.values()
    metadata = {channel.topic: channel.metadata for channel in channels}
    assert {"/rosout", "/diagnostics", "/hall/temperature", "/hall/acceleration"} <= set(metadata)
    assert not {"/elsewhere/notes", "/hall/_hidden/notes"} & set(metadata)
    assert "best_effort" in metadata["/hall/temperature"]["offered_qos_profiles"]
    assert "transient_local" in metadata["/hall/name"]["offered_qos_profiles"]
    (info,) = harness.peer.get_publishers_info_by_topic("/hall/notes")
    assert metadata["/hall/notes"]["topic_type_hash"] == str(info.topic_type_hash)


def test_every_activation_gets_a_file_of_its_own_named_by_the_time_of_the_run(
    harness, recorder, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    states, *_ = recorder(output="")
    path = Path(states.messages[-1].uri)
    assert (path.parent.parent, path.name) == (tmp_path / "runs", "session.mcap")
    for number in (2, 3):
        harness.change_state("recorder", "deactivate", "activate")
        # In the second in which the first one began, or a later one.
        states.wait(lambda got, number=number: len({item.uri for item in got}) == number)
    assert path.is_file()


REFUSED = (
    ({"output": "/tmp/session"}, "output is '/tmp/session': the name must end in .mcap"),
    ({"attachments": "/absent.toml"}, "attachment /absent.toml cannot be read"),
    ({"output": "/proc/nowhere/session.mcap"}, "cannot be made"),
)


def test_what_cannot_be_recorded_is_refused_in_one_sentence(harness):
    for number, (parameters, told) in enumerate(REFUSED):
        node = harness.add(RecorderNode, namespace=f"/rig{number}", **parameters)
        assert not node.is_active
        assert told in node.fault


def test_software_notes_files_and_the_parameters_of_all_nodes_go_into_the_recording(
    harness, recorder, tmp_path
):
    path, rig_file = tmp_path / "session.mcap", tmp_path / "my, own rig.toml"
    rig_file.write_text("name = 'bench 3'", "utf-8")
    recorder(notes="bench 3, 21 °C", attachments=str(rig_file), compression="lz4")
    notes = connect(harness, interfaces.NOTE)
    notes.publish(String(data="the tip is loose"))
    assert notes.wait_for_all_acked()
    harness.add(HammerNode, swing_time=0.3)

    def find_swing_time():
        texts = [item["/hammer"] for item in read_metadata(path, PARAMETERS) if "/hammer" in item]
        return yaml.safe_load(texts[-1])["swing_time"] if texts else None

    harness.wait_until(lambda: find_swing_time() == 0.3)
    assert not harness.set_parameter("hammer", "swing_time", 0.4)
    harness.wait_until(lambda: find_swing_time() == 0.4)
    newest = read_metadata(path, PARAMETERS)[-1]
    assert yaml.safe_load(newest["/recorder"])["compression"] == "lz4"
    # The node of this test is no node of the rig.
    assert "/peer" not in newest
    harness.change_state("recorder", "deactivate")
    (found,) = read_metadata(path, "impact_rig")
    assert found["software_version"] == __version__
    assert json.loads(found["libraries"])["numpy"] == np.__version__
    assert found["notes"] == "bench 3, 21 °C"
    with path.open("rb") as stream:
        (attachment,) = mcap.reader.make_reader(stream).iter_attachments()
    assert (attachment.name, attachment.media_type) == (rig_file.name, "application/toml")
    assert attachment.data == rig_file.read_bytes()
    (note,) = read_by_rosbags(path)["/note"]
    assert note.data == "the tip is loose"


def test_every_record_is_on_the_disk_when_the_recorder_says_so_and_what_it_lacks_is_told(
    harness, recorder, tmp_path
):
    states, stored, _ = recorder()
    diagnostics = harness.listen(interfaces.DIAGNOSTICS)
    publisher = connect(harness)
    for record in (1, 2, 3):
        publish(publisher, make_blocks(record))
        found = stored.wait_for_count(record)[-1]
        assert count_whole_messages(tmp_path / "session.mcap", "/acceleration") == 3 * record
        assert (found.record, found.sample, found.impact, found.attempt) == (
            record, "brass", record, 1,
        )  # fmt: skip
        assert (found.blocks, found.gaps, found.missing_points) == (3, 0, 0)
        assert found.header.stamp.sec == 1000 * record + 2
    publish(publisher, [*make_blocks(4, 5, without={0, 3}), *make_blocks(5)])
    first, second = stored.wait_for_count(5)[3:]
    assert (first.blocks, first.gaps, first.missing_points) == (3, 2, 2 * POINTS)
    assert (second.blocks, second.gaps) == (3, 0)
    warned = states.wait(lambda messages: messages[-1].message.startswith("warning:"))[-1]
    assert warned.recording
    found = diagnostics.wait(lambda got: got[-1].status[0].level == DiagnosticStatus.WARN)[-1]
    assert "2 gaps, 2000 points are missing" in found.status[0].message
    assert ("gaps", "2") in list_values(found)


def test_messages_that_a_full_queue_dropped_are_counted(harness, recorder):
    depth = interfaces.ACCELERATION.qos.depth

    class Shallow(RecorderNode):
        queue_depth = depth

    states, stored, _ = recorder(Shallow)
    publisher = connect(harness)
    publish(publisher, make_blocks(1))
    stored.wait_for_count(1)
    standing, go_on = threading.Event(), threading.Event()

    def stand_still():
        standing.set()
        go_on.wait(20.0)

    busy = threading.Thread(target=lambda: harness.run(stand_still))
    busy.start()
    assert standing.wait(20.0)
    publish(publisher, make_blocks(2, 230))
    go_on.set()
    busy.join()
    found = stored.wait_for_count(2)[-1]
    assert (found.blocks, found.gaps, found.missing_points) == (depth, 1, (230 - depth) * POINTS)
    state = states.wait(lambda messages: messages[-1].messages_lost > 0)[-1]
    assert state.messages_lost == 230 - depth
    assert f"{230 - depth} messages on /acceleration did not get through" in state.message


def test_a_full_disk_ends_the_recording_cleanly_and_says_so(
    harness, recorder, tmp_path, monkeypatch
):
    states, stored, _ = recorder()
    diagnostics = harness.listen(interfaces.DIAGNOSTICS)
    publisher = connect(harness)
    publish(publisher, make_blocks(1))
    stored.wait_for_count(1)
    monkeypatch.setattr("impact_rig.recordings.new_file.DiskFile._measure_room", lambda _: 1000)
    # The writer asks for the room on the disk less often than for each message.
    for record in range(2, 100):
        publish(publisher, make_blocks(record, 100))
        harness.wait_until(
            lambda record=record: (
                len(stored.messages) >= record or not states.messages[-1].recording
            )
        )
        if not states.messages[-1].recording:
            break
    assert "full" in states.messages[-1].message
    diagnostics.wait(lambda got: got[-1].status[0].level == DiagnosticStatus.ERROR)
    path = tmp_path / "session.mcap"
    records = [block.record for block in read_by_rosbags(path)["/acceleration"]]
    whole = {record for record in records if records.count(record) in (3, 100)}
    assert {message.record for message in stored.messages} <= whole
    (health,) = read_metadata(path, "impact_rig/health")
    assert health["reason"] == "disk full"


def test_notes_are_bounded_in_number_and_length_and_who_sent_too_many_is_told(
    harness, recorder, tmp_path, monkeypatch, capfd
):
    monkeypatch.setattr("impact_rig.nodes.recorder.MOST_NOTES", 3)
    _, _, node = recorder()
    notes = connect(harness, interfaces.NOTE)
    lengths = [LONGEST_NOTE, LONGEST_NOTE + 1, 1, 2, 3]
    publish(notes, [String(data="x" * length) for length in lengths])
    harness.wait_until(lambda: node.intake.handled >= len(lengths))
    harness.run(node.close)
    found = [len(note.data) for note in read_by_rosbags(tmp_path / "session.mcap")["/note"]]
    assert found == [LONGEST_NOTE, 1, 2]
    assert capfd.readouterr().err.count("a note of /peer is left out") == 1


def make_stream(*starts):
    """Return blocks of the running stream that begin at given points."""
    blocks = [StreamBlock(first_sample=start, sampling_rate=2.5e6) for start in starts]
    for block in blocks:
        block.hammer.scale = block.specimen.scale = 1.0
        block.hammer.counts = block.specimen.counts = array("i", range(POINTS))
    return blocks


def test_the_running_stream_is_recorded_when_asked_for_and_its_gaps_are_counted(
    harness, recorder, tmp_path
):
    states, _, node = recorder(record_stream=True)
    starts = [0, POINTS, 4 * POINTS, 7 * POINTS]
    publish(connect(harness, interfaces.STREAM), make_stream(*starts))
    warned = states.wait(lambda messages: messages[-1].message.startswith("warning:"))[-1]
    assert "the stream has 2 gaps, 4000 points are missing" in warned.message
    harness.run(node.close)
    path = tmp_path / "session.mcap"
    stream = read_by_rosbags(path)["/acceleration/stream"]
    assert [block.first_sample for block in stream] == starts
    (health,) = read_metadata(path, "impact_rig/health")
    assert (health["stream_blocks"], health["stream_gaps"]) == ("4", "2")
    assert (health["stream_missing_points"], health["gaps"]) == ("4000", "0")
