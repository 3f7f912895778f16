"""Equations (1) and (2) stepped through time by `scipy.integrate.solve_ivp`: the model's peer."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from impact_rig.core.model.impact import ImpactModel, ModelVariant
from impact_rig.core.signals.record import FloatArray

METHOD = "DOP853"
TOLERANCE = 1e-10
"""Relative, of each state [-]; as asked for."""
SMALLEST = 1e-17
"""The same, absolute [m, m/s], our choice: small enough that `TOLERANCE` alone decides, even where
a state passes through zero."""
SCALES = (1e-6, 1e-6, 1e-2, 1e-2)
"""Of x1, x2, x1' and x2' in the paper's impacts [m, m/s]: who knows them asks for `TOLERANCE` of
these, and has a third fewer steps."""

Motion = Callable[[float | FloatArray, FloatArray], FloatArray]
"""Takes a time [s] and x1, x2, x1', x2', and returns their rates; many moments at once too."""


def integrate_impact(
    model: ImpactModel,
    times: FloatArray,
    variant: ModelVariant,
    absolute: float | Sequence[float] = SMALLEST,
) -> FloatArray:
    """Return the accelerations of both bodies as an integrator finds them.

    In two parts, since an integrator does not see the end of the pulse coming.

    Parameters
    ----------
    model : ImpactModel
        Parameters.
    times : ndarray, shape (n,)
        From the start of the contact, rising, some of them after its end [s].
    variant : ModelVariant
        How the bodies are driven.
    absolute : float or sequence of float
        Absolute tolerance, of each state or of all [m, m/s].

    Returns
    -------
    ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    """
    contact, free = _make_motions(model, variant)
    tau = model.contact_time
    during, after = times[times <= tau], times[times > tau]
    speed = model.impact_speed if variant is ModelVariant.PRINTED else 0.0
    begin = np.array([0.0, 0.0, speed, 0.0])
    states = _step(contact, begin, np.append(during, tau), 0.0, absolute)
    later = _step(free, states[:, -1], after, tau, absolute)
    return np.hstack([contact(during, states[:, :-1])[2:], free(after, later)[2:]])


def _make_motions(model: ImpactModel, variant: ModelVariant) -> tuple[Motion, Motion]:
    """Return the rates of the states during the contact and after it."""
    first, second, tau = model.hammer, model.specimen, model.contact_time
    m1, k1, c1 = first.mass, first.stiffness, first.damping_coefficient
    m2, k2, c2 = second.mass, second.stiffness, second.damping_coefficient
    peak, is_printed = model.peak_force, variant is ModelVariant.PRINTED

    def contact(moment: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        force = peak * np.sin(np.pi * moment / tau) ** 2
        own = c2 * v2 + k2 * x2
        if is_printed:
            between = c1 * (v1 - v2) + k1 * (x1 - x2)
            return np.array([v1, v2, -between / m1, (between - force - own) / m2])
        return np.array([v1, v2, -force / m1, (force - own) / m2])

    def free(_: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        hammer = -(c1 * v1 + k1 * x1) / m1 if is_printed else 0.0 * v1
        return np.array([v1, v2, hammer, -(c2 * v2 + k2 * x2) / m2])

    return contact, free


def _step(
    motion: Motion,
    state: FloatArray,
    times: FloatArray,
    begin: float,
    absolute: float | Sequence[float],
) -> FloatArray:
    solution = solve_ivp(
        motion,
        (begin, times[-1]),
        state,
        method=METHOD,
        t_eval=times,
        rtol=TOLERANCE,
        atol=absolute,
    )
    states: FloatArray = solution.y
    return states
