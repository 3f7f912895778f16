"""How many times larger one trace is than another, over the contact of a hit."""

import math
from dataclasses import dataclass

import numpy as np

from impact_rig.core.hits.hit import FilteredHit, JudgedHit
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.signals.record import FloatArray, HitLabel

LARGEST_MISFIT = 0.05
"""Misfit above which a hit is not used [-], our choice: what leaves as much, a delay between the
channels or noise, changes the ratio by the square of it at most, a quarter of a per cent."""
HARMLESS = frozenset({Reason.WEAK, Reason.DOUBLE_HIT})
"""Reasons against a hit that do not count here: a ratio needs neither strength nor one pulse."""
CONTACT_WIDTHS = 1.0
"""Half of the contact in half-amplitude widths of the pulse [-]: of a versed-sine exactly."""
SHORTEST_CONTACT = 5
"""Points of the contact below which nothing is fitted [-], our choice."""


@dataclass(frozen=True)
class TraceFit:
    """The least-squares line of one trace over another.

    Attributes
    ----------
    ratio : float
        Its slope [-].
    misfit : float
        RMS of what it leaves, part of the RMS of the trace about its mean [-]: the square root of
        1 - r^2, r the correlation of both traces.
    linearity : float
        Largest |deviation| from it, part of the trace's largest value [-].
    """

    ratio: float
    misfit: float
    linearity: float


@dataclass(frozen=True)
class HitFit:
    """What one hit says of the ratio.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    stamp : int
        Of its first point, nanoseconds since the epoch.
    fit : TraceFit or None
        None: the hit has no pulse to be fitted.
    flaw : str
        Why the hit is not used, in words; empty: it is.
    """

    label: HitLabel
    stamp: int
    fit: TraceFit | None
    flaw: str = ""


def fit_hit(hit: JudgedHit, channel: str, factor: float) -> HitFit:
    """Fit the trace of one channel over what the other one says that it should be.

    Parameters
    ----------
    hit : JudgedHit
        With both channels.
    channel : {"hammer", "specimen"}
        Of the sensor under test.
    factor : float
        Acceleration that the tested channel should show, over that of the other one [-].
    """
    flaws = [item.explanation for item in hit.rejections if item.reason not in HARMLESS]
    if flaws or hit.filtered is None:
        return HitFit(hit.label, hit.stamp, None, "; ".join(flaws) or "it has no pulse")
    if len(hit.filtered.traces) == 1:
        return HitFit(hit.label, hit.stamp, None, "the second channel was not measured")
    hammer, specimen = _cut_contact(hit.filtered)
    tested, other = (hammer, specimen) if channel == "hammer" else (specimen, hammer)
    if tested.size < SHORTEST_CONTACT:
        return HitFit(hit.label, hit.stamp, None, f"its contact has {tested.size} points only")
    fit = fit_traces(tested, factor * other)
    if not fit.misfit <= LARGEST_MISFIT:
        flaw = (
            f"misfit of {100 * fit.misfit:.2g} %, above {100 * LARGEST_MISFIT:g} %: the channels"
            " do not show the same"
        )
        return HitFit(hit.label, hit.stamp, fit, flaw)
    return HitFit(hit.label, hit.stamp, fit)


def fit_traces(tested: FloatArray, expected: FloatArray) -> TraceFit:
    """Fit a line, with an offset, of one trace over another.

    Parameters
    ----------
    tested, expected : ndarray, shape (n,)
        Of the same points.
    """
    x, y = expected - expected.mean(), tested - tested.mean()
    size_x, size_y = float(x @ x), float(y @ y)
    if size_x == 0.0 or size_y == 0.0:
        return TraceFit(math.nan, math.nan, math.nan)
    ratio = float(x @ y) / size_x
    left = y - ratio * x
    return TraceFit(
        ratio=ratio,
        misfit=math.sqrt(float(left @ left) / size_y),
        linearity=float(np.abs(left).max() / np.abs(tested).max()),
    )


def _cut_contact(hit: FilteredHit) -> FloatArray:
    """Return both traces over the contact, shape (2, n)."""
    half = CONTACT_WIDTHS * hit.pulse.half_amplitude_width
    begin = max(math.floor(hit.pulse.middle - half), 0)
    return hit.traces[:, begin : math.ceil(hit.pulse.middle + half) + 1]
