"""Two accelerometers at 4 kHz, as arrays: where a digitizer would be read, a contact is computed.

It knows nothing of the rig but when the hammer goes, since here nothing else would strike.
"""

from contextlib import suppress

import numpy as np
import rclpy
from impact_rig_msgs.msg import HammerRelease
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

RATE, POINTS = 4000, 40
CONTACT_TIME, PEAK, MASSES = 8e-3, 120.0, (0.5, 0.4)  # [s], [m/s^2], [kg] of hammer and sample


class Samples(Node):
    """Publishes what both sensors see, 40 points in a message."""

    def __init__(self):
        super().__init__("samples")
        self._random = np.random.default_rng(1)
        self._begin, self._sent = self.get_clock().now().nanoseconds, 0
        self._contact = np.inf  # begin of the next contact, in points
        self._publisher = self.create_publisher(Float64MultiArray, "samples", 100)
        self.create_subscription(HammerRelease, "release", self._strike, 10)
        self.create_timer(POINTS / RATE, self._publish)

    def _count(self):
        return (self.get_clock().now().nanoseconds - self._begin) * 1e-9 * RATE

    def _strike(self, release):
        self._contact = self._count() + release.swing_time * RATE

    def _publish(self):
        while self._sent + POINTS <= self._count():
            time = (np.arange(self._sent, self._sent + POINTS) - self._contact) / RATE
            inside = (time > 0.0) & (time < CONTACT_TIME)
            pulse = np.where(
                inside, np.sin(np.pi * np.where(inside, time, 0.0) / CONTACT_TIME) ** 2, 0.0
            )
            both = np.stack([PEAK * pulse, PEAK * MASSES[0] / MASSES[1] * pulse])
            both += self._random.normal(scale=0.1, size=both.shape)
            message = Float64MultiArray(data=both.ravel().tolist())
            message.layout.dim = [MultiArrayDimension(size=size) for size in both.shape]
            self._publisher.publish(message)
            self._sent += POINTS


def main():
    """Run the node until Ctrl-C."""
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Samples())
