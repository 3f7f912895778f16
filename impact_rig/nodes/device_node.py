"""Common part of the nodes with a device, which may be lost and come back."""

from abc import abstractmethod
from functools import cache
from typing import Any

from impact_rig.configuration.parameters import Parameter
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.nodes.rig_node import RigNode


class DeviceNode(RigNode):
    """A lifecycle node with a device that may be lost.

    When the device is lost, the node becomes `unconfigured`: it lets the device go, says why in
    its state and in the diagnostics, and can be configured again. Unless a lifecycle manager does
    that (`autostart` off), it does so itself every `reconnect_period`.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._known["use_sim_time"] = Parameter(default=False, description="")  # fixed, too
        self._reconnection = self.create_timer(1.0, self._reconnect)
        self._reconnection.cancel()
        # Each text once, though the device is opened again and again until it is there.
        self.warn_once = cache(self.get_logger().warning)

    def configure(self) -> None:
        """Refuse a simulated time, which neither hammer nor digitizer follows."""
        if self.get_value("use_sim_time"):
            raise ParameterError(
                "use_sim_time is true: a node with a device goes by the computer's own clock, it"
                " must be false"
            )

    @abstractmethod
    def publish_fault(self, text: str) -> None:
        """Say on the node's state topic that the device is lost, and why."""

    def lose_device(self, error: RigError) -> None:
        """Become unconfigured because the device does not do what it should."""
        self.get_logger().error(str(error))
        # Before the transitions, which publish their own reasons.
        self.publish_fault(str(error))
        if self.is_active:
            self.trigger_deactivate()
        self.trigger_cleanup()
        self._tell_fault(str(error))

    def autostart(self) -> None:
        """Configure and activate, if the parameter says so; try again while that fails."""
        if self.get_value("autostart") and not self._start() and self.fault is not None:
            self._tell_fault(self.fault)

    def _tell_fault(self, text: str) -> None:
        self.fault = text
        self.publish_fault(text)
        period = float(self.get_value("reconnect_period"))
        if self.get_value("autostart") and period:
            self._reconnection.timer_period_ns = round(period * 1e9)
            self._reconnection.reset()

    def _reconnect(self) -> None:
        self._reconnection.cancel()
        if self.is_configured:
            # Another caller was faster.
            return
        before = self.fault
        if self._start():
            self.get_logger().info("the device is back")
        else:
            if self.fault is not None and self.fault != before:
                self.publish_fault(self.fault)
            self._reconnection.reset()
