"""How the contact time goes with the size of the samples: tau proportional to m_eq^p.

At one impact speed and with one contact stiffness per material, p = 1/(n + 1) for a contact force
k delta^n: 2/5 for Hertz (n = 3/2), 1/2 for a linear spring.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from impact_rig.core.checks import check_positive
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.quantity import Quantity
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.uncertainty.results import COVERAGE_PERCENT

HERTZ_EXPONENT = 2.0 / 5.0
SPRING_EXPONENT = 1.0 / 2.0


@dataclass(frozen=True)
class SizeExponent:
    """Exponent of the equivalent mass in the contact time, one constant for each material.

    Attributes
    ----------
    exponent : Quantity
        p [-]; the uncertainty is that of a straight line through scattered points.
    residual : float
        RMS of what is left of ln(tau) [-].
    """

    exponent: Quantity
    residual: float


def estimate_size_exponent(
    materials: Sequence[str], equivalent_masses: Sequence[float], contact_times: Sequence[float]
) -> SizeExponent:
    """Fit ln(tau) = constant of the material + p ln(m_eq) by least squares.

    Parameters
    ----------
    materials, equivalent_masses, contact_times : sequence, shape (samples,)
        Material, m1 m2 / (m1 + m2) [kg] and tau [s] of each sample.

    Raises
    ------
    NotDeterminedError
        If no two samples of one material differ in mass, or there are too few for an uncertainty.
    ParameterError
        If a mass or a time is not a positive number.
    """
    mass, time = (
        center_logarithms(materials, equivalent_masses),
        center_logarithms(materials, contact_times),
    )
    degrees = mass.size - len(set(materials)) - 1
    spread = float(mass @ mass)
    if spread == 0.0 or degrees < 1:
        raise NotDeterminedError(
            f"size exponent: {mass.size} samples of {len(set(materials))} materials do not tell"
            " it and its uncertainty; one material with three different masses does"
        )
    exponent = float(mass @ time) / spread
    left = time - exponent * mass
    standard = math.sqrt(float(left @ left) / degrees / spread)
    coverage = float(student_t.ppf(0.5 + COVERAGE_PERCENT / 200.0, degrees))
    return SizeExponent(
        exponent=Quantity(exponent, standard, coverage * standard, degrees),
        residual=math.sqrt(float(left @ left) / left.size),
    )


def compute_size_residual(
    materials: Sequence[str],
    equivalent_masses: Sequence[float],
    contact_times: Sequence[float],
    exponent: float,
) -> float:
    """Return the RMS of what a given p leaves of ln(tau) [-]; parameters and errors as above."""
    left = center_logarithms(materials, contact_times) - exponent * center_logarithms(
        materials, equivalent_masses
    )
    return math.sqrt(float(left @ left) / left.size)


def center_logarithms(groups: Sequence[str], values: Sequence[float]) -> FloatArray:
    """Return the logarithms less their mean over the same group, shape (samples,)."""
    for value in values:
        check_positive("value of a power law", value, "SI units")
    logarithms = np.log(values)
    names = np.array(groups)
    means = {name: logarithms[names == name].mean() for name in set(groups)}
    return np.asarray(logarithms - [means[name] for name in groups])
