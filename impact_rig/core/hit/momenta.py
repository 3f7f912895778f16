"""Momenta by integration of both traces, without a contact law."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy

from impact_rig.core.given.filtering import Chain, restore_level
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import TENTH_LEVEL, PulseWidth, find_crossing

AS_GOOD_AS = 0.1
"""Difference from 0 or 1 of a part of J / m2 [-], our choice: noise and zero make some 0.03."""


class Hold(Enum):
    """Holds of a sample."""

    FREE = "free"  # nothing
    SPRING = "spring"  # a spring to the ground
    UNCLEAR = "unclear"  # neither, as on a base that moves itself
    UNKNOWN = "unknown"  # the record ends too early


def restore_traces(traces: FloatArray, chains: tuple[Chain, Chain]) -> FloatArray:
    """Return traces, shape (channels, n), without what the sensors' low corners took from them."""
    return np.stack(
        [
            restore_level(trace, chain.response.low_corner, chain.sampling_rate)
            for trace, chain in zip(traces, chains, strict=False)
        ]
    ).astype(traces.dtype)


def find_contact(hammer: FloatArray, pulse: PulseWidth, chain: Chain) -> slice | None:
    """Return the points over which momentum passes; None: the record does not hold all of them.

    From a tenth of the peak to a tenth, half a width more on each side, or what the low-pass
    smears, if that is more.
    """
    upright = hammer / pulse.peak
    low, high = (find_crossing(upright, pulse.peak_index, TENTH_LEVEL, side) for side in (-1, 1))
    reach = 0.5 * pulse.half_amplitude_width
    if chain.cutoff_frequency:
        reach = max(reach, chain.sampling_rate / chain.cutoff_frequency)
    if not (low - reach >= 0.0 and high + reach < hammer.size - 1):
        return None
    return slice(math.floor(low - reach), math.ceil(high + reach) + 1)


@dataclass(frozen=True)
class Passage:
    """Transfer of momentum from hammer to sample in one hit, or in a mean of hits."""

    hammer_change: float  # of the hammer's velocity [m/s], positive
    sample_change: float  # of the sample's over the contact [m/s], in the sense of its first push
    # Mean velocity of the sample after the contact [m/s]; NaN: the record ends too early.
    settled: float
    mass_ratio: float  # m2 / m1 by Newton's law over the contact, held or not [-]

    def list_figures(self, hold: Hold) -> tuple[float, float, float]:
        """Return the hammer's change of velocity [m/s], the sample's over it, and m2 / m1 [-]."""
        change = self.sample_change / self.hammer_change
        return self.hammer_change, change, self.weigh(hold)

    @property
    def persistence(self) -> float:
        """Part of J / m2 at which the sample moves on in the end [-], m2 by `mass_ratio`."""
        return self.settled * self.mass_ratio / self.hammer_change

    @property
    def lost(self) -> float:
        """Part of J that a support has taken by the end of the contact [-], whatever the gains."""
        return 1.0 - self.sample_change * self.mass_ratio / self.hammer_change

    @property
    def hold(self) -> Hold:
        """How the sample is held: it comes to rest on a spring, and moves on where it is free."""
        if not math.isfinite(self.persistence):
            return Hold.UNKNOWN
        if abs(self.persistence) < AS_GOOD_AS:
            return Hold.SPRING
        # What rings in the contact hides some of the mass.
        is_alike = abs(self.persistence - 1.0) < 3.0 * AS_GOOD_AS
        keeps = abs(self.settled / self.sample_change - 1.0) < AS_GOOD_AS
        return Hold.FREE if is_alike and keeps else Hold.UNCLEAR

    def weigh(self, hold: Hold) -> float:
        """Return m2 / m1 by Newton's law on a spring, else by momenta [-]; NaN: neither."""
        if hold is Hold.SPRING:
            return self.mass_ratio
        if hold is Hold.UNCLEAR:
            return math.nan
        return self.hammer_change / self.sample_change


def follow_momentum(traces: FloatArray, contact: slice, sampling_rate: float) -> Passage:
    """Integrate both traces, shape (channels, n), whichever way round the sensors are.

    A spring of k and c to the ground takes part of the force: m1 a1 = m2 a2 + c v2 + k x2, with a2
    integrated from before the contact, is linear in m2 / m1, c / m1 and k / m1.
    """
    step = 1.0 / sampling_rate
    hammer = np.asarray(traces[0, contact], dtype=np.float64)
    if len(traces) == 1 or not np.any(traces[1, contact]):
        # Not measured, or its channel is dead.
        return Passage(abs(float(hammer.sum())) * step, *3 * [math.nan])
    sample = np.asarray(traces[1, contact], dtype=np.float64)
    velocity = scipy.integrate.cumulative_trapezoid(traces[1], dx=step, initial=0.0)
    velocity = velocity - velocity[contact.start]
    force = hammer * math.copysign(1.0, float(hammer.sum()))
    inside = velocity[contact]
    path = scipy.integrate.cumulative_trapezoid(inside, dx=step, initial=0.0)
    rows = np.stack((sample, inside, path))
    sizes = np.abs(rows).max(axis=1)
    mass_ratio = float("nan")
    if np.all(sizes > 0.0):
        parts = np.linalg.lstsq((rows / sizes[:, np.newaxis]).T, force, rcond=None)[0]
        mass_ratio = float(parts[0] / sizes[0])
    # What is up on the sample's sensor: its mass is positive.
    up, mass_ratio = math.copysign(1.0, mass_ratio), abs(mass_ratio)
    hammer_change = float(force.sum()) * step
    tail = up * velocity[contact.stop :]
    settled = math.nan
    # Half as long as the contact tells nothing of what swings more slowly.
    if tail.size > 0.5 * hammer.size:
        # A Hann window takes out all that swings twice in the tail.
        weights = np.hanning(tail.size)
        settled = float(weights @ tail) / float(weights.sum())
    return Passage(hammer_change, up * float(inside[-1]), settled, mass_ratio)


def weigh_sample(hit: FilteredHit, chains: tuple[Chain, Chain]) -> float:
    """Return m2 / m1 by the traces of one hit [-]; NaN: not determined."""
    if len(hit.traces) == 1:
        return math.nan
    traces = restore_traces(hit.traces, chains)
    contact = find_contact(traces[0], hit.pulse, chains[0])
    passage = contact and follow_momentum(traces, contact, hit.sampling_rate)
    return passage.weigh(passage.hold) if passage else math.nan
