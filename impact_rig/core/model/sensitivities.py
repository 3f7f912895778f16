"""How the model's traces change with its parameters, in closed form.

For the driven model everything follows from one oscillator in the scaled time sigma = t / tau_p,

    X'' + D X' + K X = (1 - cos 2 pi sigma) / 2,   K = k2 tau_p^2 / m2,   D = c2 tau_p / m2,

with the sample's acceleration F0 / m2 X''. Its derivative Y = dX/dK obeys the same equation
driven by -X, and dX/dD = Y' since -X' is what drives it and everything starts at rest. So four
states and the three of the force give the trace and all its derivatives by one e^(At).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.impact import ImpactModel, ModelVariant
from impact_rig.core.model.printed_sensitivities import compute_printed_sensitivities
from impact_rig.core.model.propagation import propagate
from impact_rig.core.signals.record import FloatArray

DRIVEN_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0")
PRINTED_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0", "k1", "c1")
FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Sensitivities:
    """Accelerations of both bodies and their derivatives.

    Attributes
    ----------
    names : tuple of str
        Parameters: contact time tau_p [s], start of the contact t0 [s], k2 [N/m], c2 [N s/m],
        F0 [N]; for the printed model also k1 [N/m] and c1 [N s/m].
    traces : ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    derivatives : ndarray, shape (2, parameters, n)
        Of the traces [m/s^2 per unit of the parameter]. For t0: the contact moves later.
    """

    names: tuple[str, ...]
    traces: FloatArray
    derivatives: FloatArray


def find_parameter_names(variant: ModelVariant) -> tuple[str, ...]:
    """Return the parameters of a model variant, in the order of the derivatives."""
    return DRIVEN_PARAMETERS if variant is ModelVariant.DRIVEN else PRINTED_PARAMETERS


def compute_sensitivities(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.DRIVEN,
) -> Sensitivities:
    """Compute both accelerations on a uniform time grid and their derivatives.

    The arguments are those of `simulate_impact`. The driven traces are equal to its. The printed
    model steps at t = 0 and at tau_p; there the two points beside each step carry its place
    between them, with the step's area and centre kept, so that what a low-pass leaves of the
    traces is differentiable in tau_p and t0. All other points are equal.

    Raises
    ------
    ParameterError
        If the sampling rate is no positive number, or there is no point.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    if count < 1:
        raise ParameterError(f"count is {count} points: it must be 1 or more")
    if variant is ModelVariant.PRINTED:
        traces, derivatives = compute_printed_sensitivities(model, sampling_rate, count, start)
    else:
        traces, derivatives = _compute_driven_sensitivities(model, sampling_rate, count, start)
    return Sensitivities(find_parameter_names(variant), traces, derivatives)


def _compute_driven_sensitivities(
    model: ImpactModel, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    tau, force, mass = model.contact_time, model.peak_force, model.specimen.mass
    time = start + np.arange(count) / sampling_rate
    first = int(np.searchsorted(time, 0.0, side="left"))
    free = int(np.searchsorted(time, tau, side="right"))
    derivatives = np.zeros((2, len(DRIVEN_PARAMETERS), count))

    phase = time[first:free] / tau
    pulse, slope = np.sin(np.pi * phase) ** 2, np.pi * np.sin(FULL_TURN * phase)
    hammer = derivatives[0, :, first:free]
    hammer[0] = force / model.hammer.mass / tau * phase * slope
    hammer[1] = force / model.hammer.mass / tau * slope
    hammer[4] = -pulse / model.hammer.mass

    stiffness = model.specimen.stiffness * tau**2 / mass
    damping = model.specimen.damping_coefficient * tau / mass
    response = respond_to_versed_sine(stiffness, damping, time / tau, 1.0 / (sampling_rate * tau))
    acceleration, jerk, by_stiffness, by_damping = response
    specimen = derivatives[1]
    amplitude = force / mass
    specimen[0] = 2.0 * stiffness * by_stiffness + damping * by_damping - time / tau * jerk
    specimen[0] *= amplitude / tau
    specimen[1] = -amplitude / tau * jerk
    specimen[2] = amplitude * tau**2 / mass * by_stiffness
    specimen[3] = amplitude * tau / mass * by_damping
    specimen[4] = acceleration / mass
    return force * derivatives[:, 4], derivatives


def respond_to_versed_sine(
    stiffness: float, damping: float, time: FloatArray, step: float
) -> FloatArray:
    """Compute the response of an oscillator at rest to one versed-sine of unit height.

    Parameters
    ----------
    stiffness, damping : float
        K and D [-] of X'' + D X' + K X = (1 - cos 2 pi sigma) / 2 for 0 <= sigma <= 1, else 0.
    time : ndarray, shape (n,)
        sigma [-], uniform; before 0 nothing moves.
    step : float
        Of `time` [-].

    Returns
    -------
    ndarray, shape (4, n)
        X'', X''', dX''/dK and dX''/dD [-].
    """
    first = int(np.searchsorted(time, 0.0, side="left"))
    free = int(np.searchsorted(time, 1.0, side="right"))
    matrix = np.zeros((7, 7))
    matrix[0, 1] = matrix[2, 3] = 1.0
    matrix[1, 0] = matrix[3, 2] = -stiffness
    matrix[1, 1] = matrix[3, 3] = -damping
    matrix[3, 0] = -1.0
    matrix[1, 4], matrix[1, 5] = 0.5, -0.5
    matrix[5, 6], matrix[6, 5] = -FULL_TURN, FULL_TURN
    result = np.zeros((4, time.size))
    initial = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0])
    if free > first:
        powers = expm(matrix * np.array([time[first], step, 1.0])[:, np.newaxis, np.newaxis])
        states = propagate(powers[1], powers[0] @ initial, free - first)
        inside = result[:, first:free]
        _differentiate_oscillator(states, stiffness, damping, inside)
        force = 0.5 * (states[4] - states[5])
        force_slope = np.pi * states[6]
        inside[0] += force
        # X''' has -D X'' in it, and so the force as well.
        inside[1] += force_slope - damping * force
        last = powers[2] @ initial
    else:
        last = expm(matrix) @ initial
    if time.size > free:
        late = max(float(time[free]) - 1.0, 0.0)
        powers = expm(matrix[:4, :4] * np.array([late, step])[:, np.newaxis, np.newaxis])
        states = propagate(powers[1], powers[0] @ last[:4], time.size - free)
        _differentiate_oscillator(states, stiffness, damping, result[:, free:])
    return result


def _differentiate_oscillator(
    states: FloatArray, stiffness: float, damping: float, out: FloatArray
) -> None:
    """Fill X'', X''', Y'' and Y''' of the free oscillator from X, X', Y and Y'."""
    position, speed, change, change_rate = states[:4]
    out[0] = -stiffness * position - damping * speed
    out[1] = -stiffness * speed - damping * out[0]
    out[2] = -stiffness * change - damping * change_rate - position
    out[3] = -stiffness * change_rate - damping * out[2] - speed
