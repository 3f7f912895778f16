"""The sample driven by a pulse of any shape, where the model knows the versed-sine alone.

The versed-sine has a closed form in the core. For the other shapes the force is taken as linear
between the points of a fine grid over the contact, for which the answer of a linear system is
exact (first-order hold); afterwards the sample is left alone, again exact.
"""

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import cont2discrete, lfilter, ss2tf

from impact_rig.core.model.impact import ImpactModel
from impact_rig.core.model.oscillator import (
    FreeOscillator,
    find_padding,
    simulate_free_oscillators,
)
from impact_rig.core.model.pulses import PulseShape, compute_pulse
from impact_rig.core.signals.record import FloatArray

CONTACT_STEPS = 4096
"""Points of the grid over a contact [-]. A force F bends by pi^2 F0 / tau_p^2 at most where it is
large, so that a straight line misses it by 7e-8 of F0; what that does to the sample is less. The
kinks of the shapes, at start, top and end, are points of the grid."""


def simulate_driven(
    model: ImpactModel, shape: PulseShape, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Simulate both bodies: the hammer's trace is the pulse, the sample is driven by it alone.

    Parameters
    ----------
    model : ImpactModel
        m1, F0, tau_p and the sample are used.
    shape : PulseShape
        Of the force.
    sampling_rate : float
        [Hz]
    count : int
        Number of points.
    start : float
        Time of the first point from the start of the contact [s].

    Returns
    -------
    hammer, specimen : ndarray, shape (count,)
        [m/s^2], signed as those of `simulate_impact`; within 1e-6 of the peak.
    """
    time = start + np.arange(count) / sampling_rate
    force = model.peak_force * compute_pulse(time, model.contact_time, shape)
    body = model.specimen
    matrix = np.array(
        [[0.0, 1.0], [-body.stiffness / body.mass, -body.damping_coefficient / body.mass]]
    )
    grid = np.linspace(0.0, model.contact_time, CONTACT_STEPS + 1)
    position, speed = _drive(
        matrix, model.peak_force * compute_pulse(grid, model.contact_time, shape) / body.mass, grid
    )
    record = np.zeros(count + find_padding(count))
    specimen = record[:count]
    inside = (time >= 0.0) & (time <= model.contact_time)
    specimen[inside] = force[inside] / body.mass + matrix[1] @ np.stack(
        [position(time[inside]), speed(time[inside])]
    )
    free = int(np.searchsorted(time, model.contact_time, side="right"))
    if free < count:
        oscillator = FreeOscillator(
            stiffness=-matrix[1, 0] / sampling_rate**2,
            damping=-matrix[1, 1] / sampling_rate,
            position=float(position(model.contact_time)) * sampling_rate**2,
            speed=float(speed(model.contact_time)) * sampling_rate,
            first=(time[free] - model.contact_time) * sampling_rate,
        )
        simulate_free_oscillators([oscillator], count - free, [record[np.newaxis, free:]])
    return -force / model.hammer.mass, specimen


def _drive(
    matrix: FloatArray, drive: FloatArray, grid: FloatArray
) -> tuple[CubicHermiteSpline, CubicHermiteSpline]:
    """Return position [m] and speed [m/s] over the contact, from rest, as functions of time.

    Parameters
    ----------
    matrix : ndarray, shape (2, 2)
        Of the state (x, x') [1/s].
    drive : ndarray, shape (n,)
        Force over mass on the grid [m/s^2].
    grid : ndarray, shape (n,)
        Uniform [s].
    """
    # In units of the contact time, so that the polynomials below are well scaled.
    length = float(grid[-1])
    scaled = np.array([[0.0, 1.0], [matrix[1, 0] * length**2, matrix[1, 1] * length]])
    step = 1.0 / (grid.size - 1)
    discrete = cont2discrete(
        (scaled, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1))), step, method="foh"
    )
    numerators, denominator = ss2tf(*discrete[:4])
    position, speed = (lfilter(row, denominator, drive * length**2) for row in numerators)
    speed = speed / length
    acceleration = drive + matrix[1, 0] * position + matrix[1, 1] * speed
    return (
        CubicHermiteSpline(grid, position, speed),
        CubicHermiteSpline(grid, speed, acceleration),
    )
