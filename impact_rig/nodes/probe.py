"""Two tiny programs that pass one message between two processes: `impact-rig doctor` runs them.

``python -m impact_rig.nodes.probe talk TOKEN`` says TOKEN until it is stopped;
``python -m impact_rig.nodes.probe listen TOKEN`` ends once it has heard it, and prints the name
of the middleware that brought it.
"""

import sys
from collections.abc import Sequence

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import String

TOPIC = "impact_rig_probe"
QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def talk(node: Node, token: str) -> None:
    """Publish `token` until the process is asked to stop."""
    node.create_publisher(String, TOPIC, QOS).publish(String(data=token))
    rclpy.spin(node)


def listen(node: Node, token: str) -> None:
    """Wait until `token` is heard."""
    heard = Future()

    def take(message: String) -> None:
        if message.data == token:
            heard.set_result(token)

    node.create_subscription(String, TOPIC, take, QOS)
    rclpy.spin_until_future_complete(node, heard)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one of the two programs; see the module's text."""
    name, token = sys.argv[1:3] if argv is None else argv
    rclpy.init(args=[])
    try:
        {"talk": talk, "listen": listen}[name](Node(f"impact_rig_probe_{name}"), token)
        print(get_rmw_implementation_identifier())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
