"""Two free bodies that meet by a contact law F = k delta^n (1 + alpha delta').

Each sample's flat face meets the spherical tip of the hammer: Hertz's k from the tabulated
constants of both materials, n = 3/2, and alpha such that the bodies part with the material's
restitution. The pulse is integrated step by step, by another way than the estimator's.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.equations import estimate_equivalent_mass
from impact_rig.core.estimates.model import Body, ImpactModel
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import RigSetup

HERTZ_EXPONENT = 1.5
TIP_RADIUS = 10e-3  # [m], of the hammer's tip: 212 us on the control sample, as in the paper
CHECK_MATERIAL = "steel"
"""Material of a check mass without a stated one."""
TIP_MATERIAL = "aluminium"
LONGEST_CONTACT = 100.0  # in the contact's unit of time; at e = 0.05 it takes 26
RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-10, 1e-12  # the force is good to 1e-8 of its peak


@dataclass(frozen=True)
class Material:
    """Properties of a material in contact."""

    elastic_modulus: float  # [Pa]
    poisson_ratio: float  # [-]
    restitution: float  # [-], at some cm/s: metals lose a tenth to a third of their energy

    @property
    def compliance(self) -> float:
        """(1 - nu^2) / E [1/Pa]."""
        return (1.0 - self.poisson_ratio**2) / self.elastic_modulus


MATERIALS = {
    "aluminium": Material(70e9, 0.33, 0.90),
    "steel": Material(210e9, 0.29, 0.95),
    "bronze": Material(110e9, 0.34, 0.87),
    "brass": Material(100e9, 0.35, 0.83),
}
"""Elastic constants as in any table of materials."""


@dataclass(frozen=True)
class Contact:
    """Two free bodies and the law between them."""

    hammer_mass: float  # [kg]
    moving_mass: float  # [kg]
    exponent: float  # n [-]
    stiffness: float  # k [N/m^n]
    damping: float  # alpha [s/m]
    impact_speed: float  # v [m/s]

    @property
    def equivalent_mass(self) -> float:
        """m1 m2 / (m1 + m2) [kg]."""
        return estimate_equivalent_mass(self.hammer_mass, self.moving_mass)

    @property
    def time_unit(self) -> float:
        """T = (m_eq / (k v^(n-1)))^(1/(n+1)) [s]."""
        ratio = self.equivalent_mass / (
            self.stiffness * self.impact_speed ** (self.exponent - 1.0)
        )
        return float(ratio ** (1.0 / (self.exponent + 1.0)))

    @cached_property
    def _solution(self) -> Any:
        return integrate_contact(self.exponent, self.damping * self.impact_speed)

    @property
    def duration(self) -> float:
        """From first touch to separation [s]."""
        return float(self._solution.t[-1]) * self.time_unit

    @property
    def restitution(self) -> float:
        """Speed of separation over impact speed [-]."""
        return -float(self._solution.y[1, -1])

    def compute_force(self, time: FloatArray) -> FloatArray:
        """Return the force [N] at times counted from first touch [s], shape (n,)."""
        scaled = time / self.time_unit
        inside = (scaled > 0.0) & (scaled < self._solution.t[-1])
        force = np.zeros(time.size)
        depth, speed = self._solution.sol(scaled[inside])
        height = self.equivalent_mass * self.impact_speed / self.time_unit
        loss = 1.0 + self.damping * self.impact_speed * speed
        force[inside] = height * np.maximum(depth, 0.0) ** self.exponent * loss
        return force

    def simulate(
        self, sampling_rate: float, count: int, start: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the accelerations of hammer and sample [m/s^2], shape (count,); see plants."""
        force = self.compute_force(start + np.arange(count) / sampling_rate)
        return -force / self.hammer_mass, force / self.moving_mass

    def scatter(self, duration: float, speed: float) -> Self:
        """Return a contact with T and v times these factors [-]."""
        # T at one speed is what k makes of it.
        stiffness = self.stiffness / duration ** (self.exponent + 1.0)
        return replace(self, stiffness=stiffness, impact_speed=self.impact_speed * speed)

    def describe(self) -> ContactLaw:
        """Return the true parameters in the form of an estimate."""
        stiffness = self.equivalent_mass * (math.pi / self.duration) ** 2
        return ContactLaw(
            exponent=Quantity(self.exponent),
            stiffness=Quantity(self.stiffness),
            damping=Quantity(self.damping),
            impact_speed=Quantity(self.impact_speed),
            duration=Quantity(self.duration),
            restitution=Quantity(self.restitution),
            peak_force=Quantity(self.make_model().peak_force),
            equivalent_stiffness=Quantity(stiffness),
        )

    def make_model(self) -> ImpactModel:
        """Return a model with this duration and peak force, and two equal springs to match."""
        fine = self.compute_force(np.linspace(0.0, self.duration, 2001))
        spring = 2.0 * self.equivalent_mass * (math.pi / self.duration) ** 2
        return ImpactModel(
            hammer=Body(self.hammer_mass, spring, 0.0),
            specimen=Body(self.moving_mass, spring, 0.0),
            contact_time=self.duration,
            impact_speed=self.impact_speed,
            peak_force=float(fine.max()),
        )


def integrate_contact(exponent: float, damping: float) -> Any:
    """Integrate x'' = -x^n (1 + A x'), x(0) = 0, x'(0) = 1, from first touch to separation.

    Returns
    -------
    scipy's result
        With its dense output of x and x'; the last point is the separation.
    """

    def change(_time: float, state: FloatArray) -> list[float]:
        return [state[1], -(max(state[0], 0.0) ** exponent) * (1.0 + damping * state[1])]

    def separate(_time: float, state: FloatArray) -> float:
        return float(state[0])

    separate.terminal = True  # type: ignore[attr-defined]
    separate.direction = -1.0  # type: ignore[attr-defined]
    return scipy.integrate.solve_ivp(
        change,
        (0.0, LONGEST_CONTACT),
        [0.0, 1.0],
        method="DOP853",
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
        events=separate,
        dense_output=True,
    )


def compute_damping(restitution: float) -> float:
    """Return A = alpha v [-] of bodies that part with `restitution`, 0 to 1.

    By the energy, whatever n is: A - ln(1 + A) = -A e - ln(1 - A e).
    """
    if restitution == 1.0:
        return 0.0

    def miss(damping: float) -> float:
        rebound = damping * restitution
        return damping - math.log1p(damping) + rebound + math.log1p(-rebound)

    # A e = 1 would take infinite energy.
    return float(scipy.optimize.brentq(miss, 1e-5, (1.0 - 1e-12) / restitution, xtol=1e-14))


def make_nominal_contact(
    setup: RigSetup, sample: str, exponent: float, restitution: float
) -> Contact:
    """Return the contact of hammer and sample.

    Parameters
    ----------
    setup : RigSetup
        Masses, speed and the samples' materials.
    sample : str
        Name of the sample; its release angle gives the speed.
    exponent : float
        n [-]; other than 3/2: k is such that T is as with Hertz.
    restitution : float
        e at the set-up's impact speed [-]; 0: the material's.

    Raises
    ------
    ParameterError
        If a mass is unknown, or the sample's material is not in `MATERIALS`.
    """
    for body in setup.find_unknown_masses(sample):
        raise ParameterError(f"the virtual rig needs the mass of {body}: it is not known")
    is_check = sample == setup.samples.check_sample
    name = setup.samples.find(sample).material or (CHECK_MATERIAL if is_check else "")
    if name not in MATERIALS:
        raise ParameterError(
            f"sample {sample!r} is of {name or 'no known material'}: for the plant contact the"
            f" virtual rig knows {', '.join(MATERIALS)}"
        )
    material, speed = MATERIALS[name], setup.impact_speed
    modulus = 1.0 / (MATERIALS[TIP_MATERIAL].compliance + material.compliance)
    hertz = Contact(
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.get_moving_mass(sample),
        exponent=HERTZ_EXPONENT,
        stiffness=4.0 / 3.0 * modulus * math.sqrt(TIP_RADIUS),
        damping=compute_damping(restitution or material.restitution) / speed,
        impact_speed=speed,
    )
    stiffness = hertz.equivalent_mass / (
        speed ** (exponent - 1.0) * hertz.time_unit ** (exponent + 1.0)
    )
    # Stiffness and damping are the contact's own, whatever the speed.
    struck = setup.for_series(sample).impact_speed
    return replace(hertz, exponent=exponent, stiffness=stiffness, impact_speed=struck)
