"""The recorder writes every message of every topic, and always leaves a sound file.

It tells where it comes from: versions, notes, parameters, attached files.
"""

import json
import signal
from array import array
from contextlib import suppress
from pathlib import Path

import mcap.reader
import numpy as np
import yaml
from impact_rig_msgs.msg import AccelerationBlock
from mcap.exceptions import McapError
from mcap.records import Metadata
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from impact_rig import __version__
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.recordings.scan import Scan

from ..recordings.text_recordings import read_by_stream

COUNT = 20
PARAMETERS = "impact_rig/parameters"
OWN_TOPICS = (interfaces.RECORDER_STATE, interfaces.RECORD_STORED)
"""What the recorder itself has to say."""


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


def make_block(record: int, points: int = 5000) -> AccelerationBlock:
    block = AccelerationBlock(record=record, sample="brass", sampling_rate=2.5e6, last=True)
    block.hammer.scale = block.specimen.scale = 1.0
    block.hammer.counts = array("i", range(record, record + points))
    block.specimen.counts = array("i", range(points))
    return block


def test_it_calls_itself_recording_once_the_required_topics_are_connected(harness, tmp_path):
    states = harness.listen(interfaces.RECORDER_STATE)
    harness.add(
        RecorderNode,
        output=str(tmp_path / "session.mcap"),
        required_topics="acceleration, impact",
    )
    state = states.wait(lambda got: "acceleration, impact" in got[-1].message)[-1]
    assert not state.recording
    harness.advertise(interfaces.ACCELERATION)
    harness.advertise(interfaces.IMPACT)
    states.wait(lambda got: got[-1].recording)


def publish(harness, publisher, *messages, acknowledged: bool = True) -> None:
    """Publish once the recorder is connected; return when everything has reached it.

    Between processes, an acknowledgement may take the 3 s of a heartbeat.
    """
    harness.wait_until(lambda: publisher.get_subscription_count() > 0)
    for message in messages:
        publisher.publish(message)
    assert not acknowledged or publisher.wait_for_all_acked()


def count_whole_messages(path: Path, topic: str) -> int:
    """Return how many messages of a topic are in an unfinished file, by another library."""
    return sum(name == topic for name, _ in read_by_stream(path))


def read_metadata(path: Path, name: str) -> list[dict[str, str]]:
    """Return all metadata of one name, also while the file grows."""
    found = []
    with path.open("rb") as stream, suppress(McapError):
        found.extend(
            record.metadata
            for record in StreamReader(stream).records
            if isinstance(record, Metadata) and record.name == name
        )
    return found


def test_other_libraries_read_all_messages_of_all_topics(harness, recorder, tmp_path):
    # Latched before the recorder starts.
    harness.tell_setup()
    _, _, node = recorder()
    blocks = [make_block(record) for record in range(COUNT)]
    publish(harness, harness.advertise(interfaces.ACCELERATION), *blocks)
    for topic in interfaces.RECORDED_TOPICS:
        if topic not in (interfaces.ACCELERATION, interfaces.SETUP, *OWN_TOPICS):
            sound = {"sampling_rate": 1e6} if topic is interfaces.COMPARISON else {}
            publish(harness, harness.advertise(topic), topic.type(**sound))
    harness.wait_until(lambda: node.count_messages("/recorder/stored") == COUNT)
    harness.wait_until(lambda: node.count_messages("/setup") == 1)
    harness.change_state("recorder", "deactivate")

    path = tmp_path / "session.mcap"
    names = {f"/{topic.name}" for topic in interfaces.RECORDED_TOPICS}
    for messages in (read_by_mcap_ros2(path), read_by_rosbags(path)):
        assert names <= set(messages)
        assert [item.record for item in messages["/acceleration"]] == list(range(COUNT))
        assert list(messages["/acceleration"][7].hammer.counts) == list(range(7, 5007))
        own = {f"/{topic.name}" for topic in OWN_TOPICS}
        assert {len(messages[name]) for name in names - {"/acceleration"} - own} == {1}
        assert messages["/setup"][0].name == "paper"
        assert messages["/recorder/state"][0].recording
        assert [item.record for item in messages["/recorder/stored"]] == list(range(COUNT))


def test_further_topics_below_the_namespace_are_discovered(harness, recorder, tmp_path):
    _, _, node = recorder(namespace="/hall")
    inside, outside, hidden = (
        harness.peer.create_publisher(String, name, 10)
        for name in ("/hall/notes", "/elsewhere/notes", "/hall/_hidden/notes")
    )
    best_effort = harness.peer.create_publisher(
        String, "/hall/temperature", QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    latched = harness.peer.create_publisher(
        String, "/hall/name", QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    latched.publish(String(data="bench 3"))
    publish(harness, inside, String(data="hello"))
    publish(harness, latched)
    harness.wait_until(lambda: best_effort.get_subscription_count() > 0)
    harness.peer.get_logger().info("to be found in the recording")
    assert outside.get_subscription_count() == hidden.get_subscription_count() == 0
    for topic in ("/hall/notes", "/hall/name", "/rosout"):
        harness.wait_until(lambda topic=topic: node.count_messages(topic) > 0)
    harness.change_state("/hall/recorder", "deactivate")

    path = tmp_path / "session.mcap"
    messages = read_by_rosbags(path)
    assert [item.data for item in messages["/hall/notes"]] == ["hello"]
    assert [item.data for item in messages["/hall/name"]] == ["bench 3"]
    assert messages["/hall/recorder/state"][0].recording
    with path.open("rb") as file:
        channels = mcap.reader.make_reader(file).get_summary().channels.values()
    metadata = {channel.topic: channel.metadata for channel in channels}
    assert {"/rosout", "/diagnostics", "/hall/temperature", "/hall/acceleration"} <= set(metadata)
    assert not {"/elsewhere/notes", "/hall/_hidden/notes"} & set(metadata)
    assert "best_effort" in metadata["/hall/temperature"]["offered_qos_profiles"]
    assert "transient_local" in metadata["/hall/name"]["offered_qos_profiles"]
    (info,) = harness.peer.get_publishers_info_by_topic("/hall/notes")
    assert metadata["/hall/notes"]["topic_type_hash"] == str(info.topic_type_hash)


def test_times_are_those_of_the_middleware(harness, recorder, tmp_path):
    recorder()
    publisher = harness.advertise(interfaces.ACCELERATION)
    before = harness.peer.get_clock().now().nanoseconds
    publish(harness, publisher, make_block(1), make_block(2))
    after = harness.peer.get_clock().now().nanoseconds
    harness.change_state("recorder", "deactivate")
    with (tmp_path / "session.mcap").open("rb") as file:
        messages = [
            item for *_, item in mcap.reader.make_reader(file).iter_messages(["/acceleration"])
        ]
    for item in messages:
        assert before <= item.publish_time <= item.log_time <= after
    assert [item.sequence for item in messages] == [0, 1]


def test_every_activation_gets_a_file_of_its_own(harness, recorder, tmp_path):
    states, *_ = recorder()
    harness.change_state("recorder", "deactivate")
    states.wait(lambda got: got[-1].message == "closed")
    path = tmp_path / "session.mcap"
    content = path.read_bytes()
    harness.change_state("recorder", "activate")
    states.wait(lambda got: got[-1].uri == str(path.with_name("session-2.mcap")))
    assert path.read_bytes() == content


def test_without_a_name_the_file_gets_the_time_of_the_run(
    harness, recorder, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    states, *_ = recorder(output="")
    path = Path(states.messages[-1].uri)
    assert path.is_file()
    assert path.parent.parent == tmp_path / "runs"
    assert path.name == "session.mcap"


REFUSED = (
    ({"output": "/tmp/session"}, "output is '/tmp/session': the name must end in .mcap"),
    ({"attachments": "/absent.toml"}, "attachment /absent.toml cannot be read"),
    ({"output": "/proc/nowhere/session.mcap"}, "cannot be made"),
    ({"output": "/dev/null/session.mcap"}, "cannot be made"),
)


def test_what_cannot_be_recorded_is_refused_in_one_sentence(harness):
    for number, (parameters, told) in enumerate(REFUSED):
        node = harness.add(RecorderNode, namespace=f"/rig{number}", **parameters)
        assert not node.is_active
        assert told in node.fault


def test_a_signal_leaves_a_sound_recording(harness, start_process, tmp_path):
    states = harness.listen(interfaces.RECORDER_STATE)
    path = tmp_path / "session.mcap"
    process = start_process("recorder", output=str(path), required_topics="''")
    states.wait(lambda got: got[-1].recording)
    blocks = [make_block(record) for record in range(COUNT)]
    publish(harness, harness.advertise(interfaces.ACCELERATION), *blocks, acknowledged=False)
    harness.wait_until(lambda: count_whole_messages(path, "/acceleration") == COUNT)
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 0
    states.wait(lambda got: got[-1].message == "closed")
    for read in (read_by_rosbags, read_by_mcap_ros2):
        assert [item.record for item in read(path)["/acceleration"]] == list(range(COUNT))
    assert not Scan(path).warnings
    assert "Traceback" not in process.output


def test_software_and_notes_go_into_the_file(harness, recorder, tmp_path):
    recorder(notes="bench 3, 21 °C")
    harness.change_state("recorder", "deactivate")
    (found,) = read_metadata(tmp_path / "session.mcap", "impact_rig")
    assert found["software_version"] == __version__
    assert json.loads(found["libraries"])["numpy"] == np.__version__
    assert found["notes"] == "bench 3, 21 °C"


def test_the_parameters_of_all_nodes_go_into_the_file_and_again_when_they_change(
    harness, recorder, tmp_path
):
    path = tmp_path / "session.mcap"
    recorder(compression="lz4")
    harness.add(HammerNode, swing_time=0.3)

    def find_swing_time():
        texts = [item["/hammer"] for item in read_metadata(path, PARAMETERS) if "/hammer" in item]
        return yaml.safe_load(texts[-1])["swing_time"] if texts else None

    harness.wait_until(lambda: find_swing_time() == 0.3)
    assert not harness.set_parameter("hammer", "swing_time", 0.4)
    harness.wait_until(lambda: find_swing_time() == 0.4)
    newest = read_metadata(path, PARAMETERS)[-1]
    assert yaml.safe_load(newest["/recorder"])["compression"] == "lz4"
    # Not of who is no node of the rig, as the node of this test.
    assert "/peer" not in newest


def test_files_are_attached_and_what_an_operator_says_is_recorded(harness, recorder, tmp_path):
    rig_file = tmp_path / "my, own rig.toml"
    rig_file.write_text("name = 'bench 3'", "utf-8")
    recorder(attachments=str(rig_file))
    notes = harness.advertise(interfaces.NOTE)
    harness.wait_until(lambda: notes.get_subscription_count() > 0)
    notes.publish(String(data="the tip is loose"))
    assert notes.wait_for_all_acked()
    harness.change_state("recorder", "deactivate")
    with (tmp_path / "session.mcap").open("rb") as stream:
        (attachment,) = mcap.reader.make_reader(stream).iter_attachments()
    assert (attachment.name, attachment.media_type) == (rig_file.name, "application/toml")
    assert attachment.data == rig_file.read_bytes()
    (said,) = read_by_rosbags(tmp_path / "session.mcap")["/note"]
    assert said.data == "the tip is loose"


def test_a_recorder_that_is_not_started_says_so_to_those_who_would_wait_for_it(harness):
    states = harness.listen(interfaces.RECORDER_STATE)
    harness.add(RecorderNode, autostart=False)
    (state,) = states.wait_for_count(1)
    assert (state.recording, state.waiting) == (False, False)
    assert "not active" in state.message
