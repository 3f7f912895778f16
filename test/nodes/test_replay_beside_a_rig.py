"""A recording that is played where a rig is up: nothing of it is judged or recorded."""

import os

import pytest
from impact_rig_msgs.msg import StreamBlock
from rcl_interfaces.msg import Log

from impact_rig.configuration.node_claim import claim_node
from impact_rig.configuration.processes import TAKE_REPLAYS
from impact_rig.core.signals.record import Block
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.recordings.reader import read_recording

from .campaigns import begin, start_rig
from .replays import make_hits

LIVE = {TAKE_REPLAYS: False}


def play(harness, events, offer):
    """Publish what was recorded as `ros2 bag play` does; return the publishers."""
    publishers = {}
    for _, topic, message in events:
        if topic.name not in publishers:
            publishers[topic.name] = harness.peer.create_publisher(
                topic.type, topic.name, getattr(topic, offer)
            )
        publishers[topic.name].publish(message)
    return publishers.values()


def is_named(log, topic):
    """Return whether a warning says that the test's own node publishes a topic."""
    name, published, rest = log.msg.partition(" publishes ")
    return bool(published) and name == "/peer" and topic in rest.partition(" and ")[0].split(", ")


@pytest.mark.parametrize("offer", ["qos", "leased_qos"])  # of our recorder, of `ros2 bag record`
def test_a_live_campaign_and_its_recording_hold_its_own_hits_alone(harness, tmp_path, offer):
    new = tmp_path / "new.mcap"
    client = start_rig(harness, estimator=LIVE)
    recorder = harness.add(RecorderNode, output=str(new), **LIVE)
    impacts = harness.listen(interfaces.IMPACT)
    told = harness.make_collector()
    harness.peer.create_subscription(Log, "/rosout", told.take, 100)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=1000)
    feedback.wait(lambda messages: messages[-1].impact > 2)
    players = play(harness, make_hits({"brass small": 3}), offer)
    for topic in ("/acceleration", "/setup"):  # in one warning, or one after the other
        told.wait(lambda logs, topic=topic: any(is_named(log, topic) for log in logs))
    for player in players:  # with the lease of the rig's nodes it passes for a second one
        harness.run(lambda player=player: harness.peer.destroy_publisher(player))
    seen = feedback.messages[-1].impact
    feedback.wait(lambda messages: messages[-1].impact > seen + 2)
    harness.wait(handle.cancel_goal_async())
    result = harness.wait(handle.get_result_async()).result
    harness.close(recorder)
    assert {hit.sample for hit in impacts.messages} == {"steel small"}
    judged = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.impact)
    assert [hit.impact for hit in judged] == [*range(1, len(judged) + 1)]
    # Of so many hits as the machine manages meanwhile one may be an outlier.
    reasons = [reason for hit in result.rejected for reason in hit.reasons]
    assert all(reason.startswith("inconsistent:") for reason in reasons)
    assert {
        item.label.sample for item in read_recording(new).events() if isinstance(item, Block)
    } == {"steel small"}


def test_a_stream_is_named_and_not_searched(harness):
    estimator = harness.add(EstimatorNode, **LIVE)
    told = harness.make_collector()
    harness.peer.create_subscription(Log, "/rosout", told.take, 100)
    player = harness.peer.create_publisher(
        StreamBlock, interfaces.STREAM.name, interfaces.STREAM.leased_qos
    )
    harness.wait_until(player.get_subscription_count)
    message = StreamBlock(sampling_rate=1e6)
    message.header.stamp.sec = 1
    for _ in range(100):
        player.publish(message)
    told.wait(lambda logs: any("/peer publishes /acceleration/stream" in log.msg for log in logs))
    assert "stream blocks" not in estimator.diagnose()
    assert estimator.fault == ""


def test_a_replay_into_a_rig_of_this_computer_is_refused(harness, ros_domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    with claim_node("/bench/accelerometer"):
        node = harness.add(ReplayerNode, namespace="bench", file="absent.mcap")
    assert node.fault.startswith(f"process {os.getpid()} is /bench/accelerometer")
