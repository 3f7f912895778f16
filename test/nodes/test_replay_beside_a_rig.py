"""A recording that is played where a rig is up: nothing of it is judged or recorded."""

import os

import pytest
from impact_rig_msgs.srv import Act
from rclpy.serialization import serialize_message

from impact_rig.configuration.node_claim import claim_node
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.recordings.scan import Scan

from .campaigns import begin, cancel, start_rig
from .replays import make_hits

THEIRS = Identity(make_id(), make_id())


def play(harness, events, offer):
    """Publish what was recorded as `ros2 bag play` does; return the publishers and the bytes."""
    publishers, played = {}, set()
    for _, topic, message in events:
        if topic.name not in publishers:
            publisher = publishers[topic.name] = harness.peer.create_publisher(
                topic.type, topic.name, getattr(topic, offer)
            )
            # The recorder listens to all of them; to blocks the estimator, too.
            ears = 2 if topic.name == interfaces.ACCELERATION.name else 1
            harness.wait_until(
                lambda publisher=publisher, ears=ears: publisher.get_subscription_count() >= ears
            )
        THEIRS.fill(message)
        played.add(serialize_message(message))
        publishers[topic.name].publish(message)
    return publishers.values(), played


@pytest.mark.parametrize("offer", ["qos", "leased_qos"])  # of our recorder, of `ros2 bag record`
def test_a_live_campaign_and_its_recording_hold_its_own_hits_alone(harness, offer):
    client = start_rig(harness)
    impacts = harness.listen(interfaces.IMPACT)
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=1000)
    feedback.wait(lambda messages: messages[-1].impact > 2)
    players, played = play(harness, make_hits({"brass small": 3}), offer)
    feedback.wait(lambda messages: "/peer speaks on " in messages[-1].message)
    assert any("/peer speaks on " in it for it in harness.find(RecorderNode).intake.strangers)
    for player in players:
        harness.run(lambda player=player: harness.peer.destroy_publisher(player))
    seen = feedback.messages[-1].impact
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
    feedback.wait(lambda messages: messages[-1].impact > seen + 2)
    result = cancel(harness, handle).result
    harness.run(harness.find(RecorderNode).close)
    assert {hit.sample for hit in impacts.messages} == {"steel small"}
    judged = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.impact)
    assert [hit.impact for hit in judged] == [*range(1, len(judged) + 1)]
    assert not played & {bytes(raw.data) for raw in Scan(harness.recording).read_messages()}


def test_a_replay_into_a_rig_of_this_computer_is_refused(harness):
    with claim_node("/bench/accelerometer"):
        node = harness.add(ReplayerNode, namespace="bench", file="absent.mcap")
    assert node.fault.startswith(f"process {os.getpid()} is /bench/accelerometer")
