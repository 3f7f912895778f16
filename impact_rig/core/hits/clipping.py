"""Points that a converter cannot have measured: at its rail, or off their neighbours."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.record import FloatArray, Trace

RAIL_TOLERANCE = 2e-3
"""How near to full scale a point counts as at the rail, part of full scale [-], our choice: four
steps of 12 bits, room for an offset."""
RAIL_STEPS = 1.0
"""The same for the converter's steps [-]: of b bits the largest count is 2^(b-1) - 1."""
SAME = 1e-9
"""How near extremes are that are the same count, part of the largest [-]: rounding by a scale."""
LEAST_EXTREME = 0.3
"""Height of an extreme that may be a rail, over the largest [-], our choice: a quiet baseline
repeats its extremes."""
FEWEST_EQUAL = 3
"""Equal extremes in a row that are looked at [-]: two are the top of any symmetric pulse."""
CHANCE = 1e-6
"""Probability of a run by noise, from where on it is none [-], our choice."""
TOP_VALUES = 4
"""Differences of the largest values that show a step [-], our choice: noise leaves out some counts
below a rail."""
DECADE = 8.0
"""Ratio of two differences from which on they are steps of two decades, 10 [-]."""
FLATNESS = 1.5
"""How much longer a real top may stay within a step than a versed-sine's of its width [-], our
choice: a linear spring's, a half-sine, 1.06."""
TOP_NOISE = 3.0
"""By how many standard deviations noise may hold a point on the step of the top [-]."""


def find_longest_rail_run(trace: Trace, quiet: int) -> int:
    """Return how many points in a row stand at a rail [points].

    The rail is full scale where that is known. Whether it is or not, extremes that are equal in a
    row more often than chance allows stand at one.

    Parameters
    ----------
    trace : Trace
        Finite, of a point or more.
    quiet : int
        Points before the pulse, which show noise and baseline, 1 or more.
    """
    values = trace.acceleration
    bottom, top = trace.extremes
    run = 0
    if trace.full_scale > 0.0:
        # A converter of b bits ends one step below its positive full scale.
        rail = (1.0 - RAIL_TOLERANCE) * trace.full_scale - RAIL_STEPS * trace.resolution
        if max(top, -bottom) >= rail:
            run = _find_longest_run(np.abs(values) >= rail)[1]
    # No rail lies nearer to the baseline than the last points before a pulse do.
    middle = float(values[0])
    same = SAME * max(top, -bottom)
    for sign, extreme in ((1.0, top), (-1.0, bottom)):
        if sign * (extreme - middle) <= LEAST_EXTREME * (top - bottom):
            continue
        at_extreme = values >= extreme - same if sign > 0.0 else values <= extreme + same
        start, found = _find_longest_run(at_extreme)
        if found > max(run, FEWEST_EQUAL - 1):
            baseline = float(np.median(values[:quiet]))
            upright = sign * (values - baseline)
            if found > count_chance_run(upright, start, quiet, trace.resolution):
                run = found
    return run


def count_chance_run(upright: FloatArray, start: int, quiet: int, step: float) -> float:
    """Return how many equal extremes in a row a top may have that is not clipped [points].

    A rounded top stays within one step of the converter for 2 sqrt(2 q / curvature) points; noise
    of more than a step breaks such runs up: each further point is alike with a probability of
    erf(q / (2 sqrt(2) s)) at most.

    Parameters
    ----------
    upright : ndarray, shape (n,)
        Baseline zero, the extreme above it.
    start : int
        Where the extreme is first reached.
    quiet : int
        Points before the pulse.
    step : float
        q, one count; 0: not known.
    """
    height = float(upright[start])
    if height <= 0.0:
        return math.inf  # no top of anything: the baseline is not that of a hit
    if step <= 0.0:
        step = find_step(upright, height)
    noise = float(np.std(upright[:quiet]))
    below = upright < 0.5 * height
    before, after = below[:start][::-1], below[start:]
    width = (int(before.argmax()) if before.any() else start) + (
        int(after.argmax()) if after.any() else after.size
    )
    curvature = 0.5 * height * (math.pi / max(width, 1)) ** 2
    rounded = FLATNESS * 2.0 * math.sqrt(2.0 * (step + TOP_NOISE * noise) / curvature) + 1.0
    alike = math.erf(step / (2.0 * math.sqrt(2.0) * noise)) if noise > 0.0 else 1.0
    if alike > 1.0 - SAME:
        return rounded
    return min(rounded, 1.0 + math.log(CHANCE / max(width, 1)) / math.log(alike))


def find_step(values: FloatArray, extreme: float) -> float:
    """Return the least difference of the largest values, rounding apart: one count there.

    A file that gives three digits has 1.01 after 1.00, and 0.999 before: the step is the last
    difference where that is so much larger, and ten times the least of high values at most.
    """
    if not 0.0 < extreme < math.inf:
        return 0.0
    steps = np.diff(np.unique(values[values > LEAST_EXTREME * extreme]))
    steps = steps[steps > SAME * extreme]
    if steps.size == 0:
        return extreme
    last, top = float(steps[-1]), float(steps[-TOP_VALUES:].min())
    return min(last if last > DECADE * top else top, 10.0 * float(steps.min()))


def _find_longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the longest run of true flags begins, and how long it is [points]."""
    places = np.flatnonzero(flags)
    if places.size == 0:
        return 0, 0
    ends = (np.flatnonzero(places[1:] - places[:-1] > 1) + 1).tolist()
    first, stop = max(pairwise([0, *ends, places.size]), key=lambda run: run[1] - run[0])
    return int(places[first]), stop - first


LEAST_DROPOUT = 0.05
"""Deviation of a single point that is looked at, over the largest [-], our choice."""
DROPOUT_NOISE = 10.0
"""The same in standard deviations of the noise [-], our choice."""
DROPOUT_STEPS = 3.0
"""The same in steps of the converter [-], our choice: noise moves a point by one, seldom two."""
DROPOUT_REST = 0.25
"""Bend that may be left without that point, part of its deviation [-], our choice: where the
trace bends as much without it, the signal is sharp and the point is right."""
REACH = 4
"""Points on either side that show whether a point belongs to them [-]."""


def find_dropout(trace: Trace, quiet: int) -> tuple[int, float] | None:
    """Find a single point that cannot be: off a smooth curve through its neighbours.

    Parameters
    ----------
    trace : Trace
        As recorded and finite, before any low-pass: it would smear the point.
    quiet : int
        Points before the pulse, which show the noise, 1 or more.

    Returns
    -------
    tuple of int and float, or None
        Where, and by how much it is off; None: there is none.
    """
    values = trace.acceleration
    if values.size <= 2 * REACH:
        return None
    # It is far off both neighbours, and these on the same side.
    steps = values[1:] - values[:-1]
    least = LEAST_DROPOUT * (trace.extremes[1] - trace.extremes[0])
    if min(float(steps.max()), -float(steps.min())) < least:
        return None
    bends = np.diff(steps)
    index = 1 + int(np.abs(bends).argmax())
    if not REACH <= index < values.size - REACH:
        return None
    near = values[index - REACH : index + REACH + 1].copy()
    curve = (4.0 * (near[REACH - 1] + near[REACH + 1]) - near[REACH - 2] - near[REACH + 2]) / 6.0
    off = float(near[REACH] - curve)
    near[REACH] = curve
    left = float(np.abs(np.diff(near, n=2)).max()) / 2.0
    noise = float(np.std(values[:quiet]))
    upright = np.abs(values)
    step = trace.resolution or find_step(upright, float(upright.max()))
    least = max(least, DROPOUT_NOISE * noise, DROPOUT_STEPS * step)
    is_alone = left <= DROPOUT_REST * abs(off) + TOP_NOISE * noise
    if abs(off) < least or not is_alone:
        return None
    return index, off
