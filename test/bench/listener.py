"""Prints every verdict of the estimator as a line of JSON, until it is ended."""

import json

import rclpy
from impact_rig_msgs.msg import Impact

from impact_rig.nodes import interfaces


def on_verdict(verdict: Impact) -> None:
    """Print a verdict."""
    fields = {
        "record": verdict.record,
        "accepted": verdict.accepted,
        "contact_time": verdict.contact_time,
    }
    print(json.dumps(fields), flush=True)


if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("bench_listener")
    node.create_subscription(Impact, interfaces.IMPACT.name, on_verdict, interfaces.IMPACT.qos)
    rclpy.spin(node)
