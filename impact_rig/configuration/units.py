"""Quantities with units, as a person writes them: "21.31 g" to 0.02131 kg."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from functools import lru_cache
from numbers import Real
from tokenize import TokenError
from typing import TYPE_CHECKING, Any, Protocol

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.sensors import VOLTAGES, Sensitivity, normalize_unit

if TYPE_CHECKING:
    from pint import UnitRegistry

_FACTOR = r"\(*(?:[^\W\d]+|%)(?:(?:\^|\*\*)-?\d|[²³])?\)*"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:(?:\s*[*/·]\s*|\s+){_FACTOR})*")
"""A product of units and their small powers. pint would calculate any expression."""
_SAMPLES_PER_SECOND = re.compile(r"(?<=[\d\s.])([kMG]?)Sa?/s$")
"""Spellings of Hz by instruments; pint would read siemens."""
_NUMBER = re.compile(r"\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*")
_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S.*?)\s*")

_UNREADABLE = (ValueError, TypeError, AttributeError, SyntaxError, TokenError, AssertionError)
"""pint reads a unit with Python's own tokenizer, whose errors come through as they are."""


@lru_cache(maxsize=1)
def _load_registry() -> UnitRegistry:
    # Reading pint's unit definitions takes a noticeable part of a second: only when needed.
    from pint import UnitRegistry

    return UnitRegistry()


def parse_quantity(what: str, value: Any, unit: str, example: str) -> float:
    """Convert a text with number and unit into SI units.

    Parameters
    ----------
    what : str
        What the quantity is, for the message.
    value : object
        As read from the file; anything but such a text is refused.
    unit : str
        SI unit of the result, in pint's notation.
    example : str
        A good value, for the message.

    Returns
    -------
    float

    Raises
    ------
    ParameterError
        If the text is no quantity, or has a unit of another dimension.
    """
    from pint import DimensionalityError, PintError

    if not isinstance(value, str):
        raise ParameterError(
            f'{what} is {value!r}, which has no unit: write it as a text like "{example}"'
        )
    if _NUMBER.fullmatch(value):
        raise ParameterError(f'{what} is "{value}", which has no unit: write it like "{example}"')
    match = _NUMBER_AND_UNIT.fullmatch(_SAMPLES_PER_SECOND.sub(r"\1Hz", value))
    number = math.nan
    try:
        if match is not None and _UNIT.fullmatch(match[2]):
            quantity: Any = _load_registry().Quantity(float(match[1]), match[2])
            number = float(quantity.to(unit).magnitude)
    except DimensionalityError:
        raise ParameterError(
            f'{what} is "{value}", which is no {unit}: write it like "{example}"'
        ) from None
    except (PintError, *_UNREADABLE):
        number = math.nan
    if math.isfinite(number):
        return number
    raise ParameterError(
        f'{what} is "{value}", which cannot be read as number and unit: write it like "{example}"'
    )


class UnitCarrier(Protocol):
    """A number or an array with a unit, of pint or astropy."""

    def to(self, unit: Any, /) -> Any:
        """Return it in another unit."""


def read_carried(value: UnitCarrier, unit: str) -> Any:
    """Return the numbers of what carries a unit in another one; None: it is of another kind."""
    try:
        found = value.to(unit)
    except Exception:  # noqa: BLE001 - each library has errors of its own
        return None
    return getattr(found, "magnitude", getattr(found, "value", None))


Given = str | float | UnitCarrier | None
"""A quantity of a program: a text with a unit, a number in SI units, what carries its unit, or
None: not given."""


def _take_number(value: Any, unit: str) -> Any:
    """Return what carries a unit in another one, and numpy's numbers as Python's."""
    number = read_carried(value, unit) if hasattr(value, "to") else value
    item = getattr(number, "item", None)
    return number if item is None else item()


def read_given(what: str, value: Given, unit: str, example: str) -> float | None:
    """Return a program's argument in SI units; "off" is 0; parameters as `parse_quantity`."""
    if value is None:
        return None
    if isinstance(value, str):
        return 0.0 if value == "off" else parse_quantity(what, value, unit, example)
    number = _take_number(value, unit)
    if number is None:
        raise ParameterError(f'{what} is {value}, which is no {unit}: give it like "{example}"')
    if not isinstance(number, bool) and isinstance(number, Real) and math.isfinite(number):
        return float(number)
    raise ParameterError(
        f'{what} is {value!r}: it must be a text like "{example}" or a finite number in {unit}'
    )


def combine_units(formula: Callable[[Any, Any], Any], first: str, second: str, power: Any) -> str:
    """Return the unit of a product, a ratio or a power of numbers of these units; empty: none.

    Units that are no product, as N/m^n, stay in brackets.
    """
    from pint import PintError

    registry = _load_registry()
    try:
        units = [registry.Unit(unit.replace(" ", "*")) for unit in (first, second)]
        found = formula(units[0], power if formula is operator.pow else units[1])
        return f"{found:~}".replace(" ** ", "^").replace(" ", "")
    except (PintError, *_UNREADABLE):
        return " ".join(f"({unit})" for unit in (first, second) if unit)


def parse_sensitivity(what: str, value: Any) -> Sensitivity:
    """Convert a text like "10 mV/g" or "2.25 mV/N", or a scale like "450 N/V", its inverse.

    Parameters and errors as `parse_quantity`. The unit that is no voltage is one of instruments: g
    is the standard gravity, no gram.
    """
    text = value if isinstance(value, str) else ""
    scale = _NUMBER_AND_UNIT.fullmatch(text)
    above, stroke, voltage = scale[2].rpartition("/") if scale else ("", "", "")
    if scale and stroke and normalize_unit(voltage) in VOLTAGES:
        units_per_volt = parse_reading(what, f"{scale[1]} {above}")[0]
        if units_per_volt == 0.0:
            raise ParameterError(f"{what} is {value!r}: it must not be zero")
        return Sensitivity(VOLTAGES[normalize_unit(voltage)] / units_per_volt, _strip(above))
    voltage, stroke, unit = text.partition("/")
    if not stroke:
        raise ParameterError(
            f'{what} is {value!r}: it must be a voltage per unit, written like "10 mV/g", or its'
            ' inverse, like "450 N/V"'
        )
    return Sensitivity(parse_quantity(what, voltage.strip(), "V", "10 mV"), _strip(unit))


def _strip(unit: str) -> str:
    """Return a unit without blanks and brackets around it."""
    unit = unit.strip()
    return unit[1:-1].strip() if unit[:1] + unit[-1:] == "()" else unit


def parse_reading(what: str, value: Any) -> tuple[float, str]:
    """Split a text like "500 g" or "10 V" into its number and its unit, as written.

    The unit is one of instruments: g is the standard gravity, no gram.

    Raises
    ------
    ParameterError
        If the text is no number with a unit.
    """
    match = _NUMBER_AND_UNIT.fullmatch(value) if isinstance(value, str) else None
    try:
        if match is not None:
            return float(match[1]), match[2]
    except ValueError:
        pass
    raise ParameterError(f'{what} is {value!r}: write it with a unit, like "500 g" or "10 V"')
