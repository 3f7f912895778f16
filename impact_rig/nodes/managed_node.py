"""A node with a life cycle and checked parameters, closed cleanly whatever happens."""

import math
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from impact_rig.configuration import parameters
from impact_rig.configuration.processes import ACTIVE, Notice, notify
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.nodes.async_node import AsyncNode

RCLError = rclpy_implementation.RCLError


class ManagedNode(AsyncNode):
    """A lifecycle node that says in one sentence why a transition failed.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`; a `RigError` raised
    there fails the transition, is logged as one sentence and kept as the node's fault, and the
    node can be configured again.

    Parameters
    ----------
    name : str
        Node name, unless remapped; it has the parameters that `PARAMETERS` lists under it.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._known = {**parameters.COMMON, **parameters.PARAMETERS.get(name, {})}
        self.is_configured = False  # in the state inactive or active
        self.is_active = False
        given = self._parameter_overrides
        parameters.check_parameters({key: item.value for key, item in given.items()})
        for key, parameter in self._known.items():
            if key in given:
                given[key] = Parameter(key, value=parameter.convert(key, given[key].value))
            self.declare_parameter(key, parameter.default, _describe(parameter))
        self.add_on_set_parameters_callback(self._on_set_parameters)
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

    # The parameters.

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; one that keeps its value is set, even if it is read-only.

        So `ros2 param load` takes what `ros2 param dump` wrote.
        """
        changes = [
            item
            for item in parameter_list
            if not self.has_parameter(item.name) or self.get_value(item.name) != item.value
        ]
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def _on_set_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        for change in changes:
            name, known = change.name, self._known.get(change.name)
            try:
                if known is not None:
                    known.convert(name, change.value)
            except ParameterError as error:
                return SetParametersResult(successful=False, reason=str(error))
            is_fixed = known is not None and not known.is_live
            if is_fixed and self.is_configured and change.value != self.get_value(name):
                way = "deactivate and clean up" if self.is_active else "clean up"
                reason = f"{name} is read when the node is configured: {way} the node first"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value


def _describe(parameter: parameters.Parameter) -> ParameterDescriptor:
    """Return a parameter's description for ROS 2."""
    descriptor = ParameterDescriptor(
        description=parameter.description, read_only=parameter.is_read_only
    )
    low, high = parameter.low, parameter.high
    if parameter.choices:
        descriptor.additional_constraints = f"one of {', '.join(parameter.choices)}"
    elif math.isfinite(high) and isinstance(parameter.default, int):
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    elif math.isfinite(high):
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return descriptor
