"""What all nodes of the rig share: parameters, lifecycle, diagnostics and a clean end."""

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from impact_rig.core.errors import RigError
from impact_rig.nodes.interfaces import Topic

DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages [s]: the convention of diagnostic aggregators."""


class RigNode(LifecycleNode):
    """A lifecycle node of the rig.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`; a `RigError` raised
    there fails the transition, is logged as one sentence and shown in the diagnostics, and the
    node can be configured again.

    Parameters
    ----------
    name : str
        Node name, unless remapped.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.declare(
            "autostart", True, "configure and activate at start-up, without a lifecycle manager"
        )
        self._fault = ""
        self._is_configured = False
        self._is_active = False
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTIC_PERIOD, self._publish_diagnostics)

    # Overridden by the nodes.

    def configure(self) -> None:
        """Read the parameters and open what is needed."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Close what `configure` opened."""

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics, by name."""
        return {}

    # Used by the nodes.

    @property
    def is_active(self) -> bool:
        """Whether the node is in the state `active`."""
        return self._is_active

    def declare(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        low: float | None = None,
        high: float | None = None,
    ) -> None:
        """Declare a parameter with its description and, for a number, its range."""
        descriptor = ParameterDescriptor(description=description)
        if low is not None and high is not None:
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(low), to_value=int(high), step=0)
                ]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
                ]
        self.declare_parameter(name, default, descriptor)

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value

    def advertise(self, topic: Topic, **options: Any) -> Any:
        """Create a publisher of one of the rig's topics."""
        return self.create_publisher(topic.type, topic.name, topic.qos, **options)

    def listen(self, topic: Topic, callback: Callable[[Any], None], **options: Any) -> Any:
        """Subscribe to one of the rig's topics; a `RigError` in the callback is reported."""

        def guarded(message: Any) -> None:
            try:
                callback(message)
            except RigError as error:
                self.report_fault(f"{topic.name}: {error}")

        return self.create_subscription(
            topic.type, topic.name, guarded, topic.qos, **options
        )

    def report_fault(self, text: str) -> None:
        """Log an error and show it in the diagnostics until the next good transition."""
        self._fault = text
        self.get_logger().error(text)

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""
        return self._run_transition(state, self.configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        return self._run_transition(state, self.activate, configured=True, active=True)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`."""
        return self._run_transition(state, self.deactivate, configured=True, active=False)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`."""
        return self._run_transition(state, self.cleanup, configured=False, active=False)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and close, whatever the state was."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def autostart(self) -> None:
        """Configure and activate, if the parameter of that name says so."""
        if self.get_value("autostart"):
            if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                self.trigger_activate()

    def close(self) -> None:
        """Leave the states active and configured, whatever led here; safe to call twice."""
        if self._is_active:
            self._is_active = False
            self.deactivate()
        if self._is_configured:
            self._is_configured = False
            self.cleanup()

    def _run_transition(
        self, state: LifecycleState, work: Callable[[], None], *, configured: bool, active: bool
    ) -> TransitionCallbackReturn:
        try:
            work()
        except RigError as error:
            self.report_fault(str(error))
            return TransitionCallbackReturn.FAILURE
        self._fault = ""
        self._is_configured = configured
        self._is_active = active
        return TransitionCallbackReturn.SUCCESS

    def _publish_diagnostics(self) -> None:
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name(),
            level=DiagnosticStatus.ERROR if self._fault else DiagnosticStatus.OK,
            message=self._fault or ("active" if self._is_active else "inactive"),
            values=[KeyValue(key=key, value=str(value)) for key, value in self.diagnose().items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def run_node(make_node: Callable[[], RigNode], argv: Sequence[str] | None = None) -> int:
    """Run one node until it is told to stop; close it cleanly whatever happens.

    Parameters
    ----------
    make_node : callable
        Returns the node; called once ROS is up.
    argv : sequence of str, optional
        Command line, ROS arguments included; the process's own by default.

    Returns
    -------
    int
        Exit code: 0 after a stop that was asked for, 2 after an impossible parameter.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=argv)
    node = None
    try:
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        node.autostart()
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (InvalidParameterTypeException, InvalidParameterValueException, RigError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
