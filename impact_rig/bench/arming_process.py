"""Arms the accelerometers again and again, and sees their records; a process of its own.

Prints a line of JSON when they are armed, and one with the time when a record's last block is
there.
"""

import json
import time
from itertools import count

import rclpy
from impact_rig_msgs.msg import AccelerationBlock
from impact_rig_msgs.srv import Arm
from rclpy.node import Node

from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.nodes import interfaces, messages

NAME = "armer"
"""Of the node."""


class Armer(Node):
    """Takes the place of campaign, estimator and recorder."""

    def __init__(self) -> None:
        super().__init__(NAME)
        setup = interfaces.SETUP
        self._setup = self.create_publisher(setup.type, setup.name, setup.qos)
        self._setup.publish(messages.setup_to_msg(PAPER_SETUP, self.get_clock().now().to_msg()))
        blocks = interfaces.ACCELERATION
        self.create_subscription(blocks.type, blocks.name, self._take, blocks.qos)
        self._client = self.create_client(Arm, interfaces.ARM_ACCELEROMETER)
        self._is_waiting = False

    def arm(self, impact: int) -> None:
        """Arm, and wait for the record."""
        self._client.wait_for_service()
        request = Arm.Request(sample=CONTROL_SAMPLE, impact=impact, attempt=1)
        future = self._client.call_async(request)
        self._is_waiting = True
        rclpy.spin_until_future_complete(self, future)
        response = future.result()
        if response is None or not response.success:
            # It may still look for its device.
            time.sleep(0.1)
            return
        print(json.dumps({"armed": response.record}), flush=True)
        while self._is_waiting:
            rclpy.spin_once(self)

    def _take(self, block: AccelerationBlock) -> None:
        now = time.time()
        if block.last:
            self._is_waiting = False
            print(json.dumps({"record": block.record, "time": now}), flush=True)


def main() -> None:
    """Arm until the process is ended."""
    rclpy.init()
    armer = Armer()
    for impact in count(1):
        armer.arm(impact)


if __name__ == "__main__":
    main()
