"""Parameters of a node, each declared with its range or choices and with when it can be set."""

from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.parameter import Parameter

from impact_rig.configuration.parameters import check_parameters
from impact_rig.nodes.async_node import AsyncNode


class ParameterNode(AsyncNode):
    """A node that refuses what its parameters cannot be, or not now.

    Parameters
    ----------
    name : str
        Node name, unless remapped.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._choices: dict[str, Sequence[str]] = {}
        self._fixed: set[str] = set()
        self.is_configured = False  # in the state inactive or active
        self.is_active = False
        self.add_on_set_parameters_callback(self._on_set_parameters)

    def declare(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        low: float | None = None,
        high: float | None = None,
        choices: Sequence[str] = (),
        live: bool = False,
        read_only: bool = False,
    ) -> None:
        """Declare a parameter with its range or its choices.

        One that is `live` takes effect at once, one that is `read_only` is set when the node
        starts; any other is read when the node is configured, and cannot be set until it is
        cleaned up.
        """
        descriptor = ParameterDescriptor(description=description, read_only=read_only)
        if choices:
            descriptor.additional_constraints = f"one of {', '.join(choices)}"
            self._choices[name] = choices
        if not live:
            self._fixed.add(name)
        if low is not None and high is not None:
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(low), to_value=int(high), step=0)
                ]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
                ]
        given = self._parameter_overrides.get(name)
        if isinstance(default, float) and given and given.type_ is Parameter.Type.INTEGER:
            self._parameter_overrides[name] = Parameter(name, value=float(given.value))
        self.declare_parameter(name, default, descriptor)

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            name, value = parameter.name, parameter.value
            choices = self._choices.get(name, ())
            if choices and value not in choices:
                reason = f"{name} is {value!r}: it must be one of {', '.join(choices)}"
                return SetParametersResult(successful=False, reason=reason)
            is_fixed = self.is_configured and name in self._fixed
            if is_fixed and value != self.get_value(name):
                way = "deactivate and clean up" if self.is_active else "clean up"
                reason = f"{name} is read when the node is configured: {way} the node first"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def check_overrides(self) -> None:
        """Raise a `ParameterError` if a parameter is given that no node of the rig has."""
        check_parameters(
            name for name in self._parameter_overrides if name not in self._parameters
        )

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value
