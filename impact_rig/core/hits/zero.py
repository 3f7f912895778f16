"""The level of a trace after the impact, judged like its baseline, and corrected where it is sure.

An accelerometer keeps a charge after a shock: a step that stays, or goes in milliseconds. A lower
corner f_c takes 2 pi f_c times the velocity off the acceleration: after the pulse the trace lies
on the other side, and comes back. A drift is there before the impact, too. Each is a line in the
tail with one number or two; what none of them describes is not corrected. An amplifier that
recovers from overload is none of its own: its tail is a step that goes, and where the record shows
the overload the hit is rejected for that.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from impact_rig.core.hits.pulse_width import PulseWidth
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray

ZERO_AFTER = "zero after the impact"
"""Source of the uncertainty of what is corrected, in budgets."""
TAIL_BEGIN = 1.5
"""Where the tail begins behind the fall of the pulse, in its widths at half amplitude [-], our
choice: at e = 0.5 a contact's foot takes one."""
TAIL_PARTS = 16
"""Means over parts of the tail that are looked at [-], our choice: they show a line, and take
noise and ringing out."""
LARGEST_SURPRISE = 0.4
"""What a wave may leave of the tail's means that it predicts, over them, RMS [-], our choice:
other modes of a body."""
ROUGH = np.eye(TAIL_PARTS) - (
    (_POWERS := np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, TAIL_PARTS), 4))[0]) @ _POWERS.T
)
LARGEST_ROUGHNESS = 0.5
"""What a cubic may leave of the means, over their largest [-], our choice: 0.3 of what goes within
a tenth of the tail, nearly all of ringing."""
SHORTEST_PART = 8
"""Of the tail [points], our choice."""
LEAST_LEVEL = 2e-3
"""Level of the tail that counts, over the peak [-], our choice: it changes tau_p by 0.15 %."""
LARGEST_REST = 0.2
"""What a cause may leave of the tail, over it, RMS [-], our choice."""
REST_NOISE = 3.0
"""The same in standard uncertainties of the means [-]."""
LARGEST_STEP = 0.1
"""Step over the peak up to which it is corrected [-], our choice: where in the shock it came is
not known, and matters more than the rest of the pulse's budget beyond."""
FASTEST_RECOVERY = 1.0
"""Rate at which a step goes up to which it is corrected, times the time from pulse to tail [-],
our choice: what it was under the pulse is extrapolated."""
LARGEST_CORNER = 300.0
"""Lower corner that is corrected [Hz], our choice: bad connections have some 200; what comes back
sooner is a body that is damped, or nothing that is known."""
EXACT = 0.01
"""What a cause leaves of the tail, over it, below which it is exact [-], our choice: a hum, or the
mean of a noisy baseline, integrated, tells a droop no better."""
STEP_HANDICAP = 1.8
"""Factor on what a step leaves where causes are compared [-], our choice: it has two numbers."""
JUMP_REACH = 0.25
"""On either side of where a step may have come at once, in the pulse's widths [-], our choice: a
cubic follows the pulse that far within 0.1 % of its peak."""
JUMP_TOLERANCE = 0.3
"""By how much what jumps within the pulse may differ from the step in the tail, over it [-], our
choice: the pulse's noise and ringing."""
JUMP_NOISE = 6.0
"""Least step that is looked for within the pulse, in standard deviations of what the noise jumps
[-], our choice: less the tolerance, noise has such a jump in one pulse of a thousand."""
LEAST_DECAY = 0.1
"""Decay over the record below which a step stays [-], our choice."""
EXPANDED = 2.0
"""Coverage factor of what is printed [-]."""


@dataclass(frozen=True)
class ZeroShift:
    """What the level after the impact is, and comes from.

    Attributes
    ----------
    reason : Reason
        Its cause.
    explanation : str
        For people, with the figures.
    correction : ndarray or None
        To be taken off the trace, shape (n,) [unit of the trace]; None: it is not sure enough.
    uncertainty : float
        Standard uncertainty of the correction under the pulse [unit of the trace].
    """

    reason: Reason
    explanation: str
    correction: FloatArray | None = None
    uncertainty: float = 0.0


def judge_zeros(
    traces: FloatArray,
    pulse: PulseWidth,
    baseline: int,
    noise: FloatArray,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> list[ZeroShift | None]:
    """Judge the level of each trace after the impact.

    Parameters
    ----------
    traces : ndarray, shape (channels, n)
        Hammer, then sample where measured; mean of the baseline zero.
    pulse : PulseWidth
        Of the hammer.
    baseline : int
        Points of the baseline.
    noise : ndarray, shape (channels,)
        Standard deviation of each trace's white noise [unit of the traces].
    sampling_rate : float
        [Hz]
    settings : AnalysisSettings
        Of the low-pass; and of double hits: an RMS of the hammer's tail, over the peak, of less
        than their level needs no explanation.

    Returns
    -------
    list of ZeroShift or None
        By channel; None: the trace comes back to its baseline, or nothing that is known describes
        its tail.
    """
    begin = math.ceil(pulse.fall + TAIL_BEGIN * pulse.half_amplitude_width)
    count, points = traces.shape
    size = (points - begin) // TAIL_PARTS
    if size < SHORTEST_PART:
        return [None] * count
    parts = traces[:, begin : begin + TAIL_PARTS * size].reshape(count, TAIL_PARTS, size)
    means = parts.sum(axis=2) / size
    typical = np.sqrt(np.square(means).sum(axis=1) / TAIL_PARTS)
    contact = np.abs(traces[:, math.floor(pulse.rise) : math.ceil(pulse.fall) + 1])
    peaks, own = contact.max(axis=1), noise / math.sqrt(size)
    stands_out = typical > np.maximum(LEAST_LEVEL * peaks, REST_NOISE * own)
    found: list[ZeroShift | None] = [None] * count
    for channel in np.flatnonzero(stands_out).tolist():
        # What the causes make is smooth: ringing leaves nearly all of itself beside a cubic.
        rough, largest = (float(np.abs(x).max()) for x in (means[channel] @ ROUGH, means[channel]))
        if rough >= LARGEST_ROUGHNESS * largest:
            continue
        places = begin + (size - 1) / 2.0 + size * np.arange(TAIL_PARTS)
        tail = _Tail(
            traces[channel],
            traces[0],
            pulse,
            baseline,
            sampling_rate,
            places,
            means[channel],
            float(peaks[channel]),
            float(noise[channel]),
            settings.cutoff_frequency,
        )
        least = max(LARGEST_REST * float(typical[channel]), REST_NOISE * float(own[channel]))
        found[channel] = tail.explain(least)
    part = float(typical[0] / peaks[0])
    if found[0] is None and part > settings.double_hit_level and not _is_ringing(means[0]):
        text = (
            f"it wanders by {100.0 * part:.2g} % of the peak, RMS, as by noise of a cable or"
            " strain of the sensor's base"
        )
        found[0] = ZeroShift(Reason.UNSTEADY_ZERO, text)
    return found


def _is_ringing(means: FloatArray) -> bool:
    """Tell whether each mean follows from the two before it, as in any one decaying wave."""
    before = np.stack([means[1:-1], means[:-2], np.ones(TAIL_PARTS - 2)], axis=1)
    predicted = before @ np.linalg.lstsq(before, means[2:], rcond=None)[0]
    rest = means[2:] - predicted
    return float(rest @ rest) < LARGEST_SURPRISE**2 * float(means[2:] @ means[2:])


def compute_share(hammer: FloatArray, pulse: PulseWidth) -> FloatArray:
    """Return which part of the hammer's momentum has passed over at each point, 0 to 1 [-]."""
    reach = pulse.half_amplitude_width
    inside = slice(max(int(pulse.rise - reach), 0), int(pulse.fall + reach) + 1)
    passed = np.zeros(hammer.size)
    passed[inside] = np.maximum(hammer[inside] * math.copysign(1.0, pulse.peak), 0.0)
    passed = np.cumsum(passed)
    return np.asarray(passed / passed[-1])


class _Fit(NamedTuple):
    """How much of a shape a tail has, its standard uncertainty, and what it leaves, RMS."""

    size: float
    standard: float
    rest: float


@dataclass(frozen=True)
class _Tail:
    """A tail with a level: means of its parts, and where they are [points]."""

    trace: FloatArray
    hammer: FloatArray
    pulse: PulseWidth
    baseline: int
    sampling_rate: float
    places: FloatArray
    means: FloatArray
    peak: float
    noise: float
    cutoff_frequency: float

    def explain(self, least: float) -> ZeroShift | None:
        """Return the cause that leaves least of the tail; None: all leave more than `least`."""
        upright = self.means * math.copysign(1.0, float(self.means.sum()))
        other = np.minimum(upright, 0.0)
        if float(other @ other) > (TAIL_PARTS - 1) * least**2:
            # Every cause stays on one side of zero.
            return None
        # A high-pass of one pole takes 2 pi f_c times its own output's integral away.
        velocity = np.cumsum(self.trace)
        middle = (self.baseline - 1) / 2.0
        rate = self._find_rate(upright)
        places = np.rint(self.places).astype(int)
        droop = self._fit(self.trace[places] / 2.0 - velocity[places])
        drift = self._fit(self.places - middle)
        step = self._fit(np.exp(-rate * (self.places - self.pulse.fall)))
        exact = max(
            EXACT * math.sqrt(float(self.means @ self.means) / TAIL_PARTS),
            self.noise / math.sqrt(self.places[1] - self.places[0]),
        )
        rests = {
            Reason.DROOP: max(droop.rest, exact) if droop.size > 0.0 else math.inf,
            Reason.DRIFT: max(drift.rest, exact),
            Reason.ZERO_SHIFT: STEP_HANDICAP * max(step.rest, exact),
        }
        cause = min(rests, key=lambda reason: rests[reason])
        if rests[cause] > least:
            return None
        if cause is Reason.DROOP:
            return self._describe_droop(droop, velocity - self.trace / 2.0)
        if cause is Reason.DRIFT:
            return self._describe_drift(drift, middle)
        return self._describe_step(step, rate)

    def _find_rate(self, upright: FloatArray) -> float:
        """Return the rate at which a step goes [1/point]: a line in the tail's logarithm."""
        weights = np.square(np.maximum(upright, 0.0))
        logarithms = np.log(np.where(upright > 0.0, upright, 1.0))
        if np.count_nonzero(weights) < TAIL_PARTS / 2:
            return 0.0
        lapse = self.places - float(weights @ self.places) / float(weights.sum())
        return max(-float((weights * lapse) @ logarithms / ((weights * lapse) @ lapse)), 0.0)

    def _describe_droop(self, fit: _Fit, velocity: FloatArray) -> ZeroShift:
        per_hertz = 2.0 * math.pi / self.sampling_rate
        corner = fit.size / per_hertz
        return ZeroShift(
            Reason.DROOP,
            f"it droops as by a lower corner of {corner:.3g} Hz"
            f" (± {EXPANDED * fit.standard / per_hertz:.1g} Hz)",
            -fit.size * velocity if corner <= LARGEST_CORNER else None,
            fit.standard * abs(float(velocity[self.pulse.peak_index])),
        )

    def _describe_drift(self, fit: _Fit, middle: float) -> ZeroShift:
        line: FloatArray = fit.size * (np.arange(self.trace.size, dtype=np.float64) - middle)
        percent = 100.0 / self.peak
        return ZeroShift(
            Reason.DRIFT,
            f"it drifts by {percent * line[-1]:.2g} % of the peak to the record's end"
            f" (± {percent * EXPANDED * fit.standard * self.trace.size:.1g} %)",
            line,
            fit.standard * (self.pulse.middle - middle),
        )

    def _describe_step(self, fit: _Fit, rate: float) -> ZeroShift:
        percent = 100.0 / self.peak
        text = (
            f"a step of {percent * fit.size:.2g} % of the peak"
            f" (± {percent * EXPANDED * fit.standard:.1g} %) came with the impact"
        )
        if rate * self.trace.size > LEAST_DECAY:
            text += f" and goes within {1e3 / rate / self.sampling_rate:.2g} ms"
        lapse = np.maximum(np.arange(self.trace.size) - self.pulse.fall, 0.0)
        is_sure = (
            abs(fit.size) <= LARGEST_STEP * self.peak
            and rate * (self.places[0] - self.pulse.fall) <= FASTEST_RECOVERY
        )
        jump = self._find_jump(fit.size) if is_sure else None
        share = compute_share(self.hammer, self.pulse) if jump is None else self._smooth_step(jump)
        unsure = fit.size * (1.0 if jump is None else JUMP_TOLERANCE)
        return ZeroShift(
            Reason.ZERO_SHIFT,
            text,
            fit.size * share * np.exp(-rate * lapse) if is_sure else None,
            # When within the shock it came, or what did not come at once, is evenly distributed.
            math.hypot(unsure / math.sqrt(12.0), fit.standard),
        )

    def _find_jump(self, size: float) -> int | None:
        """Return the point within the pulse at which the step came at once; None: it did not.

        Around each point a cubic and a step are fitted. What the step has is compared with what
        the tail shows.
        """
        reach = int(JUMP_REACH * self.pulse.half_amplitude_width)
        first, last = math.floor(self.pulse.rise), math.ceil(self.pulse.fall)
        if reach < SHORTEST_PART or first < reach:
            return None
        step = self._smooth_step(first)[first - reach : first + reach + 1]
        powers = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 2 * reach + 1), 4))[0]
        kernel = step - powers @ (powers.T @ step)
        square = float(kernel @ kernel)
        if abs(size) < JUMP_NOISE * self.noise / math.sqrt(square):
            return None
        near = self.trace[first - reach : last + reach + 1]
        jumps = np.correlate(near, kernel, "valid") / square
        place = int(np.argmax(jumps * math.copysign(1.0, size)))
        is_inside = 0 < place < jumps.size - 1
        is_alike = abs(jumps[place] - size) < JUMP_TOLERANCE * abs(size)
        return first + place if is_inside and is_alike else None

    def _smooth_step(self, place: int) -> FloatArray:
        """Return a step of 1 at a point as the low-pass leaves it."""
        step = np.heaviside(np.arange(self.trace.size) - float(place), 0.5)
        return low_pass(step, self.cutoff_frequency, self.sampling_rate)

    def _fit(self, shape: FloatArray) -> _Fit:
        square = float(shape @ shape)
        size = float(shape @ self.means) / square
        rest = self.means - size * shape
        variance = float(rest @ rest) / (TAIL_PARTS - 1)
        return _Fit(size, math.sqrt(variance / square), math.sqrt(variance))
