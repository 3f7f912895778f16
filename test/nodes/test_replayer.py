"""The replayer gives a recording back, byte by byte; its rate, its loop and its pauses."""

import os
import time

import pytest
from impact_rig_msgs.msg import AccelerationBlock, ReplayerState
from impact_rig_msgs.srv import GetResults
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String
from std_srvs.srv import Trigger

from impact_rig.configuration.node_claim import claim_node
from impact_rig.core.given.errors import FileError
from impact_rig.core.given.setup import CONTROL_SAMPLE
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import ReplayerNode, RunToReplay
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import MessageDefinition, find_message_definition
from impact_rig.recordings.writer import RecordingWriter

from .replays import PEER, make_events, make_hits, wait_for_end, write_recording

NOTES = interfaces.Topic("notes", String, interfaces.IMPACT.qos)


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
    wait_for_end(harness, play(harness, path, rate=1000.0))
    originals = {
        name: [item.data for item in Scan(path).read_messages(lambda it, of=name: it.topic == of)]
        for name in ("/setup", "/acceleration")
    }
    assert blocks.wait_for_count(150) == originals["/acceleration"]
    assert setups.wait_for_count(1) == originals["/setup"]


def test_the_original_timing_and_multiples_of_it_are_kept(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(10, pause=0.04))
    arrivals = []
    harness.peer.create_subscription(
        AccelerationBlock, "acceleration", lambda _: arrivals.append(time.monotonic()),
        interfaces.ACCELERATION.qos,
    )  # fmt: skip
    play(harness, path, rate=2.0)
    harness.wait_until(lambda: len(arrivals) == 10)
    # Never early; a busy machine may be late, with the first one too.
    assert arrivals[-1] - arrivals[0] > 9 * 0.04 / 2 - 0.06


def test_it_waits_for_those_who_must_not_miss_the_beginning(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_hits({CONTROL_SAMPLE: 1}))
    blocks, impacts = harness.listen(interfaces.ACCELERATION), harness.listen(interfaces.IMPACT)
    node = harness.add(ReplayerNode, file=str(path), rate=1000.0)
    harness.wait_until(lambda: node.diagnose()["message"] == "waiting for subscribers")
    assert not blocks.messages
    harness.add(EstimatorNode)
    impacts.wait_for_count(1)


def test_it_replays_in_its_own_namespace_with_the_recorded_quality(harness, tmp_path):
    events = make_events(3)
    path = write_recording(tmp_path / "session.mcap", events, namespace="/there")
    blocks = harness.listen(interfaces.ACCELERATION, "/here")
    play(harness, path, rate=1000.0, namespace="/here")
    blocks.wait_for_count(3)
    late = harness.listen(interfaces.SETUP, "/here")
    late.wait_for_count(1)
    (info,) = harness.peer.get_publishers_info_by_topic("/here/setup")
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert not harness.peer.get_publishers_info_by_topic("/there/setup")


def test_what_cannot_be_replayed_leaves_the_node_unconfigured(harness, tmp_path):
    path = write_recording(tmp_path / "notes.mcap", [(0.0, NOTES, String(data="a"))])
    node = harness.add(ReplayerNode, file=str(path))
    assert "holds nothing to replay" in node.fault
    assert not node.is_configured
    for service in (interfaces.PAUSE_REPLAYER, interfaces.RESUME_REPLAYER):
        answer = harness.call(Trigger, service)
        assert not answer.success
        assert "nothing is being replayed" in answer.message


def test_a_recording_of_another_version_is_refused(tmp_path):
    path = tmp_path / "old.mcap"
    definition = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    text = definition.text.replace("uint32 attempt", "uint8 attempt")
    with RecordingWriter(path) as writer:
        channel = writer.add_channel(
            "/acceleration", MessageDefinition(definition.type_name, text), ()
        )
        writer.add_message(channel, serialize_message(AccelerationBlock()), 1, 1)
    with pytest.raises(FileError, match="another version of impact_rig_msgs/msg/Acceleration"):
        RunToReplay(Run(path))


def test_a_run_that_was_resumed_is_replayed_with_all_its_files(tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 2})
    for name, record in (("session", 1), ("session-2", 2)):
        part = [item for item in hits if getattr(item[2], "record", record) == record]
        write_recording(tmp_path / f"{name}.mcap", part)
    replayed = [
        (item.topic, deserialize_message(item.data, item.topic.type))
        for item in RunToReplay(Run(tmp_path)).read_messages()
    ]
    assert [(topic, getattr(message, "record", 0)) for topic, message in replayed] == [
        (topic, getattr(message, "record", 0)) for _, topic, message in hits
    ]


def test_damage_within_ends_the_replay_with_an_error(harness, tmp_path):
    path = tmp_path / "session.mcap"
    write_recording(path, make_events(50), chunk_size=2000, compression="none")
    data = bytearray(path.read_bytes())
    place = [i for i in range(len(data)) if data.startswith(b"brass", i)][30]
    data[place] ^= 0xFF
    path.write_bytes(data)
    blocks = harness.listen(interfaces.ACCELERATION)
    node = play(harness, path, rate=1000.0, exit_when_done=True)
    harness.wait_until(node.stop_requested.done)
    assert "is damaged" in str(node.stop_requested.exception())
    assert 0 < len(blocks.wait_for_count(1)) < 50


def play(harness, path, **parameters):
    return harness.add(
        ReplayerNode, file=str(path), **{"required_subscribers": PEER, **parameters}
    )


def test_a_pause_holds_until_it_is_ended(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(100, pause=0.02))
    blocks = harness.listen(interfaces.ACCELERATION)
    states = harness.listen(interfaces.REPLAYER_STATE)
    node = play(harness, path)
    blocks.wait_for_count(5)
    assert harness.call(Trigger, interfaces.PAUSE_REPLAYER).success
    # The state comes again and again: between two of them nothing went on.
    paused = list_paused(states.wait(lambda items: len(list_paused(items)) >= 3))
    assert paused[-2].messages == paused[-1].messages < 101
    assert paused[-1].header.stamp != paused[-2].header.stamp
    node.set_parameters([Parameter("rate", value=1000.0)])
    assert harness.call(Trigger, interfaces.RESUME_REPLAYER).success
    wait_for_end(harness, node)
    assert [item.first_sample for item in blocks.wait_for_count(100)] == list(range(100))
    last = states.wait(lambda items: items[-1].state == ReplayerState.DONE)[-1]
    assert (last.uri, last.messages, last.message) == (str(path), 101, "done: 101 messages")
    assert last.position == last.duration == pytest.approx(2.0)


def list_paused(states):
    return [item for item in states if item.state == ReplayerState.PAUSED]


def test_each_pass_of_a_loop_estimates_afresh(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 4})
    path = write_recording(tmp_path / "session.mcap", hits)
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    node = play(harness, path, rate=1000.0, loop=3, required_subscribers="estimator")
    wait_for_end(harness, node)
    assert [item.record for item in impacts.wait_for_count(12)] == [1, 2, 3, 4] * 3
    (sample,) = harness.call(GetResults, interfaces.GET_RESULTS).samples
    assert (sample.impacts_accepted, sample.impacts_rejected) == (4, 0)


def test_a_replay_that_begins_again_leaves_nothing_of_the_one_before_to_do(harness):
    events = make_hits({"steel small": 1, CONTROL_SAMPLE: 1})
    again = [event for event in events if getattr(event[2], "sample", "") != "steel small"]
    node = harness.add(EstimatorNode)
    comparisons = harness.listen(interfaces.COMPARISON)
    topics = {topic.name: topic for _, topic, _ in events}
    publishers = {name: harness.advertise(topic) for name, topic in topics.items()}
    heard = interfaces.SETUP.name, interfaces.ACCELERATION.name
    harness.wait_until(lambda: all(publishers[it].get_subscription_count() for it in heard))
    for _, topic, message in (*events, *again):
        publishers[topic.name].publish(message)
    comparisons.wait_for_count(1)  # of the control sample, the second in turn
    assert node.fault is None


def test_a_replay_into_a_rig_of_this_computer_is_refused(harness):
    with claim_node("/bench/accelerometer"):
        node = harness.add(ReplayerNode, namespace="bench", file="absent.mcap")
    assert node.fault.startswith(f"process {os.getpid()} is /bench/accelerometer")
