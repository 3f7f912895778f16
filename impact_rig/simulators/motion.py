"""Two bodies that meet in an engine: what their speeds say of the contact."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.simulators.contact import Contact

CONTACTS_LONG = 2.5
STEPS_MORE = 20
"""A run lasts so many contact durations [-] and so many steps more [-], our choice: engines that
lose their way in coarse steps are given time to let go."""
SMALLEST_FORCE = 1e-6
"""Of the largest, above which bodies are in contact [-], our choice: what engines round to."""


@dataclass(frozen=True)
class Motion:
    """The bodies' speeds after each step.

    Attributes
    ----------
    contact : Contact
        What was to be shown.
    step : float
        [s]
    speeds : ndarray, shape (1 + steps, 2)
        Of hammer and sample along the line of impact [m/s], beginning with those before contact.
    """

    contact: Contact
    step: float
    speeds: FloatArray

    @property
    def force(self) -> FloatArray:
        """Mean force in each step [N], shape (steps,): the momentum that the hammer lost."""
        return np.asarray(-self.contact.hammer_mass * np.diff(self.speeds[:, 0]) / self.step)

    @property
    def time(self) -> FloatArray:
        """Of the middle of each step [s], shape (steps,)."""
        return np.asarray((np.arange(len(self.speeds) - 1) + 0.5) * self.step)

    @property
    def duration(self) -> float:
        """Of all steps with a force [s]."""
        force = np.abs(self.force)
        return float(np.count_nonzero(force > SMALLEST_FORCE * force.max()) * self.step)

    @property
    def restitution(self) -> float:
        """Speed of separation over impact speed [-]."""
        last = self.speeds[-1]
        return float((last[1] - last[0]) / self.contact.speed)

    @property
    def peak_force(self) -> float:
        """Largest mean force of a step [N]."""
        return float(self.force.max())


def count_steps(contact: Contact, step: float) -> int:
    """Return how many steps are run."""
    return round(CONTACTS_LONG * contact.duration / step) + STEPS_MORE


def compute_gap(contact: Contact, step: float, phase: float) -> float:
    """Return the distance at which bodies start [m], to touch after `phase` of the first step."""
    return phase * contact.speed * step
