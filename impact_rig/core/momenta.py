"""Momentum, velocity change and energy from both traces."""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.detection import SPREAD_OF_MEDIAN
from impact_rig.core.filtering import restore_level
from impact_rig.core.hits import MeanHit
from impact_rig.core.quantity import UNKNOWN, Quantity
from impact_rig.core.records import FloatArray
from impact_rig.core.sensors import Sensor
from impact_rig.core.tail import ZERO_AFTER
from impact_rig.core.uncertainty import (
    LEAST_HITS,
    ONE_HIT,
    RigNumbers,
    compute_quantity,
    make_ensemble,
    make_input,
    make_scatter,
)

_T = TypeVar("_T", bound=np.floating)


@dataclass(frozen=True)
class Limits:
    """Of what is said of momenta; all are our choices but the scale."""

    hits: int = 5  # [-] that tell an odd one among them
    balanced: float = 0.01  # [-] from 1: gains are hardly known better
    slip: float = 0.05  # [-] from the ratio of a usual slip
    speed: float = 0.01  # [-] standard uncertainty of a stated speed, which no rig file gives


LIMITS = Limits()


def restore_levels(mean: MeanHit, sensors: tuple[Sensor, Sensor]) -> MeanHit:
    """Return a mean hit without what the sensors' low corners took from it."""
    if not any(sensor.low_corner for sensor in sensors):
        return mean

    def restore(traces: NDArray[_T]) -> NDArray[_T]:
        return np.stack(
            [
                restore_level(trace, sensor.low_corner, mean.sampling_rate)
                for trace, sensor in zip(traces, sensors, strict=False)
            ]
        ).astype(traces.dtype)

    hits = tuple(replace(hit, traces=restore(hit.traces)) for hit in mean.hits)
    return replace(mean, traces=restore(mean.traces), hits=hits)


def cut_contact(mean: MeanHit, start: float, duration: float, cutoff_frequency: float) -> slice:
    """Return the points of the contact, and what the low-pass has put before and after it."""
    reach = mean.sampling_rate / cutoff_frequency if cutoff_frequency else 0.0
    stop = start + duration * mean.sampling_rate + reach
    return slice(max(0, math.floor(start - reach)), math.ceil(stop) + 1)


def compare_momenta(mean: MeanHit, contact: slice, masses: RigNumbers, sample: str) -> Quantity:
    """Return m2 dv2 / (m1 dv1), whichever way round the sensors are."""
    known = math.isfinite(masses.hammer_mass.x) and math.isfinite(masses.moving_mass.x)
    if mean.traces.shape[0] == 1 or not known:
        return UNKNOWN
    value = _divide_changes(mean.traces[:, contact])
    number = value * masses.moving_mass / masses.hammer_mass
    number = number * masses.gains[1] / masses.gains[0]
    if len(mean.hits) < LEAST_HITS:
        return Quantity(number.x, notes=(ONE_HIT,))
    ratios = [_divide_changes(hit[:, contact]) for hit in mean.cut_hits()]
    scatter = make_scatter(f"scatter of the hits on {sample}", 0.0, ratios, mean.count)
    number = number + masses.moving_mass.x / masses.hammer_mass.x * scatter
    if np.any(mean.zero_uncertainty):
        # Evenly over the contact.
        sums = np.abs(mean.traces[:, contact].sum(axis=1)) / mean.traces[:, contact].shape[1]
        part = float(np.hypot(*(mean.zero_uncertainty / sums)))
        number = number * make_input(ZERO_AFTER, 1.0, part)
    return compute_quantity(number.x, number)


def _divide_changes(traces: FloatArray) -> float:
    hammer, sample = traces.sum(axis=1, dtype=np.float64).tolist()
    return abs(float(sample) / float(hammer))


def compute_stated_restitution(
    mean: MeanHit, pulse: slice, masses: RigNumbers, impact_speed: float, sample: str
) -> Quantity:
    """Return e = J / (m_eq v1) - 1 by the impact speed that is stated, whatever the law is."""
    hammer, body = masses.hammer_mass, masses.moving_mass
    if not math.isfinite(hammer.x * body.x * impact_speed):
        return UNKNOWN
    changes = np.array([abs(float(hit[0, pulse].sum())) for hit in mean.cut_hits()])
    change = abs(float(mean.traces[0, pulse].sum(dtype=np.float64)))
    deviation = float(changes.std(ddof=1)) if changes.size >= LEAST_HITS else 0.0
    (sums,) = make_ensemble(
        f"scatter of the hits on {sample}",
        [change / mean.sampling_rate],
        np.array([[(deviation / mean.sampling_rate) ** 2 / mean.count]]),
        max(changes.size - 1.0, 1.0),
    )
    speed = make_input("stated impact speed", impact_speed, LIMITS.speed * impact_speed)
    number = sums * masses.clock * masses.gains[0] * (hammer + body) / (body * speed) - 1.0
    return compute_quantity(number.x, number)


SLIPS = {
    2.0: "a sampling rate that is stated twice or half as high",
    9.81: "g read as m/s², or the reverse",
    10.0: "a gain of ten, or cm/s read as mm/s",
    1000.0: "mV read as V, or mm as m",
}
"""Usual slips, by how many times the stated speed v is by them, or the reverse."""


def check_speed(speed: Quantity, restitution: Quantity, stated: float) -> str | None:
    """Warn of a law's impact speed that is not the stated one [m/s], beyond both uncertainties.

    Without a law the bodies' e by the stated speed must lie between 0 and 1.
    """
    if speed.is_known and math.isfinite(stated):
        low = high = speed.value / stated
        apart = abs(speed.value - stated) - np.nan_to_num(speed.expanded)
        is_other = apart > 2.0 * LIMITS.speed * stated
    elif restitution.is_known:
        # Without loss the impulse is twice m v1, with e = 0 it is m v1.
        high = 1.0 + restitution.value
        low = high / 2.0
        is_other = abs(restitution.value - 0.5) > 0.5 + restitution.expanded
    else:
        return None
    if not is_other:
        return None
    near = [
        (abs(math.log(ratio**2 / (low * high))), text)
        for slip, text in SLIPS.items()
        for ratio in (slip, 1.0 / slip)
        if (1.0 - LIMITS.slip) * low < ratio < (1.0 + LIMITS.slip) * high
    ]
    why = "the sensitivity of a sensor, a mass, or that speed"
    if near:
        why = min(near)[1] + (f", or {why}" if low < high else "")
    shown = f"{low:.3g}" if low == high else f"{low:.2g} to {high:.2g}"
    return (
        f"by the traces the impact speed is {shown} times the {100.0 * stated:.4g} cm/s that are"
        f" stated: {why}"
    )


def find_odd_hits(mean: MeanHit, values: FloatArray, least: float) -> list[str]:
    """Return the hits whose value differs from the others', each as impact and attempt.

    Parameters
    ----------
    values : ndarray, shape (hits,)
        One for each of those that show the scatter.
    least : float
        Difference from the median that is nothing odd.
    """
    if values.size < LIMITS.hits:
        return []
    away = np.abs(values - np.median(values))
    odd = away > max(6.0 * SPREAD_OF_MEDIAN * float(np.median(away)), least)
    labels = [mean.hits[place].label for place in np.flatnonzero(odd)]
    return [f"{label.impact}.{label.attempt}" for label in labels if label is not None]


def check_hit_momenta(mean: MeanHit, contact: slice) -> tuple[str, ...]:
    """Warn of hits whose momentum ratio is not that of the others."""
    if mean.traces.shape[0] == 1:
        return ()
    ratios = np.array([_divide_changes(hit[:, contact]) for hit in mean.cut_hits()])
    odd = find_odd_hits(mean, ratios / np.median(ratios), LIMITS.balanced)
    if not odd:
        return ()
    told = (
        f"the momenta of {name_hits(odd)} balance otherwise than the others': a gain that changed,"
        " a trace that is clipped or does not come back to zero, or a sample that was held"
    )
    return (told,)


def name_hits(hits: list[str]) -> str:
    """Return "hit 3.1", or "hits 3.1 and 4.1"."""
    return f"hit{'s' if len(hits) > 1 else ''} {' and '.join(hits)}"


def check_momenta(ratio: Quantity) -> tuple[str, ...]:
    """Warn of a momentum ratio that is not 1 within its uncertainty."""
    if not ratio.is_known or abs(ratio.value - 1.0) <= max(
        np.nan_to_num(ratio.expanded), LIMITS.balanced
    ):
        return ()
    told = (
        "the momenta do not balance: a gain, a mass or the zero after the impact is wrong, a trace"
        " is clipped, or the sample is not free or rings"
    )
    return (told,)
