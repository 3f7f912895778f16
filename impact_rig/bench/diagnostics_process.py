"""Hears what the nodes say of themselves, from outside of the rig; a process of its own.

Prints the figures of each node as a line of JSON as soon as they come.
"""

import json

import rclpy
from diagnostic_msgs.msg import DiagnosticArray


def tell(message: DiagnosticArray) -> None:
    """Print figures by node."""
    for status in message.status:
        line = {"node": status.name, "values": {pair.key: pair.value for pair in status.values}}
        print(json.dumps(line), flush=True)


def main() -> None:
    """Listen until the process is ended."""
    rclpy.init()
    node = rclpy.create_node("diagnostics_listener")
    node.create_subscription(DiagnosticArray, "/diagnostics", tell, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
