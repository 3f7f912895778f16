"""Calls the emergency stop with rclpy alone: the peer of `impact-rig hammer stop`."""

import rclpy
from std_srvs.srv import Trigger


def main() -> None:
    """Call once."""
    rclpy.init()
    node = rclpy.create_node("bare_stop")
    client = node.create_client(Trigger, "hammer/emergency_stop")
    client.wait_for_service()
    rclpy.spin_until_future_complete(node, client.call_async(Trigger.Request()))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
