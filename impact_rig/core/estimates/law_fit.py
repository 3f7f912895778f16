"""Contact laws fitted to the hammer's pulse: all forms to the mean, the best to every hit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.estimates.law_pulses import (
    EXPONENTS,
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
MODELS: tuple[tuple[LossForm, int | None], ...] = (
    (LossForm.PROPORTIONAL, PULL),
    (LossForm.PLATE, PULL),
    (LossForm.LINEAR, None),
    (LossForm.ROOT, None),
    (LossForm.FOURTH_ROOT, None),
    (LossForm.DASHPOT, None),
    *4 * ((LossForm.MEMORY, PULL),),
)
"""What is fitted to the mean pulse: forms, and the place of the loss that is not varied."""
FIRST_RATES = (0.05, 0.3, 0.6, 0.85)
"""Second losses at which a part that relaxes is looked for [-]."""


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
    """Return parameters of pulses and their shapes at `_SHAPE_TIMES`, shape (models, starts, ...).

    Each pulse is of the window's width, middle and peak.
    """
    pulls = np.zeros((len(MODELS), 3))
    pulls[[held is None for _, held in MODELS]] = (0.1, 0.25, 0.5)
    pulls[-len(FIRST_RATES) :] = np.array(FIRST_RATES)[:, np.newaxis]
    model, exponent, loss, number = (
        axis.ravel()
        for axis in np.meshgrid(
            np.arange(len(MODELS)),
            exponents,
            (0.01, 0.05, 0.15, 0.35, 0.7),
            np.arange(pulls.shape[1]),
            indexing="ij",
        )
    )
    forms, pull = find_places(form for form, _ in MODELS)[model], pulls[model, number]
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
    split = len(MODELS), -1
    return make_read_only(starts.reshape(*split, COUNT)), make_read_only(
        shapes.reshape(*split, _SHAPE_TIMES.size)
    )


def _find_starts(window: PulseWindow, exponent: float | None) -> FloatArray:
    """Return where to begin with each of `MODELS`: at the nearest of its pulses.

    From a loss that is far off, some searches end at a pulse without loss.
    """
    exponents = (0.9, 1.05, 1.2, 1.5, 1.8, 2.2, 2.8)
    starts, shapes = _tabulate_starts(exponents if exponent is None else (exponent,))
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
    start, time, height, offset, *_ = parameters.T[..., np.newaxis]
    loss, pull, exponent = parameters[:, LOSS:].T
    pulses = compute_pulses(exponent, loss, pull, forms)
    spacing = window.model_time[1] - window.model_time[0]
    reach = min(spacing, FINEST) / 2.0
    ends = start[:, 0] + time[:, 0] * pulses.duration
    part = window.find_part(float(start.min()) - reach, float(ends.max()) + reach)
    shown_time = window.model_time[part]
    # Fine points have their edges in common.
    last = shown_time[-1:] if spacing <= FINEST else shown_time
    edges = np.concatenate((shown_time - reach, last + reach))
    impulse = pulses.compute_impulse((edges - start) / time)
    force = impulse[..., -shown_time.size :] - impulse[..., : shown_time.size]
    force *= time / (2.0 * reach)
    rows = np.zeros((len(parameters), COUNT, shown_time.size))
    rows[:, START] = -height * np.gradient(force[0], spacing, axis=1)
    rows[:, TIME] = rows[:, START] * (shown_time - start) / time
    rows[:, HEIGHT] = force[0]
    rows[:, LOSS:] = (height * force[1:]).swapaxes(0, 1)
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
    bounds[..., EXPONENT] = [[limit] for limit in EXPONENTS] if exponent is None else exponent
    return bounds


@dataclass(frozen=True)
class FittedLoss:
    """One model of the loss, fitted to the mean pulse."""

    form: LossForm
    held: int | None  # place of the loss that is not varied; None: both are
    fit: WindowFit

    @property
    def is_mixed(self) -> bool:
        """Whether a loss δⁿ δ' stands beside the form's own."""
        return self.held is None and self.form is not LossForm.MEMORY

    @property
    def name(self) -> str:
        """Its terms."""
        alone = self.form.value
        return f"{LossForm.PROPORTIONAL.value} + {alone}" if self.is_mixed else alone


def fit_losses(window: PulseWindow, exponent: float | None) -> list[FittedLoss]:
    """Fit all models of the loss to the window's pulse; n [-] is given, or found."""

    def fit(models: Sequence[tuple[LossForm, int | None]], starts: FloatArray) -> list[FittedLoss]:
        measured = np.broadcast_to(window.measured, (len(models), window.measured.size))
        # A form that leaves ten times as much as the best is of no use.
        fits = fit_models(window, measured, models, starts, exponent, most=10.0)
        return [FittedLoss(*model, found) for model, found in zip(models, fits, strict=True)]

    found = fit(MODELS, _find_starts(window, exponent))
    rates = len(FIRST_RATES)
    # What relaxes fast and what relaxes slowly are two valleys: the search begins in the deeper.
    first = min(found[-rates:], key=lambda item: item.fit.residual)
    found[-rates:] = [first]
    # What leaves three times as much as another is none, however fast it relaxes.
    if first.fit.residual < 3.0 * min(item.fit.residual for item in found):
        found[-1:] = fit([(LossForm.MEMORY, None)], first.fit.parameters[np.newaxis])
    named = [item for item in found if item.is_mixed and item.form is not LossForm.LINEAR]
    return found + [FittedLoss(item.form, LOSS, _hold(item.fit, LOSS)) for item in named]


def fit_models(
    window: PulseWindow,
    measured: FloatArray,
    models: Sequence[tuple[LossForm, int | None]],
    starts: FloatArray,
    exponent: float | None,
    most: float = math.inf,
) -> list[WindowFit]:
    """Fit one model to each pulse, shape (k, n); a loss that is held stays where it starts."""
    forms = [form for form, _ in models]
    places, bounds = find_places(forms), _find_bounds(forms, exponent)
    for row, (_, held) in enumerate(models):
        if held is not None:
            bounds[:, row, held] = starts[row, held]

    def evaluate(parameters: FloatArray, which: NDArray[np.intp]) -> Evaluation:
        return evaluate_laws(window, measured[which], parameters, places[which])

    return fit_window(measured, evaluate, starts, bounds, most)


def _hold(fit: WindowFit, place: int) -> WindowFit:
    """Return a fit with one parameter at 0, to first order."""
    covariance = fit.compute_covariance(np.ones(1))
    moved = -fit.parameters[place] / max(covariance[place, place], 1e-300) * covariance[place]
    fitted = fit.fitted + moved @ fit.jacobian
    parameters, jacobian = fit.parameters + moved, fit.jacobian.copy()
    parameters[place] = jacobian[place] = 0.0
    return WindowFit(parameters, jacobian, fit.is_inside, fitted, math.nan)


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
