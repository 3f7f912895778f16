"""A measured contact as two free bodies that meet, and a spring that stands for it."""

import functools
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.errors import ParameterError
from impact_rig.core.records import FloatArray, Origin
from impact_rig.results.campaign import Results


@dataclass(frozen=True)
class Contact:
    """Two free bodies and the law identified between them."""

    sample: str
    hammer_mass: float  # [kg]
    sample_mass: float  # [kg], with its accelerometer
    law: ContactLaw
    origin: Origin  # of the hits that the law was identified from

    @property
    def equivalent_mass(self) -> float:
        """m1 m2 / (m1 + m2) [kg]."""
        return self.hammer_mass * self.sample_mass / (self.hammer_mass + self.sample_mass)

    @property
    def restitution(self) -> float:
        """Speed of separation over impact speed [-]; 1 where noise makes it seem to be more."""
        return min(1.0, self.law.restitution.value)


def make_contact(results: Results, name: str) -> Contact:
    """Return the contact of one sample.

    Raises
    ------
    ParameterError
        If there is no result of the sample, or no law was identified, or a mass is not known.
    """
    law = next((item.contact_law for item in results.samples if item.name == name), None)
    if law is None:
        names = ", ".join(repr(item.name) for item in results.samples) or "none"
        raise ParameterError(f"there is no result of sample {name!r}: there are some of {names}")
    if not (law.is_known and law.stiffness.is_known and law.impact_speed.is_known):
        reason = "; ".join(law.notes) or "none was looked for"
        raise ParameterError(f"sample {name!r} has no identified contact law: {reason}")
    return Contact(
        sample=name,
        hammer_mass=results.setup.hammer_mass,
        sample_mass=results.setup.samples.get_moving_mass(name),
        law=law,
        origin=results.find_origin(name),
    )


@dataclass(frozen=True)
class Bend:
    """How an engine's spring and damper grow with the compression s: D = 1 - (1 - D0) (1 - s)^p.

    All in the scales of `impact_rig.core.law_pulses`.
    """

    start: float = 1.0  # [-], D0
    power: float = 1.0  # [-], p
    depth: float = 1.0  # [v T], compression from which D is 1

    def compute(self, compression: float) -> float:
        """Return D [-]."""
        left = 1.0 - min(compression / self.depth, 1.0)
        return 1.0 - (1.0 - self.start) * left**self.power


STRAIGHT = Bend()


@functools.cache
def fit_bend(exponent: float) -> Bend:
    """Return the bend at which D^2 s is nearest to s^n.

    It is within 1.1 % of the force for n from 1 to 2.5, and within 3 % at n = 3, which stands for
    all above. Below n = 1 there is no such bend.
    """
    if exponent <= 1.0:
        return STRAIGHT
    # Half as deep again as a contact without loss: from a quarter to twice the speed a Hertz
    # contact then lasts as long as it should to 4 %.
    depth = 1.5 * ((exponent + 1.0) / 2.0) ** (1.0 / (exponent + 1.0))
    part = np.linspace(0.0, 1.0, 201)

    def compute_error(shape: FloatArray) -> FloatArray:
        start, power = shape
        bent = 1.0 - (1.0 - start) * (1.0 - part) ** power
        return np.asarray(bent**2 * part - part ** min(exponent, 3.0))

    found = least_squares(compute_error, (0.5, 1.3), bounds=((0.1, 1.0), (1.0, 20.0)))
    start, power = found.x.tolist()
    return Bend(start, power, depth)


@dataclass(frozen=True)
class Spring:
    """F = stiffness D^2 x + damping D x', never below zero, between the two bodies."""

    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    bend: Bend
    depth: float  # [m], from which D is 1


def fit_spring(contact: Contact, bend: Bend) -> Spring:
    """Return the spring whose duration and restitution are those of the contact."""
    coefficient = _fit_damping(contact.restitution, bend)
    duration, _ = _compute_pulse(coefficient, bend)
    scale = contact.law.duration.value / duration  # T [s]
    mass, speed = contact.equivalent_mass, contact.law.impact_speed.value
    return Spring(
        stiffness=mass / scale**2,
        damping=coefficient * mass / scale,
        bend=bend,
        depth=bend.depth * speed * scale,
    )


def _fit_damping(restitution: float, bend: Bend) -> float:
    if restitution >= 1.0:
        return 0.0

    def compute_excess(coefficient: float) -> float:
        return _compute_pulse(coefficient, bend)[1] - restitution

    highest = 1.0
    while compute_excess(highest) > 0.0:
        highest *= 2.0
    return float(brentq(compute_excess, 0.0, highest, xtol=1e-12, rtol=1e-12))


def _compute_pulse(coefficient: float, bend: Bend) -> tuple[float, float]:
    """Return duration [T] and restitution [-] of a scaled pulse."""

    def compute_force(compression: float, speed: float) -> float:
        compression = max(compression, 0.0)
        bent = bend.compute(compression)
        return bent**2 * compression + coefficient * bent * speed

    def move(_: float, state: FloatArray) -> tuple[float, float]:
        return state[1], -compute_force(state[0], state[1])

    def is_over(_: float, state: FloatArray) -> float:
        return compute_force(state[0], state[1])

    def is_apart(_: float, state: FloatArray) -> float:
        return float(state[0])

    for event in (is_over, is_apart):
        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        move,
        (0.0, 100.0),
        (0.0, 1.0),
        method="DOP853",
        events=(is_over, is_apart),
        rtol=1e-10,
        atol=1e-10,
    )
    return float(found.t[-1]), float(-found.y[1, -1])
