"""The replayer gives a recording back, byte by byte, once somebody listens."""

import time
from functools import partial

import pytest
from impact_rig_msgs.msg import AccelerationBlock
from impact_rig_msgs.srv import GetResults
from lifecycle_msgs.msg import State
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from impact_rig.core.errors import FileError
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.quantity import drop_internals
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE
from impact_rig.core.signals.record import Block
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.schemas import MessageDefinition, find_message_definition
from impact_rig.recordings.source import RecordingSource
from impact_rig.recordings.writer import McapWriter
from impact_rig.results.wire import from_message

from .replays import PEER, make_events, make_hits, wait_for_end, write_recording

NOTES = interfaces.Topic("notes", String, interfaces.IMPACT.qos)


def is_topic(name, channel):
    return channel.topic == name


def collect_raw(harness, topic, name):
    """Collect a topic's messages as they were serialised."""
    collector = harness.make_collector()
    harness.peer.create_subscription(topic.type, name, collector.take, topic.qos, raw=True)
    return collector


def test_the_bytes_come_back_unchanged_in_order(harness, tmp_path):
    events = make_events(150)
    path = write_recording(tmp_path / "session.mcap", events)
    blocks = collect_raw(harness, interfaces.ACCELERATION, "acceleration")
    setups = collect_raw(harness, interfaces.SETUP, "setup")
    node = harness.add(ReplayerNode, required_subscribers=PEER, file=str(path), rate=0.0)
    wait_for_end(harness, node)
    originals = {
        topic: [
            item.data for item in RecordingSource(path).read_messages(partial(is_topic, topic))
        ]
        for topic in ("/setup", "/acceleration")
    }
    assert blocks.wait_for_count(150) == originals["/acceleration"]
    assert setups.wait_for_count(1) == originals["/setup"]


def test_a_fresh_estimator_gives_the_numbers_of_the_analysis_bit_for_bit(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 3, "steel small": 3})
    path = write_recording(tmp_path / "session.mcap", hits, namespace="/lab")
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(ReplayerNode, file=str(path), rate=0.0)
    impacts.wait_for_count(6)
    answer = harness.call(GetResults, interfaces.GET_RESULTS)

    recording = read_recording(path)
    session = Session(recording.setup)
    for event in recording.events():
        if isinstance(event, Block):
            session.feed(event)
    expected = {item.name: item for item in session.estimate_all().samples}
    assert [item.name for item in answer.samples] == [CONTROL_SAMPLE, "steel small"]
    for item in answer.samples:
        # As text, where every digit counts and NaN equals itself.
        found = from_message(SampleEstimate, item)
        assert repr(found) == repr(drop_internals(expected[item.name]))


def test_the_original_timing_and_multiples_of_it_are_kept(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(10, pause=0.04))
    arrivals = []
    collector = harness.listen(interfaces.ACCELERATION)
    harness.peer.create_subscription(
        AccelerationBlock, "acceleration", lambda _: arrivals.append(time.monotonic()),
        interfaces.ACCELERATION.qos,
    )  # fmt: skip
    harness.add(ReplayerNode, required_subscribers=PEER, file=str(path), rate=2.0)
    collector.wait_for_count(10)
    harness.wait_until(lambda: len(arrivals) == 10)
    # Never early; a busy machine may be late, with the first one too.
    assert arrivals[-1] - arrivals[0] > 9 * 0.04 / 2 - 0.06


def test_it_waits_for_those_who_must_not_miss_the_beginning(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_hits({CONTROL_SAMPLE: 1}))
    blocks, impacts = harness.listen(interfaces.ACCELERATION), harness.listen(interfaces.IMPACT)
    node = harness.add(ReplayerNode, file=str(path), rate=0.0)
    harness.wait_until(lambda: node.diagnose()["progress"] == "waiting for subscribers")
    assert not blocks.messages
    harness.add(EstimatorNode)
    impacts.wait_for_count(1)


def test_it_replays_in_its_own_namespace_with_the_recorded_quality(harness, tmp_path):
    events = make_events(3)
    path = write_recording(tmp_path / "session.mcap", events, namespace="/there")
    blocks = harness.listen(interfaces.ACCELERATION, "/here")
    harness.add(
        ReplayerNode, required_subscribers=PEER, namespace="/here", file=str(path), rate=0.0
    )
    blocks.wait_for_count(3)
    late = harness.listen(interfaces.SETUP, "/here")
    late.wait_for_count(1)
    (info,) = harness.peer.get_publishers_info_by_topic("/here/setup")
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert not harness.peer.get_publishers_info_by_topic("/there/setup")


@pytest.mark.parametrize(("topics", "count"), [("inputs", 0), ("all", 2)])
def test_only_inputs_are_replayed_unless_all_is_asked_for(harness, tmp_path, topics, count):
    events = make_events(3)
    events[2:2] = [(0.0, NOTES, String(data="first"))]
    events.append((0.0, NOTES, String(data="last")))
    path = write_recording(tmp_path / "session.mcap", events)
    blocks, notes = harness.listen(interfaces.ACCELERATION), harness.listen(NOTES)
    node = harness.add(
        ReplayerNode, required_subscribers=PEER, file=str(path), rate=0.0, topics=topics
    )
    wait_for_end(harness, node)
    blocks.wait_for_count(3)
    notes.wait_for_count(count)
    assert len(notes.messages) == count


REFUSED = (
    (None, {}, "there is no file"),
    (b"", {}, "is empty"),
    (b"time,hammer", {}, "is no MCAP recording"),
    (None, {"file": ""}, "it must be the path of a recording"),
)


def test_what_cannot_be_replayed_is_refused_in_one_sentence(harness, tmp_path):
    for number, (content, parameters, told) in enumerate(REFUSED):
        path = tmp_path / f"session_{number}.mcap"
        if content is not None:
            path.write_bytes(content)
        node = harness.add(
            ReplayerNode, namespace=f"/rig{number}", **{"file": str(path), **parameters}
        )
        assert told in node.fault
        assert node._state_machine.current_state[0] == State.PRIMARY_STATE_UNCONFIGURED
    notes = write_recording(tmp_path / "notes.mcap", [(0.0, NOTES, String(data="a"))])
    assert "holds nothing to replay" in harness.add(ReplayerNode, file=str(notes)).fault


def test_a_recording_of_another_version_is_refused(harness, tmp_path):
    path = tmp_path / "old.mcap"
    definition = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    text = definition.text.replace("uint32 attempt", "uint8 attempt")
    with McapWriter(path) as writer:
        channel = writer.add_channel(
            "/acceleration", MessageDefinition(definition.type_name, text), ()
        )
        writer.add_message(channel, serialize_message(AccelerationBlock()), 1, 1)
    node = harness.add(ReplayerNode, required_subscribers=PEER, file=str(path))
    assert (
        "another version of impact_rig_msgs/msg/AccelerationBlock: field `attempt` of"
        " impact_rig_msgs/msg/AccelerationBlock is uint8 in the recording and uint32 here"
    ) in node.fault


def test_what_cannot_replay_and_is_to_end_with_its_recording_ends_with_an_error(harness, tmp_path):
    with pytest.raises(FileError, match=r"there is no file .*absent\.mcap"):
        harness.add(
            ReplayerNode,
            required_subscribers=PEER,
            file=str(tmp_path / "absent.mcap"),
            exit_when_done=True,
        )


def test_damage_within_ends_the_replay_with_an_error(harness, tmp_path):
    path = tmp_path / "session.mcap"
    writer = McapWriter(path, chunk_size=2000, compression="none")
    definition = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    channel = writer.add_channel("/acceleration", definition, ())
    for index in range(50):
        block = AccelerationBlock(record=1, first_sample=index, sample="brass")
        writer.add_message(channel, serialize_message(block), index, index)
    writer.close()
    data = bytearray(path.read_bytes())
    place = [i for i in range(len(data)) if data.startswith(b"brass", i)][30]
    data[place] ^= 0xFF
    path.write_bytes(data)
    blocks = harness.listen(interfaces.ACCELERATION)
    node = harness.add(
        ReplayerNode, required_subscribers=PEER, file=str(path), rate=0.0, exit_when_done=True
    )
    harness.wait_until(node.stop_requested.done)
    assert "is damaged" in str(node.stop_requested.exception())
    assert 0 < len(blocks.wait_for_count(1)) < 50
