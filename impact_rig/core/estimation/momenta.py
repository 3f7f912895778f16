"""What both traces say of a contact without its law: momenta, force over indentation."""

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.quantity import UNKNOWN, Quantity
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.signals.sensor_response import restore_level
from impact_rig.core.uncertainty.contact import LEAST_HITS
from impact_rig.core.uncertainty.propagation import RigNumbers
from impact_rig.core.uncertainty.results import compute_quantity, make_ensemble

_T = TypeVar("_T", bound=np.floating)
FEWEST_HITS = 5
"""That tell an odd one among them [-], our choice."""
ROBUST_SCALE = 1.4826
"""Standard deviation over median deviation of normal values [-]."""
ODD_DEVIATIONS = 6.0
"""Standard deviations from the median from which a hit is odd [-], our choice."""
BALANCED = 0.01
"""Difference of the momentum ratio from 1 that is not mentioned [-], our choice: gains are hardly
known better."""


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

    hits = tuple(replace(hit, scaled=restore(hit.scaled)) for hit in mean.hits)
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
    if len(mean.hits) >= LEAST_HITS:
        ratios = [_divide_changes(hit[:, contact]) for hit in mean.cut_hits()]
        standard = float(np.std(ratios, ddof=1)) / math.sqrt(mean.count)
        source = f"scatter of the hits on {sample}"
        covariance = np.array([[standard**2]])
        scatter = make_ensemble(source, [0.0], covariance, len(ratios) - 1.0, owner=sample)
        number = number + masses.moving_mass.x / masses.hammer_mass.x * scatter[0]
    return compute_quantity(number.x, number)


def _divide_changes(traces: FloatArray) -> float:
    hammer, sample = traces.sum(axis=1, dtype=np.float64).tolist()
    return abs(float(sample) / float(hammer))


def compute_loop_energy(
    mean: MeanHit, contact: slice, impact_speed: Quantity | None, masses: RigNumbers
) -> float:
    """Integrate force times speed of approach over the contact [J]."""
    if mean.traces.shape[0] == 1 or impact_speed is None:
        return math.nan
    traces = mean.traces[:, contact]
    hammer, sample = traces * np.sign(traces.sum(axis=1, keepdims=True)) / mean.sampling_rate
    change = hammer + sample
    approach = impact_speed.value - np.cumsum(change) + change / 2.0
    return float(masses.hammer_mass.x * (hammer @ approach))


def find_odd_hits(mean: MeanHit, values: FloatArray, least: float) -> list[str]:
    """Return the hits whose value differs from the others', each as impact and attempt.

    Parameters
    ----------
    values : ndarray, shape (hits,)
        One for each of those that show the scatter.
    least : float
        Difference from the median that is nothing odd.
    """
    if values.size < FEWEST_HITS:
        return []
    away = np.abs(values - np.median(values))
    odd = away > max(ODD_DEVIATIONS * ROBUST_SCALE * float(np.median(away)), least)
    labels = [mean.hits[place].label for place in np.flatnonzero(odd)]
    return [f"{label.impact}.{label.attempt}" for label in labels if label is not None]


def check_hit_momenta(mean: MeanHit, contact: slice) -> tuple[str, ...]:
    """Warn of hits whose momentum ratio is not that of the others."""
    if mean.traces.shape[0] == 1:
        return ()
    ratios = np.array([_divide_changes(hit[:, contact]) for hit in mean.cut_hits()])
    odd = find_odd_hits(mean, ratios / np.median(ratios), BALANCED)
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
    if not ratio.is_known or abs(ratio.value - 1.0) <= max(ratio.expanded, BALANCED):
        return ()
    told = (
        "the momenta do not balance: a gain, a mass or the zero after the impact is wrong, a trace"
        " is clipped, or the sample is not free or rings"
    )
    return (told,)
