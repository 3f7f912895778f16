"""A node that is killed says nothing: those who need it miss it all the same, and in time."""

import os
import signal
import subprocess
import sys
import time

from impact_rig_msgs.msg import CampaignState, HammerState
from impact_rig_msgs.srv import Act

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.rig_node import RigNode

from .campaigns import begin, make_client, wait_for_impact

SOON = 12.0
"""How late a node may be missed [s]: its lease, and all that a busy machine may take; without a
lease it would be a minute."""


def wait_for_pause(feedback, word):
    feedback.wait(
        lambda got: got[-1:] and got[-1].state == CampaignState.PAUSED and word in got[-1].message
    )


def kill(process):
    """Kill a node; return when, by the monotonic clock [s]."""
    killed = time.monotonic()
    process.process.send_signal(signal.SIGKILL)
    process.wait()
    return killed


def test_a_killed_node_disarms_the_hammer_and_pauses_the_campaign(harness, start_process):
    accelerometer = start_process("accelerometer", trigger_timeout=0.001)
    harness.add(EstimatorNode)
    harness.add(HammerNode, swing_time=0.001)
    harness.record()
    harness.add(CampaignNode, verdict_timeout=1.0).answer_timeout = 2.0
    states = harness.listen(interfaces.HAMMER_STATE)
    _, feedback = begin(harness, make_client(harness), samples=["steel small"], impacts=100_000)
    wait_for_impact(harness, feedback, 1)

    killed = kill(accelerometer)
    states.wait(lambda got: got[-1].disarmed_by == HammerState.LOSS and not got[-1].armed)
    assert time.monotonic() - killed < SOON
    assert "the accelerometer node has gone: start it again" in states.messages[-1].message
    wait_for_pause(feedback, "accelerometer")


def test_nobody_who_reads_that_a_campaign_pauses_is_struck_when_its_reason_has_gone(
    harness, start_process
):
    """The enable does not rest on the estimator, but the person does on the pause."""
    estimator = start_process("estimator")
    harness.add(AccelerometerNode, trigger_timeout=0.2)
    harness.add(HammerNode, swing_time=0.001)
    harness.record()
    harness.add(CampaignNode, verdict_timeout=0.5).answer_timeout = 2.0
    states = harness.listen(interfaces.HAMMER_STATE)
    releases = harness.listen(interfaces.RELEASE)
    _, feedback = begin(harness, make_client(harness), samples=["steel small"], impacts=100_000)
    wait_for_impact(harness, feedback, 1)

    estimator.process.send_signal(signal.SIGSTOP)
    wait_for_pause(feedback, "estimator/join did not answer")
    states.wait(lambda got: not got[-1].armed)
    before = len(releases.messages)
    estimator.process.send_signal(signal.SIGCONT)
    wait_for_pause(feedback, "is not armed (estimator/join did not answer")
    assert len(releases.messages) == before
    assert harness.call(Act, interfaces.ARM_HAMMER).success
    releases.wait_for_count(before + 1)


def test_a_hammer_that_is_started_again_while_a_campaign_waits_for_it_is_seen(
    harness, start_process
):
    hammer = start_process("hammer", swing_time=0.001, confirm_return=True)
    harness.add(AccelerometerNode, trigger_timeout=0.2)
    harness.add(EstimatorNode)
    harness.record()
    harness.add(CampaignNode).answer_timeout = 2.0
    _, feedback = begin(harness, make_client(harness), samples=["steel small"], impacts=2)
    feedback.wait(lambda got: got[-1:] and got[-1].state == got[-1].WAITING_FOR_HAMMER)
    kill(hammer)
    wait_for_pause(feedback, "hammer/join")
    start_process("hammer")
    wait_for_pause(feedback, "the hammer is not armed")


SECOND = """
import contextlib, rclpy
from rclpy.executors import ExternalShutdownException
from impact_rig.nodes.accelerometer import AccelerometerNode
rclpy.init()
node = AccelerometerNode()
node.autostart()
with contextlib.suppress(ExternalShutdownException, KeyboardInterrupt):
    rclpy.spin(node)
node.close()
node.destroy_node()
"""


def test_two_rigs_in_one_domain_release_no_hammer(harness, start_process, ros_domain):
    harness.add(HammerNode)
    states = harness.listen(interfaces.HAMMER_STATE)
    first = start_process("accelerometer")
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
    # As on another computer: on this one a second process of a node ends at once.
    second = subprocess.Popen(
        [sys.executable, "-c", SECOND], env={**os.environ, "ROS_DOMAIN_ID": str(ros_domain)}
    )
    try:
        states.wait(lambda got: got[-1].disarmed_by == HammerState.LOSS and not got[-1].armed)
        told = "2 accelerometer nodes are up in this ROS domain and namespace: stop one rig"
        assert told in states.messages[-1].message
        assert told in harness.call(Act, interfaces.ARM_HAMMER).message
    finally:
        # It announces its end: the others need not wait for its lease.
        second.send_signal(signal.SIGINT)
        second.wait()
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
    kill(first)


def test_a_subscriber_whose_name_the_middleware_has_lost_is_not_missed(harness, monkeypatch):
    node = harness.add(lambda **options: RigNode("speaker", **options))
    harness.listen(interfaces.NOTE)
    harness.wait_until(lambda: not node.find_missing_subscriber("note", ["peer"]))
    assert node.find_missing_subscriber("note", ["peer", "other"]) == "other"
    known = node.get_subscriptions_info_by_topic("note")
    for item in known:
        # For good, once the network was away for longer than the lease of a participant.
        item.node_name = "_NODE_NAME_UNKNOWN_"
    monkeypatch.setattr(node, "get_subscriptions_info_by_topic", lambda _: known)
    assert not node.find_missing_subscriber("note", ["peer", "other"])
