"""Where the least-squares search starts, read from the traces themselves."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant, simulate_impacts
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
)
from impact_rig.core.signals.record import FloatArray

NAN = math.nan
FREQUENCIES = np.geomspace(0.8, 16.0, 6)
"""Natural frequencies of the sample that are tried, times tau_p [rad], our choice: neighbours are
near enough for the search to go on from; the published samples lie between 2.9 and 3.8."""
DAMPING_RATIOS = (0.1, 0.5)
"""Damping ratios that are tried [-], our choice."""
PRINTED_DURATIONS = (1.0, 1.6, 2.4)
"""tau_p of the printed model that are tried, over twice the half-amplitude width [-], our choice:
its hammer trace is no versed-sine."""
PRINTED_STIFFNESSES = (0.5, 1.0, 2.0)
"""k1 of the printed model that are tried, over 2 k_eq [-], our choice."""
PRINTED_DAMPING_RATIOS = (0.2, 0.6)
"""Damping ratios of the hammer that are tried [-], our choice: Table 4 means 0.64."""
SPECIMEN_STIFFNESSES = (1.5, 4.0)
"""k2 that is tried with the printed model, over k_eq [-], our choice."""
TYPICAL_DAMPING_RATIO = 0.3
"""Of a sample of which nothing is known [-], our choice: in the middle of the published ones."""
TYPICAL_FREQUENCY = 3.3
"""Natural frequency of such a sample, times tau_p [rad]: in the middle of the published ones."""
RINGING_DAMPING_RATIOS = (0.01, 0.05, 0.2)
"""Damping ratios that are tried at the frequency at which the sample rings [-], our choice: the
longer it rings, the better the frequency must be known from the start."""
SHORTEST_TAIL = 8
"""Points after the contact that show a ringing [-], our choice."""


@dataclass(frozen=True)
class StartingValues:
    """What is already believed; NaN: nothing.

    Attributes
    ----------
    stiffness, damping_coefficient : float
        Of the sample: k2 [N/m], c2 [N s/m].
    hammer_stiffness, hammer_damping_coefficient : float
        k1 [N/m], c1 [N s/m]; only the printed model has them.
    """

    stiffness: float = NAN
    damping_coefficient: float = NAN
    hammer_stiffness: float = NAN
    hammer_damping_coefficient: float = NAN

    @property
    def has_specimen(self) -> bool:
        """Whether both numbers of the sample are those of a body."""
        return _is_body(self.stiffness, self.damping_coefficient)

    @property
    def has_hammer(self) -> bool:
        """Whether both numbers of the hammer are those of a body."""
        return _is_body(self.hammer_stiffness, self.hammer_damping_coefficient)


def _is_body(stiffness: float, damping_coefficient: float) -> bool:
    return 0.0 < stiffness < math.inf and 0.0 <= damping_coefficient < math.inf


def find_starts(
    measured: MeasuredModel, traces: FloatArray, given: StartingValues
) -> Iterator[FloatArray]:
    """Yield starts, the most promising first: what is given, then what the traces suggest.

    Parameters
    ----------
    traces : ndarray, shape (2, n)
        Mean traces [m/s^2].

    Yields
    ------
    ndarray, shape (p,)
        Parameter values in the order of `measured.names`.

    Raises
    ------
    SignalError
        If the hammer's trace has no whole pulse.
    """
    finder = _Finder(measured, traces)
    if measured.variant is ModelVariant.DRIVEN:
        yield from finder.find_driven(given)
    else:
        yield from finder.find_printed(given)


class _Finder:
    """Compares candidates with the traces, without the low-pass."""

    def __init__(self, measured: MeasuredModel, traces: FloatArray) -> None:
        self.measured, self.traces, self.sampling_rate = measured, traces, measured.sampling_rate
        pulse = measure_pulse(traces[0])
        self.peak = pulse.peak
        self.middle = pulse.middle / measured.sampling_rate
        width = pulse.half_amplitude_width / measured.sampling_rate
        self.contact_time = VERSED_SINE.pulse_factor * width
        self.start = self.middle - self.contact_time / 2.0

    def find_driven(self, given: StartingValues) -> Iterator[FloatArray]:
        """Yield starts of the driven model: its sample is one oscillator."""
        mass, tau = self.measured.moving_mass, self.contact_time
        if given.has_specimen:
            pair = (
                given.stiffness * tau**2 / mass,
                given.damping_coefficient * tau / mass,
            )
        else:
            # As if hammer and sample were alike: k2 = 2 k_eq, equation (6b).
            equivalent = estimate_equivalent_mass(self.measured.hammer_mass, mass)
            frequency = math.pi * math.sqrt(2.0 * equivalent / mass)
            pair = (frequency**2, 2.0 * TYPICAL_DAMPING_RATIO * frequency)
        [(_, height)] = self._fit_oscillators([pair])
        yield self._make_driven(*pair, height)
        candidates = [
            *product(FREQUENCIES.tolist(), DAMPING_RATIOS),
            *product((self._find_ringing(),), RINGING_DAMPING_RATIOS),
        ]
        pairs = [(frequency**2, 2.0 * ratio * frequency) for frequency, ratio in candidates]
        tried = sorted(zip(self._fit_oscillators(pairs), pairs, strict=True))
        for (_, height), pair in tried:
            yield self._make_driven(*pair, height)

    def _find_ringing(self) -> float:
        """Return the strongest frequency of what follows the contact, times tau_p [rad]."""
        first = math.ceil((self.start + self.contact_time) * self.sampling_rate)
        tail = self.traces[1, first:]
        if tail.size < SHORTEST_TAIL:
            return TYPICAL_FREQUENCY
        length = 4 * tail.size
        strongest = max(int(np.argmax(np.abs(np.fft.rfft(tail, length)))), 1)
        return 2.0 * math.pi * strongest / length * self.sampling_rate * self.contact_time

    def _fit_oscillators(self, pairs: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Return what is left of the sample's trace, and the amplitude that leaves it.

        For stiffness and damping over the mass, scaled by tau_p; each pair by itself.
        """
        mass, tau = self.measured.moving_mass, self.contact_time
        models = [
            ImpactModel(
                hammer=Body(self.measured.hammer_mass, 1.0, 0.0),
                specimen=Body(mass, stiffness * mass / tau**2, damping * mass / tau),
                contact_time=tau,
                impact_speed=0.0,
                # As much as accelerates the sample by 1.
                peak_force=mass,
            )
            for stiffness, damping in pairs
        ]
        responses = simulate_impacts(
            models,
            self.sampling_rate,
            self.traces.shape[1],
            start=-self.start,
            variant=ModelVariant.DRIVEN,
        )
        fits = [_fit_amplitude(response, self.traces[1]) for response in responses[:, 1]]
        return [(left, height) for height, left in fits]

    def _make_driven(self, stiffness: float, damping: float, height: float) -> FloatArray:
        mass, tau = self.measured.moving_mass, self.contact_time
        force = -self.measured.hammer_mass * self.peak
        gain = height * mass / force
        return np.array(
            [
                tau, self.start, stiffness * mass / tau**2, damping * mass / tau, force,
                gain, 0.0, 0.0,
            ]
        )  # fmt: skip

    def find_printed(self, given: StartingValues) -> Iterator[FloatArray]:
        """Yield starts of the printed model: two bodies, of which little is known."""
        hammer_mass, mass = self.measured.hammer_mass, self.measured.moving_mass
        equivalent = estimate_equivalent_stiffness(
            estimate_equivalent_mass(hammer_mass, mass), self.contact_time
        )
        hammers = [
            (
                2.0 * equivalent * part,
                2.0 * ratio * math.sqrt(2.0 * equivalent * part * hammer_mass),
            )
            for part, ratio in product(PRINTED_STIFFNESSES, PRINTED_DAMPING_RATIOS)
        ]
        if given.has_hammer:
            hammers.insert(0, (given.hammer_stiffness, given.hammer_damping_coefficient))
        specimens = [
            (part * equivalent, 2.0 * TYPICAL_DAMPING_RATIO * math.sqrt(part * equivalent * mass))
            for part in SPECIMEN_STIFFNESSES
        ]
        if given.has_specimen:
            specimens.insert(0, (given.stiffness, given.damping_coefficient))
        bodies = [
            (duration * self.contact_time, Body(hammer_mass, *hammer), Body(mass, *specimen))
            for duration, hammer, specimen in product(PRINTED_DURATIONS, hammers, specimens)
        ]
        tried = self._fit_printed(bodies)
        tried.sort(key=lambda item: item[0])
        for _, values in tried:
            yield values

    def _fit_printed(
        self, candidates: Sequence[tuple[float, Body, Body]]
    ) -> list[tuple[float, FloatArray]]:
        """Return what is left of both traces, and the start with the amplitudes that leave it.

        For tau_p, hammer and sample; each by itself.
        """
        measured = self.measured
        # The answers to v1 and to a force of 1 N, which add up.
        models = [
            ImpactModel(hammer, specimen, tau, speed, force)
            for speed, force in ((measured.impact_speed, 0.0), (0.0, 1.0))
            for tau, hammer, specimen in candidates
        ]
        answers = simulate_impacts(
            models,
            self.sampling_rate,
            self.traces.shape[1],
            start=-self.start,
            variant=ModelVariant.PRINTED,
        )
        peaks = np.abs(self.traces).max(axis=1)
        tried = []
        for (tau, hammer, specimen), by_speed, by_force in zip(
            candidates, answers[: len(candidates)], answers[len(candidates) :], strict=True
        ):
            force, left = _fit_amplitude(
                by_force[0], measured.hammer_polarity * self.traces[0] - by_speed[0]
            )
            gain, specimen_left = _fit_amplitude(by_speed[1] + force * by_force[1], self.traces[1])
            values = [
                tau, self.start, specimen.stiffness, specimen.damping_coefficient, force,
                hammer.stiffness, hammer.damping_coefficient, gain, 0.0, 0.0,
            ]  # fmt: skip
            total = left / float(peaks[0]) ** 2 + specimen_left / float(peaks[1]) ** 2
            tried.append((total, np.array(values)))
        return tried


def _fit_amplitude(shape: FloatArray, trace: FloatArray) -> tuple[float, float]:
    """Return the factor that lays a shape onto a trace, and the squares that are left."""
    power = float(shape @ shape)
    if power == 0.0:
        return 0.0, float(trace @ trace)
    factor = float(shape @ trace) / power
    return factor, float(np.sum((trace - factor * shape) ** 2))
