"""The life cycle of a node: configured, active, and closed cleanly whatever happens."""

from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from impact_rig.configuration.processes import ACTIVE, Notice, notify
from impact_rig.core.given.errors import RigError
from impact_rig.nodes.parameter_node import ParameterNode

RCLError = rclpy_implementation.RCLError


class ManagedNode(ParameterNode):
    """A lifecycle node that says in one sentence why a transition failed.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`; a `RigError` raised
    there fails the transition, is logged as one sentence and kept as the node's fault, and the
    node can be configured again.

    Parameters
    ----------
    name : str
        Node name, unless remapped.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.fault: str | None = None  # the error in the diagnostics; None: there is none

    def configure(self) -> None:
        """Read the parameters and open what is needed."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Close what `configure` opened."""

    def on_changed(self) -> None:
        """Publish the state after a transition."""

    def report_fault(self, text: str) -> None:
        """Log an error, once while it stays the same; the next good transition ends it."""
        if text != self.fault:
            self.fault = text
            self.get_logger().error(text)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""
        return self._run_transition(self.configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        result = self._run_transition(self.activate, configured=True, active=True)
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(ACTIVE)
            notify(Notice.ACTIVE)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`."""
        return self._run_transition(self.deactivate, configured=True, active=False)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`."""
        return self._run_transition(self.cleanup, configured=False, active=False)

    def _LifecycleNodeMixin__change_state(self, transition: int) -> TransitionCallbackReturn:  # noqa: N802
        """Refuse a transition that the state does not have: by rclpy it would end the process."""
        try:
            return super()._LifecycleNodeMixin__change_state(transition)
        except RCLError as error:
            self.get_logger().warning(f"the node stays {self.lifecycle}: {error}")
            return TransitionCallbackReturn.FAILURE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and close, whatever the state was."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def autostart(self) -> None:
        """Configure and activate, if the parameter of that name says so; else end, with the fault.

        Nobody would wait for a node that never becomes active.
        """
        if not self.get_value("autostart"):
            return
        good = TransitionCallbackReturn.SUCCESS
        if self.trigger_configure() == good and self.trigger_activate() == good:
            return
        self.request_stop(RigError(self.fault or "the node cannot be started"))

    def close(self) -> None:
        """Leave the states active and configured, whatever led here; safe to call twice."""
        if self.is_active:
            self.is_active = False
            self.deactivate()
        if self.is_configured:
            self.is_configured = False
            self.cleanup()

    def _run_transition(
        self, work: Callable[[], None], *, configured: bool, active: bool
    ) -> TransitionCallbackReturn:
        try:
            work()
        except RigError as error:
            self.report_fault(str(error))
            return TransitionCallbackReturn.FAILURE
        except ModuleNotFoundError as error:
            self.report_fault(
                f"this needs the Python package {error.name!r}, which is not installed:"
                " `impact-rig doctor` says how to get it"
            )
            return TransitionCallbackReturn.FAILURE
        self.fault = None
        self.is_configured = configured
        self.is_active = active
        self.on_changed()
        return TransitionCallbackReturn.SUCCESS

    @property
    def lifecycle(self) -> str:
        """The state that the node is in, as ROS calls it."""
        return ("unconfigured", "inactive", "active")[self.is_configured + self.is_active]
