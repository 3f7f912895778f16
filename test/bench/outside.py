"""Processes that look at a rig from outside of it, or ask something of it.

Called with the name of one of `ROLES` and its arguments. What they see they print as lines of
JSON, as soon as it comes; who only listens does so until it is ended.
"""

import json
import sys
from collections.abc import Callable
from typing import Any

import rclpy

START_TIMEOUT = 60.0
"""How long a rig may take to start [s]."""
HAMMER_TIMEOUT = 20.0
"""How long the hammer may take to answer [s]."""
NANO = 1e-9


def tell(**fields: Any) -> None:
    """Print a line."""
    print(json.dumps(fields), flush=True)


class Counter:
    """Tells what each feedback of a campaign counts; nobody has anything to do on its rig."""

    def follow(self, feedback: Any) -> None:
        """Tell hits and rejections so far."""
        tell(hits=feedback.impact, rejected=feedback.rejected)

    def mount(self, sample: str) -> None:
        """Do nothing."""

    def put_back(self, refusal: str) -> None:
        """Do nothing."""

    def let_go(self, sample: str, patience: float) -> None:
        """Do nothing."""


def run_campaign(sample: str, impacts: str) -> None:
    """Run a campaign on one sample of a rig that is up, and count.

    Without a view, which would cost as much as a node.
    """
    from impact_rig.nodes.client import CampaignClient, CampaignGoal

    with CampaignClient() as client:
        client.wait_for_rig(START_TIMEOUT)
        goal = CampaignGoal(samples=[sample], impacts=int(impacts))
        outcome = client.run(goal, Counter())
    if not outcome.success:
        raise SystemExit(outcome.message)


def watch_hammer() -> None:
    """Tell what the hammer says of itself, and give it back after each emergency stop.

    So a campaign that a stop has made to pause goes on.
    """
    from impact_rig_msgs.msg import HammerState

    from impact_rig.nodes import interfaces
    from impact_rig.nodes.client import HammerClient

    with HammerClient("", HAMMER_TIMEOUT) as client:
        stops: list[HammerState] = []

        def take(state: HammerState) -> None:
            is_stop = not state.armed and state.disarmed_by == HammerState.EMERGENCY_STOP
            stamp = state.header.stamp
            tell(
                time=stamp.sec + NANO * stamp.nanosec,
                released=state.armed and state.state == HammerState.SWINGING,
                stopped=is_stop,
            )
            if is_stop:
                stops.append(state)

        client.listen(interfaces.HAMMER_STATE, take)
        while True:
            if client.spin_until(lambda: bool(stops), HAMMER_TIMEOUT):
                stops.clear()
                client.ask("reset")
                client.ask("arm")


def watch_diagnostics() -> None:
    """Tell the figures of each node, as it says them of itself."""
    from diagnostic_msgs.msg import DiagnosticArray

    def take(message: DiagnosticArray) -> None:
        for status in message.status:
            tell(node=status.name, values={pair.key: pair.value for pair in status.values})

    _listen(DiagnosticArray, "/diagnostics", take, 10)


def watch_verdicts() -> None:
    """Tell every verdict of the estimator."""
    from impact_rig_msgs.msg import Impact

    from impact_rig.nodes import interfaces

    def take(verdict: Impact) -> None:
        tell(
            record=verdict.record,
            accepted=verdict.accepted,
            contact_time_s=verdict.contact_time,
        )

    _listen(Impact, interfaces.IMPACT.name, take, interfaces.IMPACT.qos)


def _listen(kind: Any, topic: str, take: Callable[[Any], None], qos: Any) -> None:
    rclpy.init()
    node = rclpy.create_node("bench_listener")
    node.create_subscription(kind, topic, take, qos)
    rclpy.spin(node)


ROLES: dict[str, Callable[..., None]] = {
    "campaign": run_campaign,
    "hammer": watch_hammer,
    "diagnostics": watch_diagnostics,
    "verdicts": watch_verdicts,
}

if __name__ == "__main__":
    ROLES[sys.argv[1]](*sys.argv[2:])
