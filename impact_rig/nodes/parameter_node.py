"""Parameters of a node, each declared with its range or choices and with when it can be set."""

import math
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter

from impact_rig.configuration import parameters
from impact_rig.core.given.errors import ParameterError
from impact_rig.nodes.async_node import AsyncNode


class ParameterNode(AsyncNode):
    """A node that refuses what its parameters cannot be, or not now.

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
