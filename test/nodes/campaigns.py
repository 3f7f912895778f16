"""A rig to run campaigns on, and what it takes to follow them."""

import copy
from typing import Any

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignState
from impact_rig_msgs.srv import Act
from rclpy.action import ActionClient

from impact_rig.devices.virtual.drivers import VirtualHolder
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode


def start_rig(
    harness, namespace="", *, campaign=None, hammer=None, estimator=None, **accelerometer
) -> Any:
    """Start the rig's nodes with these parameters; return a client of the campaign."""
    harness.add(
        HammerNode,
        namespace=namespace,
        **{"swing_time": 0.001, **(hammer or {})},
    )
    harness.add(
        AccelerometerNode,
        namespace=namespace,
        **{"trigger_timeout": 0.2, **accelerometer},
    )
    harness.add(EstimatorNode, namespace=namespace, **(estimator or {}))
    harness.record(namespace)
    harness.add(CampaignNode, namespace=namespace, **(campaign or {}))
    return make_client(harness, namespace)


def make_client(harness, namespace="") -> Any:
    """Return a client of the campaign, which is up."""
    client = ActionClient(harness.peer, RunCampaign, f"{namespace}/{interfaces.RUN_CAMPAIGN}")
    harness.wait_until(client.server_is_ready)
    return client


def run(harness, client, **goal) -> Any:
    """Run a campaign to its end; return what it answers.

    A person arms the hammer again, which a busy machine has disarmed.
    """
    handle, feedback = begin(harness, client, **goal)
    result = handle.get_result_async()
    _wait_and_arm(harness, feedback, lambda _: result.done())
    return harness.wait(result)


def wait_for_impact(harness, feedback, number):
    """Wait until a campaign is at an impact; a person arms the hammer when it asks for that."""
    _wait_and_arm(harness, feedback, lambda newest: newest.impact >= number)


def _wait_and_arm(harness, feedback, condition):
    def is_over():
        newest = feedback.messages[-1] if feedback.messages else CampaignState()
        if newest.task == CampaignState.ARM:
            harness.call(Act, interfaces.ARM_HAMMER)
        return condition(newest)

    harness.wait_until(is_over)


def begin(harness, client, **goal) -> tuple[Any, Any]:
    """Start a campaign; return its handle and a collector of its feedback."""
    feedback = harness.make_collector()
    handle = harness.wait(
        client.send_goal_async(
            RunCampaign.Goal(**goal),
            lambda message: feedback.take(copy.deepcopy(message.feedback.campaign)),
        )
    )
    return handle, feedback


def cancel(harness, handle) -> Any:
    """Cancel a campaign; return what it answers."""
    harness.wait(handle.cancel_goal_async())
    return harness.wait(handle.get_result_async())


class Onlooker:
    """Sees how far a campaign is; there is nothing to do for a person."""

    def __init__(self, follow):
        self.follow = follow

    def mount(self, *_):
        raise AssertionError("no question was expected")

    put_back = let_go = mount


class RealHolder(VirtualHolder):
    """Holds a hammer."""

    hammerless = False


def arm(harness):
    """Arm the hammer, as a person does, once it can be."""
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
