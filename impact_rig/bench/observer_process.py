"""Sees what the estimator says, from outside of the rig; a process of its own.

Prints every verdict as a line of JSON as soon as it comes.
"""

import json

import rclpy
from impact_rig_msgs.msg import Impact

from impact_rig.nodes import interfaces


def tell(verdict: Impact) -> None:
    """Print a verdict."""
    line = {
        "record": verdict.record,
        "accepted": verdict.accepted,
        "contact_time_s": verdict.contact_time,
    }
    print(json.dumps(line), flush=True)


def main() -> None:
    """Listen until the process is ended."""
    rclpy.init()
    node = rclpy.create_node("observer")
    topic = interfaces.IMPACT
    node.create_subscription(topic.type, topic.name, tell, topic.qos)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
