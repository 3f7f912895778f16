"""Stiffness from contact time and masses, equations (5) and (6)."""

import math

from impact_rig.core.arithmetic import (
    Number,
    get_value,
)
from impact_rig.core.errors import NotDeterminedError, check_positive


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
            f"k2: equation (6b) has no positive solution, since k_eq is"
            f" {get_value(equivalent_stiffness) / 1e6:.4g} MN/m and must be below k1 ="
            f" {get_value(hammer_stiffness) / 1e6:.4g} MN/m; check masses,"
            " contact time and control sample"
        )
    return 1.0 / (1.0 / equivalent_stiffness - 1.0 / hammer_stiffness)
