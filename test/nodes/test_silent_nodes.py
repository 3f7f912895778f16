"""A node that is killed says nothing: those who need it miss it all the same, and in time."""

import signal
import time
from types import SimpleNamespace

import pytest
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import HammerState, RecorderState
from impact_rig_msgs.srv import GetResults

from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.peer import Peer
from impact_rig.nodes.rig_node import RigNode

from .campaigns import begin, make_client

SOON = 12.0
"""How late a node may be missed [s]: its lease, and all that a busy machine may take; without a
lease it would be 20 s."""


def wait_for_pause(feedback, word):
    feedback.wait(
        lambda got: (
            got[-1:] and got[-1].phase == RunCampaign.Feedback.PAUSED and word in got[-1].message
        )
    )


def kill(process):
    """Kill a node; return when, by the monotonic clock [s]."""
    killed = time.monotonic()
    process.send_signal(signal.SIGKILL)
    process.wait()
    return killed


def test_a_killed_node_disarms_the_hammer_and_pauses_the_campaign(harness, start_process):
    estimator = start_process("estimator")
    accelerometer = start_process(
        "accelerometer", required_subscribers="estimator", trigger_timeout=0.001
    )
    harness.add(HammerNode, swing_time=0.001, require_recorder=False)
    harness.add(CampaignNode)
    states = harness.listen(interfaces.HAMMER_STATE)
    harness.call(GetResults, interfaces.GET_RESULTS)
    _, feedback = begin(harness, make_client(harness), samples=["steel small"], impacts=100_000)
    feedback.wait(lambda got: got[-1:] and got[-1].impact >= 1)

    killed = kill(estimator)
    wait_for_pause(feedback, "the estimator has gone: start it again")
    # Not only when the verdict on the hit that was under way is given up.
    assert time.monotonic() - killed < SOON

    killed = kill(accelerometer)
    states.wait(lambda got: got[-1].disarmed_by == HammerState.LOSS and not got[-1].armed)
    assert time.monotonic() - killed < SOON
    assert "the accelerometer node has gone: start it again" in states.messages[-1].message


@pytest.fixture
def follow(harness):
    """Return a function that starts a node with a peer, in the process of the test."""

    def start():
        node = harness.add(lambda **options: RigNode("listener", **options))
        return node, Peer(node, interfaces.RECORDER_STATE, lambda _: None)

    return start


def test_a_peer_that_was_never_there_is_not_lost(follow):
    _, peer = follow()
    assert not peer.is_lost
    assert not peer.has_left


def test_a_peer_of_this_process_lives_though_it_gives_no_signs_until_it_ends(harness, follow):
    node, peer = follow()
    publisher = harness.advertise(interfaces.RECORDER_STATE)
    publisher.publish(RecorderState())
    harness.wait_until(lambda: node.messages_handled == 1)
    for status in ((1, 0), (0, 1)):
        peer._take_liveliness(SimpleNamespace(alive_count=status[0], not_alive_count=status[1]))
        assert not peer.is_lost
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: peer.has_left)


def test_a_listener_whose_name_the_middleware_has_lost_is_still_known(harness, monkeypatch):
    node = harness.add(lambda **options: RigNode("speaker", **options))
    harness.listen(interfaces.NOTE)
    harness.wait_until(lambda: not node.find_missing_listeners("note", "peer"))
    known = node.get_subscriptions_info_by_topic("note")
    for item in known:
        # So it is for good, once the network was away for more than the 20 s of a participant.
        item.node_name = "_NODE_NAME_UNKNOWN_"
    monkeypatch.setattr(node, "get_subscriptions_info_by_topic", lambda _: known)
    assert not node.find_missing_listeners("note", "peer")
    assert "'other' does not listen" in node.find_missing_listeners("note", "other")
    for item in known:
        item.endpoint_gid = [7] * len(item.endpoint_gid)
    assert "'peer' does not listen" in node.find_missing_listeners("note", "peer")
