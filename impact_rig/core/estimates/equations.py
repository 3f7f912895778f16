"""Equations (5) to (8), of floats and of uncertain numbers alike.

Each formula is written once with + - * / and **: given floats it returns a float, given uncertain
numbers it carries their uncertainties along.
"""

import math
from typing import Any, Protocol, TypeVar

from impact_rig.core.given.errors import NotDeterminedError, check_not_negative, check_positive


class UncertainNumber(Protocol):
    """A value x with standard uncertainty u, as GTC's real numbers."""

    @property
    def x(self) -> float: ...  # noqa: D102
    @property
    def u(self) -> float: ...  # noqa: D102
    def __add__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __radd__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __sub__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rsub__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __mul__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rmul__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __truediv__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rtruediv__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __pow__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105


Number = TypeVar("Number", float, UncertainNumber)
"""Either a float or an uncertain number; a formula takes all its inputs of one kind."""


def get_value(quantity: float | UncertainNumber) -> float:
    """Return the value of a quantity without its uncertainty."""
    return quantity if isinstance(quantity, (int, float)) else quantity.x


def estimate_equivalent_mass(hammer_mass: Number, moving_mass: Number) -> Number:
    """Return m_eq = m1 m2 / (m1 + m2) [kg], equation (6a), from masses in kg."""
    check_positive("hammer mass", get_value(hammer_mass), "kg")
    check_positive("sample mass", get_value(moving_mass), "kg")
    return hammer_mass * moving_mass / (hammer_mass + moving_mass)


def estimate_equivalent_stiffness(equivalent_mass: Number, contact_time: Number) -> Number:
    """Return k_eq = m_eq (pi / tau_p)^2 [N/m], equation (5), from kg and s."""
    check_positive("equivalent mass", get_value(equivalent_mass), "kg")
    check_positive("contact time", get_value(contact_time), "s")
    return equivalent_mass * (math.pi / contact_time) ** 2


def estimate_hammer_stiffness(control_equivalent_stiffness: Number) -> Number:
    """Return k1 = 2 k_eq of the control experiment [N/m]: hammer and sample are alike."""
    check_positive("equivalent stiffness", get_value(control_equivalent_stiffness), "N/m")
    return 2.0 * control_equivalent_stiffness


def estimate_sample_stiffness(equivalent_stiffness: Number, hammer_stiffness: Number) -> Number:
    """Return k2 from k_eq = k1 k2 / (k1 + k2) [N/m], equation (6b).

    Raises
    ------
    NotDeterminedError
        If k_eq is not below k1: no positive k2 solves (6b). The contact time is then too short
        for that hammer.
    """
    check_positive("equivalent stiffness", get_value(equivalent_stiffness), "N/m")
    check_positive("hammer stiffness", get_value(hammer_stiffness), "N/m")
    if get_value(equivalent_stiffness) >= get_value(hammer_stiffness):
        raise NotDeterminedError(
            "equation (6b) has no positive solution, since k_eq is"
            f" {get_value(equivalent_stiffness) / 1e6:.4g} MN/m and must be below k1 ="
            f" {get_value(hammer_stiffness) / 1e6:.4g} MN/m; check masses,"
            " contact time and control sample"
        )
    return 1.0 / (1.0 / equivalent_stiffness - 1.0 / hammer_stiffness)


def estimate_damping_ratio(log_decrement: Number) -> Number:
    """Return zeta = Delta / sqrt(4 pi^2 + Delta^2) [-].

    Equation (7b) prints a minus under the root; the plus is the exact relation of a damped
    oscillator. Of a float or an uncertain number.
    """
    check_positive("log decrement", get_value(log_decrement), "")
    ratio: Number = log_decrement / (4.0 * math.pi**2 + log_decrement * log_decrement) ** 0.5
    return ratio


def estimate_damping_coefficient(damping_ratio: Number, stiffness: Number, mass: Number) -> Number:
    """Return c = 2 zeta sqrt(k m) [N s/m], equation (8), from N/m and kg.

    Of floats or of uncertain numbers.
    """
    check_not_negative("damping ratio", get_value(damping_ratio), "")
    check_positive("stiffness", get_value(stiffness), "N/m")
    check_positive("mass", get_value(mass), "kg")
    coefficient: Number = 2.0 * damping_ratio * (stiffness * mass) ** 0.5
    return coefficient


def estimate_damping_ratio_from_coefficient(
    damping_coefficient: Number, stiffness: Number, mass: Number
) -> Number:
    """Return zeta = c / (2 sqrt(k m)) [-], equation (8), from N s/m, N/m and kg.

    Of floats or of uncertain numbers.
    """
    check_not_negative("damping coefficient", get_value(damping_coefficient), "N s/m")
    check_positive("stiffness", get_value(stiffness), "N/m")
    check_positive("mass", get_value(mass), "kg")
    ratio: Number = damping_coefficient / (2.0 * (stiffness * mass) ** 0.5)
    return ratio
