"""Command-line options with a unit: ``100g``, ``"25.6 kHz"``, or a plain number in SI."""

import click

from impact_rig.configuration.units import parse_quantity, parse_reading, parse_sensitivity
from impact_rig.core.setup.calibration import Sensitivity


class Quantity(click.ParamType):
    """A number in SI units, or a text with number and unit.

    Parameters
    ----------
    unit : str
        SI unit, in pint's notation.
    example : str
        A good value, for the message.
    """

    name = "quantity"

    def __init__(self, unit: str, example: str) -> None:
        self.unit = unit
        self.example = example

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the quantity in SI units; raises `ParameterError`."""
        text = str(value)
        try:
            return float(text)
        except ValueError:
            name = param.opts[-1] if param else self.name
            return parse_quantity(name, text, self.unit, self.example)


class Cutoff(Quantity):
    """A frequency, or ``off``, which is 0."""

    def __init__(self) -> None:
        super().__init__("Hz", "50 kHz")

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the frequency [Hz]; raises `ParameterError`."""
        return 0.0 if value == "off" else super().convert(value, param, ctx)


class SensitivityText(click.ParamType):
    """What a sensor gives: ``"10 mV/g"``, where g is the standard gravity."""

    name = "sensitivity"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Sensitivity:
        """Return the sensitivity; raises `ParameterError`."""
        return parse_sensitivity(param.opts[-1] if param else self.name, value)


class Reading(click.ParamType):
    """A number with its unit as it stands: ``"500 g"``, where g is the standard gravity."""

    name = "reading"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, str]:
        """Return number and unit; raises `ParameterError`."""
        return parse_reading(param.opts[-1] if param else self.name, value)
