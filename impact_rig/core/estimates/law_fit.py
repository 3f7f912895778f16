"""Contact laws fitted to the hammer's pulse: all forms to the mean, the best to every hit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.estimates.law_pulses import (
    EXPONENTS,
    FORMS,
    LOSSES,
    LossForm,
    compute_pulses,
    find_places,
)
from impact_rig.core.estimates.pulse_shape import Evaluation, PulseWindow, WindowFit, fit_window
from impact_rig.core.given.records import FloatArray, make_read_only

COUNT = 7
START, TIME, HEIGHT, OFFSET, LOSS, PULL, EXPONENT = range(COUNT)
"""Places of the parameters; the last one is not varied where it is given."""
ALONE = (LossForm.PROPORTIONAL, LossForm.PLATE)
"""Forms of one term; the others are fitted beside a loss δⁿ δ'."""


STEP = 1e-4
"""Step of n and B for derivatives [-], our choice."""
FINEST = 1.0 / 64.0
"""Over which the force is averaged [w50], our choice."""
GAIN = 1e-3
"""By which e may exceed 1 [-], our choice: the fit itself may be wrong by so much."""
_SHAPE_TIMES = np.linspace(-1.2, 1.5, 55)
"""Where starts are compared with a window [w50]."""


@lru_cache(maxsize=4)
def _tabulate_starts(exponents: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Return parameters of pulses of all forms, and their shapes at `_SHAPE_TIMES`.

    Each is of the window's width, middle and peak; shapes (forms, starts, ...).
    """
    places = np.arange(len(FORMS))
    grid = np.meshgrid(
        places, exponents, (0.01, 0.05, 0.15, 0.35, 0.7), (0.1, 0.25, 0.5), indexing="ij"
    )
    forms, exponent, loss, pull = (axis.ravel() for axis in grid)
    pull = np.where(np.isin(forms, find_places(ALONE)), 0.0, pull)
    pulses = compute_pulses(exponent, loss, pull, forms)
    time = pulses.duration[:, np.newaxis] * np.linspace(0.0, 1.0, 257)
    force = pulses.compute_force(time)
    peak = force.max(axis=1)
    is_high = force > peak[:, np.newaxis] / 2.0
    first, last = (
        time.min(axis=1, where=is_high, initial=np.inf),
        time.max(axis=1, where=is_high, initial=0.0),
    )
    width, middle = last - first, (first + last) / 2.0
    starts = np.stack(
        (-middle / width, 1.0 / width, 1.0 / peak, 0.0 * loss, loss, pull, exponent), axis=1
    )
    shapes = pulses.compute_force(middle[:, np.newaxis] + width[:, np.newaxis] * _SHAPE_TIMES)
    shapes /= peak[:, np.newaxis]
    split = len(FORMS), len(forms) // len(FORMS), -1
    return make_read_only(starts.reshape(split)), make_read_only(shapes.reshape(split))


def _find_starts(window: PulseWindow, exponent: float | None) -> FloatArray:
    """Return where to begin with each form: at the nearest of some pulses, shape (forms, 7).

    From a loss that is far off, some searches end at a pulse without loss.
    """
    exponents = (0.9, 1.2, 1.5, 1.8, 2.2, 2.8) if exponent is None else (exponent,)
    starts, shapes = _tabulate_starts(exponents)
    measured = np.interp(_SHAPE_TIMES, window.time, window.measured)
    nearest = np.argmin(np.sum((shapes - measured) ** 2, axis=-1), axis=1)
    return np.asarray(starts[np.arange(len(starts)), nearest])


def evaluate_laws(
    window: PulseWindow, measured: FloatArray, parameters: FloatArray, forms: NDArray[np.intp]
) -> Evaluation:
    """Return fitted minus measured, and its derivatives in the parameters.

    The force is averaged over a point of the model's, from its impulse: it may jump, and what is
    fitted must not go in steps when the start moves from one point to the next.

    Parameters
    ----------
    measured : ndarray, shape (n,) or (k, n)
        At the window's points.
    parameters, forms : ndarray, shape (k, 7) and (k,)
        Of k models; forms by `find_places`.
    """
    start, time, height, offset, *shape = parameters.T[..., np.newaxis]
    # Of each the pulse itself, and with a little more of both losses and n.
    more, moved = STEP, np.eye(4)[1:] * STEP
    loss, pull, exponent = ((one + more).ravel() for one, more in zip(shape, moved, strict=True))
    pulses = compute_pulses(exponent, loss, pull, np.repeat(forms, 4))
    spacing = window.model_time[1] - window.model_time[0]
    reach = min(spacing, FINEST) / 2.0
    ends = start + time * pulses.duration.reshape(-1, 4)
    part = window.find_part(float(start.min()) - reach, float(ends.max()) + reach)
    shown_time = window.model_time[part]
    # Fine points have their edges in common.
    last = shown_time[-1:] if spacing <= FINEST else shown_time
    edges = np.concatenate((shown_time - reach, last + reach))
    impulse = pulses.compute_impulse(np.repeat((edges - start) / time, 4, axis=0))
    impulse = impulse.reshape(len(parameters), 4, -1)
    force = impulse[..., -shown_time.size :] - impulse[..., : shown_time.size]
    force *= (time / (2.0 * reach))[..., np.newaxis]
    rows = np.zeros((len(parameters), COUNT, shown_time.size))
    rows[:, START] = -height * np.gradient(force[:, 0], spacing, axis=1)
    rows[:, TIME] = rows[:, START] * (shown_time - start) / time
    rows[:, HEIGHT] = force[:, 0]
    rows[:, LOSS:] = (height / more)[..., np.newaxis] * (force[:, 1:] - force[:, :1])
    shown = window.show(rows, part)
    shown[:, OFFSET] = 1.0
    return height * shown[:, HEIGHT] + offset - measured, shown


def _find_bounds(forms: Sequence[LossForm], exponent: float | None) -> FloatArray:
    """Return least and largest parameters of each form, shape (2, forms, 7)."""
    bounds = np.empty((2, len(forms), COUNT))
    bounds[0], bounds[1] = -np.inf, np.inf
    # T over w50: no pulse of the family is so wide.
    bounds[0, :, TIME] = 0.05
    for place in (LOSS, PULL):
        bounds[..., place] = np.array(LOSSES)[:, np.newaxis]
    bounds[:, [form in ALONE for form in forms], PULL] = 0.0
    bounds[..., EXPONENT] = [[limit] for limit in EXPONENTS] if exponent is None else exponent
    return bounds


def fit_forms(window: PulseWindow, exponent: float | None) -> list[WindowFit]:
    """Fit every form to the window's pulse; n [-] is given, or found."""
    return fit_window(
        window.measured,
        lambda parameters, which: evaluate_laws(window, window.measured, parameters, which),
        _find_starts(window, exponent),
        _find_bounds(FORMS, exponent),
        # A form that leaves ten times as much as the best is of no use.
        most=10.0,
    )


@dataclass(frozen=True)
class FittedLoss:
    """One model of the loss, fitted to the mean pulse."""

    form: LossForm
    is_mixed: bool  # a loss δⁿ δ' stands beside it
    fit: WindowFit

    @property
    def name(self) -> str:
        """Its terms."""
        alone = self.form.value
        return f"{LossForm.PROPORTIONAL.value} + {alone}" if self.is_mixed else alone

    @property
    def held(self) -> int | None:
        """Place of the parameter that is 0; None: all are varied."""
        if self.is_mixed:
            return None
        return PULL if self.form in ALONE else LOSS


def list_losses(fits: Sequence[WindowFit]) -> list[FittedLoss]:
    """Return all models of the loss by the fits of `fit_forms`: of one term, and of two."""
    found = [
        FittedLoss(form, form not in ALONE, fit) for form, fit in zip(FORMS, fits, strict=True)
    ]
    mixed = [item for item in found if item.is_mixed]
    named = [item for item in mixed if item.form is not LossForm.LINEAR]
    return found + [replace(it, is_mixed=False, fit=_hold(it.fit, LOSS)) for it in named]


def _hold(fit: WindowFit, place: int) -> WindowFit:
    """Return a fit with one parameter at 0, to first order."""
    covariance = fit.compute_covariance(np.ones(1))
    moved = -fit.parameters[place] / max(covariance[place, place], 1e-300) * covariance[place]
    fitted = fit.fitted + moved @ fit.jacobian
    parameters, jacobian = fit.parameters + moved, fit.jacobian.copy()
    parameters[place] = jacobian[place] = 0.0
    return WindowFit(parameters, jacobian, fit.is_inside, fitted, math.nan)


def fit_hits(
    window: PulseWindow,
    measured: FloatArray,
    loss: FittedLoss,
    start: FloatArray,
    exponent: float | None,
) -> list[WindowFit]:
    """Fit one model of the loss to the pulse of every hit.

    Parameters
    ----------
    measured : ndarray, shape (hits, n)
        At the window's points, in units of the mean's peak.
    start : ndarray, shape (hits, 7)
        Where to begin.
    """
    (place,) = find_places([loss.form])
    bounds = np.repeat(_find_bounds([loss.form], exponent), len(start), axis=1)
    if loss.held is not None:
        bounds[..., loss.held] = 0.0
    return fit_window(
        measured,
        lambda parameters, which: evaluate_laws(
            window, measured[which], parameters, np.full(which.size, place)
        ),
        start,
        bounds,
    )


SMALL_PART = 0.15
"""Probability below which a form of loss is not named [-], our choice."""


NEAREST = 3e-5
"""RMS over the peak to which a contact follows any law, and the tables do [-], our choice."""


TERM = 1.0 / 7.0
"""How probable a second term is before the pulse is seen, over one [-]: that of Bayes' information
criterion with some 50 points (Kass and Raftery 1995)."""


def weigh_losses(
    residuals: FloatArray, before: FloatArray, noise: float, correlation: FloatArray
) -> FloatArray:
    """Return how probable each model is by what it leaves of the pulse, shape (models,).

    Parameters
    ----------
    residuals : ndarray, shape (models, n)
        Over the peak [-].
    before : ndarray, shape (models,)
        How probable each is without the pulse.
    noise : float
        Of the trace, over the peak [-].
    correlation : ndarray
        Of the noise from 0 points on, over its variance [-].
    """
    squares, count = np.sum(residuals**2, axis=1), residuals.shape[1]
    squares = np.where(before > 0.0, squares, np.inf)
    white = noise**2 * (2.0 * float(correlation.sum()) - 1.0)
    # What is left beyond noise is of one piece: it counts as one point.
    misfit = max(squares.min() / (count - COUNT) - 2.0 * noise**2, 0.0) * count
    scale = white + misfit + count * NEAREST**2
    weights = before * np.exp((squares.min() - squares) / (2.0 * scale))
    return np.asarray(weights / weights.sum())
