"""Contact laws fitted to the hammer's pulse: all forms to the mean, the best to every hit."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.estimates.law_pulses import (
    EXPONENTS,
    LOSSES,
    MEMORY,
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
    (LossForm.ROOT, LOSS),
    (LossForm.FOURTH_ROOT, LOSS),
    (LossForm.DASHPOT, LOSS),
    (LossForm.MEMORY, None),
)
"""What is fitted to the mean pulse: forms, and the place of the loss that is not varied."""
FIRST_PULLS, FIRST_RATES = np.array((0.8, 1.6, 4.0, 10.0)), np.array((0.05, 0.3, 0.6, 0.85))
"""Where second losses are looked for: over the first one, and those of a part that relaxes [-]."""
RELAXED = 2.4
"""Loss of what relaxes altogether over that of a plate with the same pulse [-], our choice."""
FINEST = 1.0 / 64.0
"""Over which the force is averaged [w50], our choice."""
_SHAPE_TIMES = np.linspace(-1.2, 1.5, 55)
"""Where starts are compared with a window [w50]."""


@lru_cache(maxsize=4)
def _tabulate_starts(exponents: tuple[float, ...]) -> tuple[FloatArray, ...]:
    """Return parameters of pulses, shape (models, starts, 7), and what moves them to a window.

    Each is of width 1 around 0 and of peak 1. It is moved by its shape's height, shift and stretch
    and by an offset: these four at `_SHAPE_TIMES`, and the inverse of their products.
    """
    grid = np.meshgrid(
        np.arange(len(MODELS)),
        exponents,
        (0.01, 0.05, 0.15, 0.35, 0.7),
        np.arange(len(FIRST_RATES)),
        indexing="ij",
    )
    model, exponent, first, number = (axis.ravel() for axis in grid)
    forms, held = find_places(form for form, _ in MODELS)[model], np.array(MODELS)[model, 1]
    rates = np.where(
        forms == MEMORY, FIRST_RATES[number], np.minimum(first * FIRST_PULLS[number], 0.8)
    )
    loss = np.where(held == LOSS, 0.0, first)
    pull = np.where(held == LOSS, first, np.where(held == PULL, 0.0, rates))
    pulses = compute_pulses(exponent, loss, pull, forms)
    time = pulses.duration[:, np.newaxis] * np.linspace(0.0, 1.0, 65)
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
    slopes = np.gradient(shapes, _SHAPE_TIMES, axis=1)
    moves = np.stack((shapes, -slopes, -slopes * _SHAPE_TIMES, np.ones_like(shapes)), axis=1)
    inverse = np.linalg.inv(moves @ moves.swapaxes(1, 2))
    return tuple(
        make_read_only(item.reshape(len(MODELS), -1, *item.shape[1:]))
        for item in (starts, moves, inverse)
    )


def _find_starts(window: PulseWindow, exponent: float | None) -> FloatArray:
    """Return where to begin with each of `MODELS`: at that of its pulses which can come nearest.

    From a loss that is far off, some searches end at a pulse without loss.
    """
    exponents = (0.9, 1.05, 1.2, 1.5, 1.8, 2.2, 2.8)
    starts, moves, inverse = _tabulate_starts(exponents if exponent is None else (exponent,))
    products = moves @ np.interp(_SHAPE_TIMES, window.time, window.measured)
    parts = (inverse @ products[..., np.newaxis])[..., 0]
    nearest = np.arange(len(starts)), np.argmax(np.sum(parts * products, axis=-1), axis=1)
    height, shift, stretch, offset = parts[nearest].T
    found = starts[nearest]
    found[:, [START, TIME]] *= (1.0 + stretch / height)[:, np.newaxis]
    found[:, START] += shift / height
    found[:, HEIGHT] *= height
    found[:, OFFSET] = offset
    return np.asarray(found)


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


NEAREST = 3e-5
"""RMS over the peak to which a contact follows any law, and the tables do [-], our choice."""


@dataclass(frozen=True)
class Noise:
    """Of a trace, over its peak."""

    level: float  # standard deviation [-]
    correlation: FloatArray  # from 0 points on, over the variance [-]

    def find_scale(self, least: float, count: int) -> float:
        """Return which difference of two models' sums of squares tells them apart.

        Parameters
        ----------
        least : float
            Sum of squares of the best, at `count` points.
        """
        white = self.level**2 * (2.0 * float(self.correlation.sum()) - 1.0)
        # What is left beyond noise is of one piece: it counts as one point.
        misfit = max(least / (count - COUNT) - 2.0 * self.level**2, 0.0) * count
        return white + misfit + count * NEAREST**2


def fit_losses(window: PulseWindow, exponent: float | None, noise: Noise) -> list[FittedLoss]:
    """Fit all models of the loss to the window's pulse; n [-] is given, or found."""
    count = window.measured.size
    measured = np.broadcast_to(window.measured, (len(MODELS), count))
    starts = _find_starts(window, exponent)

    is_single = [held is not None for _, held in MODELS]

    def find_most(squares: FloatArray) -> float:
        # 1e-4 of the chance of the best with one loss: others may be ruled out later.
        least = float(squares[is_single].min())
        return least + 20.0 * noise.find_scale(least, count)

    fits = fit_models(window, measured, MODELS, starts, exponent, find_most)
    best = int(np.argmin([fit.residual for fit in fits]))
    if MODELS[best][0] is LossForm.PLATE:
        again = _fit_memory(window, fits[best], exponent)
        fits[-1] = min(fits[-1], again, key=lambda fit: fit.residual)
    return [FittedLoss(*model, fit) for model, fit in zip(MODELS, fits, strict=True)]


def _fit_memory(window: PulseWindow, plate: WindowFit, exponent: float | None) -> WindowFit:
    """Fit what relaxes from where a plate describes the pulse, near which few searches end.

    A spring on a plate is one that relaxes altogether, and e differs by a tenth along the valley
    between the two.
    """
    start = plate.parameters.copy()
    start[LOSS], start[PULL] = min(RELAXED * start[LOSS], LOSSES[1]), 0.0
    power, loss, pull = np.stack((plate.parameters, start))[:, [EXPONENT, LOSS, PULL]].T
    pulses = compute_pulses(power, loss, pull, find_places((LossForm.PLATE, LossForm.MEMORY)))
    time = pulses.duration[:, np.newaxis] * np.linspace(0.0, 1.0, 65)
    peaks = pulses.compute_force(time).max(axis=1)
    start[TIME] *= pulses.duration[0] / pulses.duration[1]
    start[HEIGHT] *= peaks[0] / peaks[1]
    measured = window.measured[np.newaxis]
    return fit_models(window, measured, MODELS[-1:], start[np.newaxis], exponent)[0]


def fit_models(
    window: PulseWindow,
    measured: FloatArray,
    models: Sequence[tuple[LossForm, int | None]],
    starts: FloatArray,
    exponent: float | None,
    find_most: Callable[[FloatArray], float] = lambda _: math.inf,
) -> list[WindowFit]:
    """Fit one model to each pulse, shape (k, n); a loss that is held stays where it starts."""
    forms = [form for form, _ in models]
    places, bounds = find_places(forms), _find_bounds(forms, exponent)
    for row, (_, held) in enumerate(models):
        if held is not None:
            bounds[:, row, held] = starts[row, held]

    def evaluate(parameters: FloatArray, which: NDArray[np.intp]) -> Evaluation:
        return evaluate_laws(window, measured[which], parameters, places[which])

    return fit_window(measured, evaluate, starts, bounds, find_most)


def weigh_losses(residuals: FloatArray, before: FloatArray, noise: Noise) -> FloatArray:
    """Return how probable each model is by what it leaves of the pulse, shape (models,).

    Parameters
    ----------
    residuals : ndarray, shape (models, n)
        Over the peak [-].
    before : ndarray, shape (models,)
        How probable each is without the pulse.
    """
    squares = np.where(before > 0.0, np.sum(residuals**2, axis=1), np.inf)
    scale = noise.find_scale(float(squares.min()), residuals.shape[1])
    weights = before * np.exp((squares.min() - squares) / (2.0 * scale))
    return np.asarray(weights / weights.sum())
