"""Width of a pulse between interpolated crossings, and what falsifies it, by how much."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from impact_rig.core.given.errors import RigError, SignalError
from impact_rig.core.given.filtering import HIGHEST_RELATIVE_CUTOFF, low_pass
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.pulses import VERSED_SINE, compute_pulse

HALF, TENTH_LEVEL, BASE = 0.5, 0.1, 0.01
"""Levels at which a pulse is read, over its peak [-]."""


@dataclass(frozen=True)
class PulseWidth:
    """A pulse read at half and at a tenth of its peak; crossings and widths in points."""

    peak_index: int  # point of the largest |value|
    peak: float  # signed [unit of the trace]
    rise: float  # half-amplitude crossing before the peak
    fall: float  # the same after the peak
    half_amplitude_width: float  # w50
    tenth_amplitude_width: float  # w10; NaN: the trace does not come down to a tenth

    @property
    def middle(self) -> float:
        """Midpoint of the half-amplitude crossings, in points, fractional."""
        return (self.rise + self.fall) / 2.0

    @property
    def width_ratio(self) -> float:
        """w10 / w50 [-]."""
        return self.tenth_amplitude_width / self.half_amplitude_width


def find_crossing(trace: FloatArray, peak_index: int, level: float, step: int) -> float:
    """Find where a positive pulse crosses `level`, walking from its peak.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Positive at the peak.
    peak_index : int
        Where to start.
    level : float
        In the trace's unit, below the peak.
    step : {-1, 1}
        Backwards or forwards.

    Returns
    -------
    float
        In points, linearly interpolated; NaN if the trace ends first.
    """
    side = trace[peak_index:] if step > 0 else trace[peak_index::-1]
    below = side < level
    index = int(np.argmax(below))
    if not below[index]:
        return float("nan")
    inner, outer = float(side[index - 1]), float(side[index])
    return peak_index + step * (index - 1 + (inner - level) / (inner - outer))


def find_peaks(trace: FloatArray, least: float) -> list[int]:
    """Return the tops that are at least `least` high and that prominent; of a flat top the first.

    The same as `scipy.signal.find_peaks` with this height and prominence; loading that package
    takes as long as all else together.
    """
    inner = trace[1:-1]
    tops = np.flatnonzero((inner >= least) & (inner > trace[:-2]) & (inner >= trace[2:])) + 1
    # Before the first top, between the tops, behind the last.
    floor, *lows = np.minimum.reduceat(trace, [0, *tops])
    found: list[int] = []
    best: int | None = None  # the highest top since it rose by so much
    for top, low in zip(map(int, tops), lows, strict=True):
        if trace[top] - floor >= least if best is None else trace[top] > trace[best]:
            best = top
        if best is not None and trace[best] - low >= least:
            found.append(best)
            best, floor = None, low
        floor = min(floor, low)
    return found


def measure_rise(trace: FloatArray) -> float:
    """Return how long the largest pulse of a trace takes from a tenth to nine tenths of its peak.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Its baseline is zero; either polarity.

    Returns
    -------
    float
        In points; NaN if the trace begins within the rise.
    """
    upright = np.abs(trace)
    peak_index = int(upright.argmax())
    low, high = (
        find_crossing(upright, peak_index, level * float(upright[peak_index]), -1)
        for level in (TENTH_LEVEL, 1.0 - TENTH_LEVEL)
    )
    return high - low


def measure_pulse(trace: FloatArray) -> PulseWidth:
    """Measure the largest pulse of a trace whose baseline is zero.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Either polarity.

    Returns
    -------
    PulseWidth

    Raises
    ------
    SignalError
        If the trace is flat, or does not fall to half its peak on both sides.
    """
    peak_index = int(np.argmax(np.abs(trace)))
    peak = float(trace[peak_index])
    if not np.isfinite(peak) or peak == 0.0:
        raise SignalError("the trace has no pulse: it must leave its baseline and come back")
    upright = trace if peak > 0 else -trace
    height = abs(peak)
    rise, fall = (find_crossing(upright, peak_index, 0.5 * height, s) for s in (-1, 1))
    if np.isnan(rise) or np.isnan(fall):
        raise SignalError(
            "the pulse is cut off: the trace must fall to half its peak on both sides"
        )
    low, high = (find_crossing(upright, peak_index, TENTH_LEVEL * height, s) for s in (-1, 1))
    return PulseWidth(
        peak_index=peak_index,
        peak=peak,
        rise=rise,
        fall=fall,
        half_amplitude_width=fall - rise,
        tenth_amplitude_width=high - low,
    )


def find_ends(trace: FloatArray, pulse: PulseWidth, level: float = BASE) -> tuple[float, float]:
    """Return where a pulse rises above a part of its peak and falls below it [points]."""
    upright = trace if pulse.peak > 0 else -trace
    rise, fall = (
        find_crossing(upright, pulse.peak_index, level * abs(pulse.peak), step) for step in (-1, 1)
    )
    return rise, fall


BASELINE_POINTS = 3
"""Points before the pulse that a baseline needs."""
FLANK_LEVELS = {HALF: (0.8, 1.2), BASE: (0.5, 1.5)}
"""Between which parts of a level a flank's slope is taken [-], our choice: near the crossing, far
enough apart that noise does not matter."""
FILTER_POINTS = 400
"""Points per contact time of the pulse on which the low-pass is tried [-], our choice."""
FILTER_RECORD = 6
"""Contact times of that record [-], our choice: the filter's transients die within one."""


@dataclass(frozen=True)
class TraceQuality:
    """Uncertainties of a trace, apart from its pulse [unit of the trace]."""

    noise: float  # standard deviation
    raw_noise: float  # the same before the low-pass
    dither: float  # noise of each single hit when it was digitized
    resolution: float  # one count; 0: not known, or none
    baseline_points: int  # of the baseline that was removed
    relative_cutoff: float  # of the low-pass over the sampling rate; 0: none
    zero_uncertainty: float = 0.0  # of the zero under the pulse, by corrections


ZERO_AFTER = "zero after the impact"
"""Source of the uncertainty of what is corrected, in budgets."""
WIDENING = "low-pass"
"""Source of what the low-pass widens."""
BY_NOISE = ("noise", "zero of the baseline")
"""Sources of errors that are random from hit to hit."""


def estimate_pulse_errors(
    trace: FloatArray, pulse: PulseWidth, quality: TraceQuality, level: float = HALF
) -> dict[str, float]:
    """Estimate standard uncertainties of the width of a pulse [points], by their sources.

    Parameters
    ----------
    trace : ndarray, shape (n,)
        Baseline zero, either polarity.
    level : {HALF, BASE}
        Of the peak, at which the width is read.
    """
    upright = trace if pulse.peak > 0 else -trace
    height, width = abs(pulse.peak), pulse.half_amplitude_width
    ends = find_ends(trace, pulse, level)
    rise, fall = (_compute_slope(upright, pulse.peak_index, height, level, i) for i in (-1, 1))
    both = 1.0 / rise + 1.0 / fall
    # The level goes with the peak, and away from the zero.
    by_peak, by_zero = both * level, both * (1.0 - level)
    reading = math.hypot(1.0 / rise, 1.0 / fall, by_peak)
    # Of a versed-sine of this width, since a second difference would measure the noise.
    curvature = 0.5 * height * (math.pi / width) ** 2
    trend = compute_trend(trace, quality)
    lever = pulse.middle - (quality.baseline_points - 1) / 2.0
    # Of a parabola a chord misses f (1 - f) / 2 of the curvature, f uniform in 0 to 1, and the
    # highest point d^2 / 2, d uniform in +-1/2: root mean square.
    chord, top = math.sqrt(1.0 / 120.0), math.sqrt(1.0 / 320.0)
    interpolation = chord * (
        _compute_bend(upright, ends[0]) / rise + _compute_bend(upright, ends[1]) / fall
    )
    noise, of_baseline = BY_NOISE
    return {
        # White noise at crossings and peak.
        noise: quality.noise * reading,
        # Noise of the mean baseline.
        of_baseline: quality.raw_noise / math.sqrt(quality.baseline_points) * by_zero,
        # A baseline that is not level, extrapolated to the pulse.
        "trend of the baseline": trend * lever * by_zero,
        # What the noise does not dither away.
        "quantisation": compute_quantisation_error(quality.resolution, quality.dither) * reading,
        # The peak between the points, and straight lines between points.
        "sampling": math.hypot(top * curvature * by_peak, interpolation),
        # The highest of several noisy points on a flat top is too high.
        "peak reading": by_peak
        * compute_peak_excess(quality.noise, curvature, quality.relative_cutoff),
        # Signed: by so much the low-pass widens a versed-sine of this width.
        WIDENING: (ends[1] - ends[0])
        * compute_low_pass_widening(2.0 * width * quality.relative_cutoff, level),
        ZERO_AFTER: quality.zero_uncertainty * by_zero,
    }


def _compute_slope(
    upright: FloatArray, peak_index: int, height: float, level: float, step: int
) -> float:
    """Return how steep a flank is at a level, per point, above zero."""
    below, above = (part * level for part in FLANK_LEVELS[level])
    low, high = (find_crossing(upright, peak_index, p * height, step) for p in (below, above))
    if math.isnan(low) or low == high:
        # The trace ends between the levels: the half above the crossing says it.
        low, below = find_crossing(upright, peak_index, level * height, step), level
    return (above - below) * height / max(abs(high - low), np.finfo(float).tiny)


def _compute_bend(upright: FloatArray, crossing: float) -> float:
    """Return |second difference| around a crossing, the mean over both points beside it."""
    inner = math.floor(crossing)
    first, last = inner - 1, inner + 2
    if first < 0 or last >= upright.size:
        return 0.0
    return abs(float(upright[first] - upright[inner] - upright[inner + 1] + upright[last])) / 2.0


def compute_trend(trace: FloatArray, quality: TraceQuality) -> float:
    """Return how far the baseline is from level, per point; 0 where noise explains it.

    Straight line by least squares; its variance by noise, 12 s^2 / n^3, is taken off. A short
    pre-trigger says little of what comes much later: where the record ends nearer to zero than
    the line, its end decides.
    """
    count = quality.baseline_points
    if count < BASELINE_POINTS:
        return 0.0
    points = np.arange(count) - (count - 1) / 2.0
    slope = float(points @ trace[:count]) / float(points @ points)
    own = quality.raw_noise * math.sqrt(12.0 / (count * (count**2 - 1.0)))
    # Noise alone passes two standard uncertainties in one case of twenty.
    if abs(slope) <= 2.0 * own:
        return 0.0
    distance = trace.size - count
    level = abs(float(trace[-count:].mean())) + quality.raw_noise * math.sqrt(2.0 / count)
    return min(math.sqrt(slope**2 - own**2), level / max(distance, 1))


def compute_quantisation_error(resolution: float, dither: float) -> float:
    """Return the error of a reading's mean by quantisation, root mean square over one step.

    Without noise the error is a saw-tooth of q / sqrt(12). Noise of standard deviation s before
    the converter takes exp(-2 pi^2 k^2 s^2 / q^2) off the k-th harmonic of the saw-tooth, whose
    amplitude is q / (pi k) (Widrow and Kollar, Quantization Noise, 2008).

    Parameters
    ----------
    resolution : float
        q, one count; 0: not known.
    dither : float
        Standard deviation of the noise as digitized, the converter's own included.
    """
    if resolution <= 0.0:
        return 0.0
    variance = max((dither / resolution) ** 2 - 1.0 / 12.0, 0.0)
    # Without noise 1 % is missing beyond 30 harmonics.
    orders = np.arange(1, 31)
    harmonics = np.exp(-2.0 * (math.pi * orders) ** 2 * variance) / (math.pi * orders)
    return resolution * math.sqrt(float(harmonics @ harmonics) / 2.0)


def compute_peak_excess(noise: float, curvature: float, relative_cutoff: float) -> float:
    """Return by how much the highest of several noisy points exceeds a rounded top.

    The expected largest of n independent normal values (Blom's approximation), n being how many
    fit where the top falls by no more than half the noise.

    Parameters
    ----------
    noise : float
        Standard deviation.
    curvature : float
        -d^2/dn^2 at the top, in the noise's unit per point^2, above zero.
    relative_cutoff : float
        Of the low-pass over the sampling rate [-], it makes neighbours alike; 0: none.
    """
    if noise <= 0.0:
        return 0.0
    width = 2.0 * math.sqrt(noise / curvature)
    spacing = 1.0 if relative_cutoff == 0.0 else max(1.0, 0.5 / relative_cutoff)
    count = max(width / spacing, 1.0)
    return noise * float(scipy.special.ndtri((count - 0.375) / (count + 0.25)))


def compute_low_pass_widening(cutoff_contact_time: float, level: float = HALF) -> float:
    """Return the relative change of a width that the low-pass does to a versed-sine [-].

    Parameters
    ----------
    cutoff_contact_time : float
        Cutoff frequency times the versed-sine's duration, both in the trace's time [-]; 0: no
        low-pass.
    """
    if cutoff_contact_time <= 0.0:
        return 0.0
    # Two digits decide: the widening is small where it is of any use.
    return _try_low_pass(float(f"{cutoff_contact_time:.2g}"), level)


@lru_cache(maxsize=256)
def _try_low_pass(cutoff_contact_time: float, level: float) -> float:
    relative = cutoff_contact_time / FILTER_POINTS
    if relative > HIGHEST_RELATIVE_CUTOFF:
        return 0.0
    time = np.arange(FILTER_RECORD * FILTER_POINTS) / FILTER_POINTS - (FILTER_RECORD - 1) / 2.0
    pulse = compute_pulse(time, 1.0, VERSED_SINE)
    try:
        before, after = (
            float(np.ptp(find_ends(trace, measure_pulse(trace), level)))
            for trace in (pulse, low_pass(pulse, relative, 1.0))
        )
    except RigError:
        return 0.0
    return after / before - 1.0
