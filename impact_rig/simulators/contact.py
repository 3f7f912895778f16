"""One contact as engines are to show it: two free bodies that meet at a measured speed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.errors import ParameterError
from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.model.contact_law import compute_pulses
from impact_rig.core.origin import UNSTATED, Origin, join_origins
from impact_rig.core.signals.record import FloatArray
from impact_rig.results.campaign import Results

SPEED_ROUNDING = 1e-3
"""Part of a measured speed by which another may lie outside [-], our choice: as printed."""


@dataclass(frozen=True)
class Contact:
    """Two free bodies, the speed at which they meet, and what the identified law says of it.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    hammer_mass, sample_mass : float
        The sample's with its accelerometer [kg].
    speed : float
        Towards each other at first touch [m/s].
    exponent, stiffness, damping : float
        n [-], k [N/m^n] and alpha [s/m] of F = k delta^n (1 + alpha delta').
    duration : float
        From first touch to separation [s].
    restitution : float
        Speed of separation over impact speed [-]; 1 where noise makes it seem to be more.
    peak_force : float
        [N]
    duration_expanded, restitution_expanded : float
        Half-widths of the 95 % intervals of the measured ones [s], [-]; NaN: not determined.
    origin : Origin
        Of the hits that it was identified from.
    """

    sample: str
    hammer_mass: float
    sample_mass: float
    speed: float
    exponent: float
    stiffness: float
    damping: float
    duration: float
    restitution: float
    peak_force: float
    duration_expanded: float = math.nan
    restitution_expanded: float = math.nan
    origin: Origin = UNSTATED

    @property
    def equivalent_mass(self) -> float:
        """m1 m2 / (m1 + m2) [kg]."""
        return self.hammer_mass * self.sample_mass / (self.hammer_mass + self.sample_mass)

    @property
    def peak_indentation(self) -> float:
        """Largest approach of the bodies after first touch [m]."""
        pulse = compute_pulses(np.array([self.exponent]), np.array([self.damping * self.speed]))
        return self.speed * self.time_scale * float(pulse.largest_compression[0])

    @property
    def time_scale(self) -> float:
        """T of `impact_rig.core.model.contact_law` [s]."""
        power = self.exponent + 1.0
        stiffness = self.stiffness * self.speed ** (self.exponent - 1.0)
        return float((self.equivalent_mass / stiffness) ** (1.0 / power))

    def at_speed(self, speed: float) -> "Contact":
        """Return the same contact at another speed [m/s], as the law has it."""
        moved = replace(self, speed=speed)
        pulse = compute_pulses(np.array([self.exponent]), np.array([self.damping * speed]))
        scale = moved.time_scale
        return replace(
            moved,
            duration=scale * float(pulse.duration[0]),
            restitution=min(1.0, float(pulse.restitution[0])),
            peak_force=self.equivalent_mass * speed / scale * float(pulse.compute_peak_force()[0]),
        )

    def compute_force(self, time: FloatArray) -> FloatArray:
        """Return the law's force [N] over time from first touch [s], shape (n,)."""
        pulse = compute_pulses(np.array([self.exponent]), np.array([self.damping * self.speed]))
        (force,), _ = pulse.compute_force(time / self.time_scale)
        return self.equivalent_mass * self.speed / self.time_scale * force


@dataclass(frozen=True)
class MeasuredContacts:
    """The contacts of one sample, by impact speed: at each of these speeds it was struck."""

    contacts: tuple[Contact, ...]

    @property
    def speeds(self) -> tuple[float, float]:
        """The lowest and the highest [m/s]."""
        return self.contacts[0].speed, self.contacts[-1].speed

    def at_speed(self, speed: float | None = None) -> Contact:
        """Return the contact at a speed, its law between those of the speeds around it.

        Parameters
        ----------
        speed : float, optional
            [m/s]; otherwise the one of the measured speeds that is in their middle.

        Raises
        ------
        ParameterError
            If it is outside what was measured.
        """
        if speed is None:
            return self.contacts[len(self.contacts) // 2]
        lowest, highest = self.speeds
        if not (lowest - SPEED_ROUNDING * lowest <= speed <= highest + SPEED_ROUNDING * highest):
            raise ParameterError(
                f"{1e3 * speed:.4g} mm/s is outside what was measured on"
                f" {self.contacts[0].sample!r}, {self.describe_speeds()}: strike it at that speed"
                " as well, or choose one that was measured"
            )
        known = [item.speed for item in self.contacts]
        logarithms = [math.log(item.stiffness) for item in self.contacts]
        nearest = min(self.contacts, key=lambda item: abs(item.speed - speed))
        law = replace(
            nearest,
            exponent=float(np.interp(speed, known, [item.exponent for item in self.contacts])),
            stiffness=math.exp(float(np.interp(speed, known, logarithms))),
            damping=float(np.interp(speed, known, [item.damping for item in self.contacts])),
        )
        return law.at_speed(speed)

    @property
    def origin(self) -> Origin:
        """Of all hits that they were identified from."""
        return join_origins(contact.origin for contact in self.contacts)

    def describe_speeds(self) -> str:
        """Return the measured speeds in words."""
        lowest, highest = self.speeds
        if len(self.contacts) == 1:
            return f"{1e3 * lowest:.2f} mm/s"
        return f"{1e3 * lowest:.2f} to {1e3 * highest:.2f} mm/s"


def make_contacts(
    campaigns: Sequence[Results], sample: str, hammer_mass: float | None = None
) -> MeasuredContacts:
    """Return the contacts of one sample in campaigns, which may have struck at several speeds.

    Parameters
    ----------
    campaigns : sequence of Results
        At least one.
    sample : str
        Its name, with a release angle that series alone.
    hammer_mass : float, optional
        Of the body that is to strike in place of the hammer [kg]: the law stays, duration and
        force follow from it.

    Raises
    ------
    ParameterError
        If no campaign has hits on the sample, or none identified its law and all it needs.
    """
    contacts, reasons = [], []
    for results in campaigns:
        for estimate in results.samples:
            struck = results.setup.samples.find(estimate.name)
            if sample not in (struck.name, struck.body):
                continue
            law = estimate.contact_law
            striker = results.setup.hammer_mass if hammer_mass is None else hammer_mass
            if reason := _find_obstacle(law):
                reasons.append(reason)
                continue
            moving = results.setup.samples.get_moving_mass(struck.name)
            contact = _make_contact(sample, law, striker, moving)
            contacts.append(replace(contact, origin=results.find_origin(struck.name)))
    if contacts:
        return MeasuredContacts(tuple(sorted(contacts, key=lambda contact: contact.speed)))
    if reasons:
        raise ParameterError(f"sample {sample!r} has no identified contact law: {reasons[0]}")
    names = dict.fromkeys(item.name for results in campaigns for item in results.samples)
    raise ParameterError(
        f"there is no result of sample {sample!r}: there are some of"
        f" {', '.join(map(repr, names)) or 'none'}"
    )


def _find_obstacle(law: ContactLaw) -> str:
    """Return why a law makes no parameters; empty: it does."""
    if not law.is_known:
        return "; ".join(law.notes) or "none was looked for"
    if not (law.stiffness.is_known and law.impact_speed.is_known):
        return "; ".join(note for note in law.notes if "mass" in note) or "a mass is not known"
    return ""


def _make_contact(sample: str, law: ContactLaw, hammer: float, moving: float) -> Contact:
    bare = Contact(
        sample=sample,
        hammer_mass=hammer,
        sample_mass=moving,
        speed=law.impact_speed.value,
        exponent=law.exponent.value,
        stiffness=law.stiffness.value,
        damping=law.damping.value,
        duration=math.nan,
        restitution=math.nan,
        peak_force=math.nan,
        duration_expanded=law.duration.expanded,
        restitution_expanded=law.restitution.expanded,
    )
    return bare.at_speed(bare.speed)
