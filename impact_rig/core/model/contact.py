"""The contact as one linear system without input, for many impacts at once.

F(t) = F0 sin^2(pi t / tau_p) is a constant and a cosine. Both are solutions of linear equations
themselves, so that with them in the state z nothing but dz/dn = A z is left, where n counts
points. With w = 2 pi / tau_p and d = w dt, the angle from point to point, positions count as
x w^2 / d, velocities as x' w / d, and forces over the sample's mass and d. All entries of A are
then numbers times d, and rows of it are accelerations, too [m/s^2].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.model.propagation import Moments, simulate_linear_systems
from impact_rig.core.signals.record import FloatArray

FULL_TURN = 2.0 * np.pi
"""phi at the end of the contact [rad]."""

K1, K12, K2, C1, C12, C2, MASSES, ANGLE, SPEED, FORCE = range(10)
"""Numbers of a model. d [rad] times k1 / m1, k1 / m2 and k2 / m2 over w^2, times c1 / m1, c1 / m2
and c2 / m2 over w, times m2 / m1, and d itself; and what drives it [m/s^2]: the hammer's v1 w / d,
and the force's F0 / (2 m2 d)."""
NUMBERS = 10


@dataclass(frozen=True)
class ContactSystem:
    """How one variant of the model moves during the contact.

    The state is positions, velocities, and the force's constant, cosine and sine.

    Attributes
    ----------
    moving : slice
        The bodies in the state, of hammer and sample.
    size : int
        Of the state, d.
    entries : ndarray, shape (10, (d + 3) d)
        A model's numbers times these are A, below it the readout of the accelerations of hammer
        and sample, and the state at the start.
    """

    moving: slice
    size: int
    entries: FloatArray

    @staticmethod
    def make(moving: slice, readout: FloatArray) -> "ContactSystem":
        """Complete A, of which accelerations are rows, shape (10, 2, d)."""
        size = readout.shape[2]
        bodies = (size - 3) // 2
        entries = np.zeros((NUMBERS, size + 3, size))
        for body in range(bodies):
            entries[ANGLE, body, bodies + body] = 1.0
        entries[:, bodies : 2 * bodies] = readout[:, moving]
        entries[ANGLE, size - 2, size - 1], entries[ANGLE, size - 1, size - 2] = -1.0, 1.0
        entries[:, size:-1] = readout
        entries[SPEED, -1, bodies] = entries[FORCE, -1, -3] = entries[FORCE, -1, -2] = 1.0
        return ContactSystem(moving, size, entries.reshape(NUMBERS, -1))


def _make_printed() -> ContactSystem:
    """Couple both bodies, with the force on the second and a minus before it: equation (1)."""
    readout = np.zeros((NUMBERS, 2, 7))
    for on_first, on_second, own, places in ((K1, K12, K2, (0, 1)), (C1, C12, C2, (2, 3))):
        readout[on_first, 0, places] = -1.0, 1.0
        readout[on_second, 1, places] = 1.0, -1.0
        readout[own, 1, places[1]] = -1.0
    readout[ANGLE, 1, 4:6] = -1.0, 1.0
    return ContactSystem.make(slice(0, 2), readout)


def _make_driven() -> ContactSystem:
    """Let the hammer show the force, and rest afterwards; the sample alone is driven by it."""
    readout = np.zeros((NUMBERS, 2, 5))
    readout[MASSES, 0, 2:4] = -1.0, 1.0
    readout[K2, 1, 0] = readout[C2, 1, 1] = -1.0
    readout[ANGLE, 1, 2:4] = 1.0, -1.0
    return ContactSystem.make(slice(1, 2), readout)


PRINTED, DRIVEN = _make_printed(), _make_driven()


def simulate_contacts(
    system: ContactSystem,
    numbers: Sequence[tuple[float, ...]],
    moments: Sequence[Moments],
    count: int,
) -> tuple[FloatArray, FloatArray]:
    """Compute accelerations during the contact, and what moves at its end.

    Parameters
    ----------
    system : ContactSystem
        How the bodies are driven.
    numbers : sequence of tuple of float
        Of each model: `K1` to `FORCE`.
    moments : sequence of Moments
        Of each model: its first point and the end of the contact, from the start of the contact.
    count : int
        Number of points, one or more; those beyond the contact mean nothing.

    Returns
    -------
    accelerations : ndarray, shape (models, 2, count)
        x1'' and x2'' [m/s^2].
    state : ndarray, shape (models, 2 * bodies)
        x w^2 / d, then x' w / d of the bodies that move, at the end of the contact [m/s^2].
    """
    size = system.size
    entries = (np.array(numbers) @ system.entries).reshape(-1, size + 3, size)
    values, ends = simulate_linear_systems(
        entries[:, :size], entries[:, -1], entries[:, size:-1], moments, count
    )
    return values, ends[:, : size - 3]
