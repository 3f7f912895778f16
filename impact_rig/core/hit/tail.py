"""The level after the impact: step, droop and drift of a sensor, by one least-squares model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.pulse_width import PulseWidth

PARTS = 16
"""Of the tail [-]: their means take noise and ringing out."""
SHORTEST_PART = 8
"""Of tail and baseline [points], our choice."""
BASELINE_PARTS = 4
"""Of the baseline [-], which tell a drift."""
REMAINING = 0.5
"""Part of a level that is left at the record's end of what a body does not do [-]."""


@dataclass(frozen=True)
class ZeroShift:
    """Level of one trace after the impact, in the unit of the trace."""

    reason: Reason
    explanation: str
    correction: FloatArray | None = None  # (n,), to be taken off; None: it is not sure enough
    uncertainty: float = 0.0  # of the correction under the pulse, standard
    stays: bool = True  # it is still there at the record's end: no body does that


def judge_zeros(
    traces: FloatArray,
    pulse: PulseWidth,
    baseline: int,
    noise: FloatArray,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> list[ZeroShift | None]:
    """Judge the level of each trace after the impact.

    Traces are those of hammer and sample, shape (channels, n), the mean of the baseline zero; the
    noise is white. None: the trace comes back to its baseline, or the model does not describe its
    tail. A hammer's tail below the level of double hits, RMS over the peak, needs no explanation.
    """
    count, points = traces.shape
    # At e = 0.5 the foot of a contact takes one width.
    begin = math.ceil(pulse.fall + 1.5 * pulse.half_amplitude_width)
    size, before = (points - begin) // PARTS, baseline // BASELINE_PARTS
    found: list[ZeroShift | None] = [None] * count
    if min(size, before) < SHORTEST_PART:
        return found
    share = compute_share(traces[0], pulse)
    tails = traces[:, begin : begin + PARTS * size]
    means = tails.reshape(count, PARTS, size).mean(axis=2)
    levels = np.sqrt(np.mean(np.square(means), axis=1))
    peaks = np.abs(traces[:, math.floor(pulse.rise) : math.ceil(pulse.fall) + 1]).max(axis=1)
    # So much changes tau_p by 0.15 %.
    is_off = (levels > 2e-3 * peaks) & (peaks > 0.0)
    for channel in np.flatnonzero(is_off).tolist():
        known = float(peaks[channel]), float(noise[channel]), sampling_rate
        tail = _Tail(traces[channel], share, pulse, baseline, begin, size, before, *known)
        is_droop = channel and found[0] is not None and found[0].reason is Reason.DROOP
        # One cause has one name.
        models = ((DROOP,), *MODELS) if is_droop else MODELS
        shift = tail.explain(models)
        if not channel and shift is not None and shift.correction is not None:
            # What was corrected is no momentum.
            share = compute_share(traces[0] - shift.correction, pulse)
            shift = replace(tail, share=share).explain(models)
        found[channel] = shift
    is_loud = levels[0] > settings.double_hit_level * peaks[0]
    if found[0] is None and is_loud and not _is_wave(means[0]):
        text = f"it wanders by {100.0 * levels[0] / peaks[0]:.2g} % of the peak, RMS, as by noise"
        text += " of a cable or strain of the sensor's base"
        found[0] = ZeroShift(Reason.UNSTEADY_ZERO, text)
    return found


def _is_wave(means: FloatArray) -> bool:
    """Return whether each mean follows from the two before it, as in any one decaying wave."""
    earlier = np.stack([means[1:-1], means[:-2], np.ones(means.size - 2)], axis=1)
    rest = means[2:] - earlier @ np.linalg.lstsq(earlier, means[2:], rcond=None)[0]
    return float(rest @ rest) < 0.4**2 * float(means[2:] @ means[2:])


def compute_share(hammer: FloatArray, pulse: PulseWidth) -> FloatArray:
    """Return which part of the hammer's momentum has passed over at each point, 0 to 1 [-]."""
    reach = pulse.half_amplitude_width
    inside = slice(max(int(pulse.rise - reach), 0), int(pulse.fall + reach) + 1)
    passed = np.zeros(hammer.size)
    passed[inside] = np.maximum(hammer[inside] * math.copysign(1.0, pulse.peak), 0.0)
    passed = np.cumsum(passed)
    return np.asarray(passed / passed[-1])


STEP, DROOP, DRIFT = range(3)
MODELS = ((STEP,), (DROOP,), (DRIFT,), (STEP, DROOP), (STEP, DROOP, DRIFT))
"""Which terms a tail may need, the simplest first: of two that cannot be told apart, and take off
the same, always the same is named. A step that goes is a step with a droop."""


@dataclass(frozen=True)
class _Fit:
    """The model with some of its terms, fitted."""

    terms: tuple[int, ...]
    factors: FloatArray  # (3,), 0 for other terms
    covariance: FloatArray  # (3, 3), of the factors, for a variance of 1
    squares: float  # what is left
    freedom: int


def _fit_models(
    rows: FloatArray, measured: FloatArray, models: Sequence[tuple[int, ...]]
) -> list[_Fit]:
    """Fit models, each with some of the terms in `rows`, shape (3, n), by least squares."""
    has = np.array([[term in terms for term in range(len(rows))] for terms in models])
    products = np.where(has[:, :, np.newaxis] & has[:, np.newaxis], rows @ rows.T, 0.0)
    covariances = np.linalg.pinv(products)
    factors = covariances @ (rows @ measured)
    squares = np.sum((measured - factors @ rows) ** 2, axis=1)
    return [
        _Fit(
            terms,
            factors[place],
            covariances[place],
            float(squares[place]),
            measured.size - len(terms),
        )
        for place, terms in enumerate(models)
    ]


@dataclass(frozen=True)
class _Tail:
    """One trace and the means that its model is fitted to.

    A step comes with the hammer's momentum. A high-pass of one pole takes its own output's
    integral away. A drift runs through the baseline, too. A step that goes obeys the equation of
    the high-pass.
    """

    trace: FloatArray
    share: FloatArray
    pulse: PulseWidth
    baseline: int
    begin: int
    size: int
    before: int
    peak: float
    noise: float
    sampling_rate: float

    def explain(self, models: tuple[tuple[int, ...], ...]) -> ZeroShift | None:
        """Return the simplest cause that leaves no more than all together; None: none is sure."""
        terms = self._make_terms()
        rows, measured = self._average(terms), self._average(self.trace[np.newaxis])[0]
        after = measured[BASELINE_PARTS:]
        if float(after[1:] @ after[:-1]) < 0.0:
            return None  # it swings from part to part, as no level does: a body that rings
        fits = _fit_models(rows, measured, models)
        full = fits[-1]
        # Hum and an integrated baseline leave a fiftieth of the level, our choice.
        floor = self.noise**2 / self.size + np.mean(np.square(0.02 * measured))
        variance = max(full.squares / full.freedom, floor)
        adequate = [fit for fit in fits if self._is_alike(fit, full, variance)]
        fewest = min(len(fit.terms) for fit in adequate)
        chosen = next(fit for fit in adequate if len(fit.terms) == fewest)
        # A droop that is gone before the tail is a contact.
        if self._find_rate(chosen) * (self.begin - self.pulse.fall) > 1.0:
            return None
        variance = max(chosen.squares / chosen.freedom, floor)
        gained = (float(measured @ measured) - chosen.squares) / fewest / variance
        # Of ringing, so rare an F leaves 5 % of the squares, our choice.
        if gained < scipy.special.fdtri(fewest, chosen.freedom, 1.0 - 1e-12):
            return None
        return self._describe(chosen, variance, terms)

    def _make_terms(self) -> FloatArray:
        """Return step, droop and drift of the whole trace, each 1 in size, shape (3, n)."""
        velocity = np.cumsum(self.trace) - self.trace / 2.0
        middle = (self.baseline - 1) / 2.0
        drift = (np.arange(self.trace.size) - middle) / self.trace.size
        return np.stack((self.share, -velocity / self.change, drift))

    @property
    def change(self) -> float:
        """The body's change of velocity [unit of the trace times a point]."""
        return float(np.abs(np.cumsum(self.trace)[self.begin :]).max()) or 1.0

    def _find_rate(self, fit: _Fit) -> float:
        """Return the rate of a droop [1/point]; 0: it has none."""
        return float(fit.factors[DROOP]) / self.change

    def _average(self, rows: FloatArray) -> FloatArray:
        """Return means over the parts of baseline and tail, shape (k, parts)."""
        count = len(rows)
        before = rows[:, : BASELINE_PARTS * self.before]
        after = rows[:, self.begin : self.begin + PARTS * self.size]
        # Fewer points have more noise.
        weight = math.sqrt(min(self.before / self.size, 1.0))
        return np.concatenate(
            (
                weight * before.reshape(count, BASELINE_PARTS, self.before).mean(axis=2),
                after.reshape(count, PARTS, self.size).mean(axis=2),
            ),
            axis=1,
        )

    def _is_alike(self, fit: _Fit, full: _Fit, variance: float) -> bool:
        """Tell by the F-test that a fit leaves no more than all terms do."""
        more = len(full.terms) - len(fit.terms)
        if not more:
            return True
        if fit.terms[-1] == DROOP and fit.factors[DROOP] < 0.0:
            return False  # it would grow
        ratio = (fit.squares - full.squares) / more / variance
        return bool(ratio < scipy.special.fdtri(more, full.freedom, 1.0 - 1e-6))

    def _describe(self, fit: _Fit, variance: float, terms: FloatArray) -> ZeroShift:
        correction = fit.factors @ terms
        level, end = (float(correction[place]) for place in (self.begin, -1))
        under = terms[:, round(self.pulse.middle)]
        after = terms[:, math.ceil(self.pulse.fall + self.pulse.half_amplitude_width)]
        standard, spread = (
            math.sqrt(variance * float(row @ fit.covariance @ row)) for row in (under, after)
        )
        percent = 100.0 / self.peak
        if fit.terms == (DROOP,):
            corner = self._find_rate(fit) * self.sampling_rate / (2.0 * math.pi)
            wide = abs(corner) * 2.0 * spread / max(abs(float(fit.factors @ after)), 1e-300)
            reason = Reason.DROOP
            text = f"it droops as by a lower corner of {corner:.3g} Hz (± {wide:.1g} Hz)"
        elif fit.terms == (DRIFT,):
            wide = 2.0 * percent * math.sqrt(variance * float(fit.covariance[DRIFT, DRIFT]))
            reason = Reason.DRIFT
            text = f"it drifts by {percent * end:.2g} % of the peak to the record's end"
            text += f" (± {wide:.1g} %)"
        else:
            reason = Reason.ZERO_SHIFT
            step = float(fit.factors @ after)
            text = f"a step of {percent * step:.2g} % of the peak"
            text += f" (± {percent * 2.0 * spread:.1g} %) came with the impact"
            if abs(end) < REMAINING * abs(step):
                text += " and goes"
            # When within the shock it came is evenly distributed.
            standard = math.hypot(standard, step / math.sqrt(12.0))
        stays = reason is Reason.DROOP or abs(end) > REMAINING * abs(level)
        # As sure as of a step of 10 %.
        taken = correction if standard <= 0.03 * self.peak else None
        return ZeroShift(reason, text, taken, standard, stays)
