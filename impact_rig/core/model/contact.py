"""The contact as one linear system without input, for many impacts at once.

F(t) = F0 sin^2(pi t / tau_p) is a constant and a cosine. Both are solutions of linear equations
themselves, so that with them in the state z nothing but dz/dphi = N z is left, with the angle
phi = w t, w = 2 pi / tau_p, and z(phi) = e^(N phi) z(0). Positions count as x w^2 and velocities
as x' w, which makes accelerations [m/s^2] of them all, and N a matrix without units.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.model.propagation import exponentiate, propagate_output
from impact_rig.core.signals.record import FloatArray

FULL_TURN = 2.0 * np.pi
"""phi at the end of the contact [rad]."""

K1, K12, K2, C1, C12, C2, MASSES, ONE = range(8)
"""Numbers of a model [-]: k1 / m1, k1 / m2 and k2 / m2 over w^2, c1 / m1, c1 / m2 and c2 / m2 over
w, m2 / m1, and 1."""
NUMBERS = 8


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
    entries : ndarray, shape (8, (d + 2) d)
        The sum of these times a model's numbers is N, and below it the readout of the
        accelerations of hammer and sample.
    """

    moving: slice
    size: int
    entries: FloatArray

    @staticmethod
    def make(moving: slice, readout: FloatArray) -> "ContactSystem":
        """Complete N, of which accelerations are rows, shape (8, 2, d)."""
        size = readout.shape[2]
        bodies = (size - 3) // 2
        entries = np.zeros((NUMBERS, size + 2, size))
        for body in range(bodies):
            entries[ONE, body, bodies + body] = 1.0
        entries[:, bodies : 2 * bodies] = readout[:, moving]
        entries[ONE, size - 2, size - 1], entries[ONE, size - 1, size - 2] = -1.0, 1.0
        entries[:, size:] = readout
        return ContactSystem(moving, size, entries.reshape(NUMBERS, -1))


def _make_printed() -> ContactSystem:
    """Couple both bodies, with the force on the second and a minus before it: equation (1)."""
    readout = np.zeros((NUMBERS, 2, 7))
    for on_first, on_second, own, places in ((K1, K12, K2, (0, 1)), (C1, C12, C2, (2, 3))):
        readout[on_first, 0, places] = -1.0, 1.0
        readout[on_second, 1, places] = 1.0, -1.0
        readout[own, 1, places[1]] = -1.0
    readout[ONE, 1, 4:6] = -1.0, 1.0
    return ContactSystem.make(slice(0, 2), readout)


def _make_driven() -> ContactSystem:
    """Let the hammer show the force, and rest afterwards; the sample alone is driven by it."""
    readout = np.zeros((NUMBERS, 2, 5))
    readout[MASSES, 0, 2:4] = -1.0, 1.0
    readout[K2, 1, 0] = readout[C2, 1, 1] = -1.0
    readout[ONE, 1, 2:4] = 1.0, -1.0
    return ContactSystem.make(slice(1, 2), readout)


PRINTED, DRIVEN = _make_printed(), _make_driven()


def simulate_contacts(
    system: ContactSystem,
    numbers: FloatArray,
    drives: FloatArray,
    angles: FloatArray,
    last_blocks: NDArray[np.intp],
    count: int,
) -> tuple[FloatArray, FloatArray]:
    """Compute accelerations during the contact, and what moves at its end.

    Parameters
    ----------
    system : ContactSystem
        How the bodies are driven.
    numbers : ndarray, shape (8, models)
        `K1` to `ONE` [-].
    drives : ndarray, shape (2, models)
        The hammer's v1 w and the force's F0 / (2 m2) [m/s^2].
    angles : ndarray, shape (3, models)
        phi at the first point, what is left from the last blocks' first points to the end of the
        contact, and phi from point to point [rad].
    last_blocks : ndarray of int, shape (models,)
        From which of the blocks of `propagate_output` the end is reached.
    count : int
        Number of points, one or more; those beyond the contact mean nothing.

    Returns
    -------
    accelerations : ndarray, shape (models, 2, count)
        x1'' and x2'' [m/s^2].
    state : ndarray, shape (models, 2, bodies)
        x w^2 and x' w of the bodies that move, at the end of the contact [m/s^2].
    """
    models, size = numbers.shape[1], system.size
    entries = (numbers.T @ system.entries).reshape(models, size + 2, size)
    powers = exponentiate(angles[:, :, np.newaxis, np.newaxis] * entries[:, :size])
    bodies = (size - 3) // 2
    initial = np.zeros((models, size, 1))
    initial[:, bodies, 0], initial[:, -3:-1, 0] = drives[0], drives[1][:, np.newaxis]
    first = powers[0] @ initial
    values, states = propagate_output(powers[2], first[..., 0], entries[:, size:], count)
    last = powers[1] @ states[np.arange(models), :, last_blocks][..., np.newaxis]
    return values, last[:, : 2 * bodies].reshape(models, 2, bodies)
