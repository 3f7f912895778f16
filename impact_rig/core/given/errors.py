"""Errors of the rig, and the checks of numbers that raise them."""

import math
from collections.abc import Collection
from numbers import Integral, Real


class RigError(Exception):
    """Anything that the user of the rig can mend; shown as one sentence, never a traceback."""


class ParameterError(RigError, ValueError):
    """A value given by the user that cannot be used."""

    line: int | None = None  # of the rig file, which the message names, too; None: of no file

    def __init__(self, message: str, name: str = "") -> None:
        super().__init__(message)
        self.name = name  # of what has the value; empty: of nothing with a name


class UnknownNameError(ParameterError, KeyError):
    """A name that there is not; as a `KeyError` it is what a mapping raises."""

    __str__ = Exception.__str__  # that of a `KeyError` adds quotes


class SignalError(RigError, ValueError):
    """A trace or a stream that cannot be evaluated."""


class FileError(RigError):
    """A file that cannot be read, understood or written."""


class DeviceError(RigError):
    """A device, real or virtual, that does not do what it was asked."""


class NotDeterminedError(RigError):
    """A quantity that the data at hand do not determine."""


def check_positive(name: str, value: float, unit: str) -> None:
    """Require a finite number above zero.

    Parameters
    ----------
    name : str
        What the number is, for the message.
    unit : str
        Its unit, for the message.

    Raises
    ------
    ParameterError
        If `value` is not a finite positive number.
    """
    if not (_is_finite(value) and value > 0):
        raise ParameterError(
            f"{name} is {value!r} {unit}: it must be a finite number above zero", name
        )


def check_if_known(name: str, value: float, unit: str) -> None:
    """Require a finite number above zero, or NaN: not known; see `check_positive`."""
    if not math.isnan(value):
        check_positive(name, value, unit)


def check_not_negative(name: str, value: float, unit: str) -> None:
    """Require a finite number of zero or more; parameters and errors as `check_positive`."""
    if not (_is_finite(value) and value >= 0):
        raise ParameterError(
            f"{name} is {value!r} {unit}: it must be a finite number, 0 or more", name
        )


def check_count(name: str, value: object, least: int) -> None:
    """Require a whole number that is large enough; raises `ParameterError`."""
    if not isinstance(value, Integral) or int(value) < least:
        raise ParameterError(
            f"{name} is {value!r}: it must be a whole number, {least} or more", name
        )


def check_between(name: str, value: float, low: float, high: float) -> None:
    """Require a finite number in the closed interval [low, high]; raises `ParameterError`."""
    if not (_is_finite(value) and low <= value <= high):
        raise ParameterError(
            f"{name} is {value!r}: it must lie between {low:g} and {high:g}", name
        )


def check_name(what: str, name: object, known: Collection[str]) -> None:
    """Require a name that there is; raises `UnknownNameError`."""
    if name not in known:
        names = ", ".join(map(repr, known)) or "none"
        raise UnknownNameError(f"unknown {what} {name!r}: there are {names}")


def check_choice(name: str, value: str, known: Collection[str]) -> None:
    """Require one of several words; raises `ParameterError`."""
    if value not in known:
        raise ParameterError(f"{name} is {value!r}: it must be one of {', '.join(known)}", name)


def _is_finite(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


def check_mass_uncertainty(name: str, uncertainty: float, mass: float) -> None:
    """Require a standard uncertainty [kg] that leaves something of its mass [kg].

    Raises
    ------
    ParameterError
        If it is no finite number of zero or more, or not below the mass.
    """
    check_not_negative(name, uncertainty, "kg")
    if uncertainty > 0.0 and uncertainty >= mass:
        raise ParameterError(
            f"{name} is {uncertainty!r} kg: it must be less than the mass, which is {mass!r} kg",
            name,
        )
