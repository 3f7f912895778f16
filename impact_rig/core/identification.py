"""The two-body model, identified from both traces."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice, product

import numpy as np
import scipy

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.filtering import low_pass, respond
from impact_rig.core.hits import MeanHit
from impact_rig.core.model import (
    Body,
    ImpactModel,
    ModelVariant,
    compute_sensitivities,
    list_parameters,
    simulate_impacts,
)
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.pulses import VERSED_SINE
from impact_rig.core.quantity import Comparable
from impact_rig.core.records import FloatArray, make_read_only
from impact_rig.core.sensors import FLAT, SensorResponse
from impact_rig.core.setup import RigSetup
from impact_rig.core.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
)

OFFSETS = ("hammer offset", "sample offset")
SENSOR_PARAMETERS = ("sample gain", *OFFSETS)
"""What the sensors add: gain of the sample's channel, signed [-], and both offsets [m/s^2]."""

ALL_POINTS = slice(None)


def name_parameters(variant: ModelVariant) -> tuple[str, ...]:
    """Return what is identified: the model's parameters, then the sensors'."""
    return (*list_parameters(variant), *SENSOR_PARAMETERS)


@dataclass(frozen=True)
class MeasuredModel:
    """The model seen through two sensors and a low-pass.

    Attributes
    ----------
    variant : ModelVariant
        How the bodies are driven.
    hammer_mass, moving_mass : float
        m1, and m2 with its accelerometer [kg].
    impact_speed : float
        v1 [m/s]; only the printed model has it.
    sampling_rate : float
        [Hz]
    count : int
        Points of each trace.
    cutoff_frequency : float
        Of the low-pass [Hz]; 0: none.
    hammer_polarity : float
        1 or -1: how the hammer's sensor is mounted.
    responses : tuple of SensorResponse
        Of the sensors.
    """

    variant: ModelVariant
    hammer_mass: float
    moving_mass: float
    impact_speed: float
    sampling_rate: float
    count: int
    cutoff_frequency: float = 0.0
    hammer_polarity: float = 1.0
    responses: tuple[SensorResponse, SensorResponse] = (FLAT, FLAT)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters in order."""
        return name_parameters(self.variant)

    def make_model(self, values: FloatArray) -> ImpactModel:
        """Return the model of parameter values in SI units, shape (p,).

        The driven model has neither k1 nor c1: its hammer's spring is 1 N/m.
        """
        found = dict(zip(self.names, values.tolist(), strict=True))
        return ImpactModel(
            hammer=Body(self.hammer_mass, found.get("k1", 1.0), found.get("c1", 0.0)),
            specimen=Body(self.moving_mass, found["k2"], found["c2"]),
            contact_time=found["tau_p"],
            impact_speed=self.impact_speed,
            peak_force=found["F0"],
        )

    def evaluate(
        self, values: FloatArray, points: slice = ALL_POINTS
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the traces and their derivatives, low-passed.

        Parameters
        ----------
        values : ndarray, shape (p,)
            In the order of `names`, SI units; t0 is counted from the first point.
        points : slice
            Which points to return.

        Returns
        -------
        traces : ndarray, shape (2, m)
            [m/s^2]
        derivatives : ndarray, shape (2, p, m)
            [m/s^2 per unit of the parameter]
        """
        gain = float(values[-3])
        bodies = compute_sensitivities(
            self.make_model(values),
            self.sampling_rate,
            self.count,
            start=-float(values[1]),
            variant=self.variant,
        )
        together = np.concatenate([bodies.derivatives, bodies.traces[:, np.newaxis]], axis=1)
        filtered = self.send_through(together, points)
        rows, traces = filtered[:, :-1], filtered[:, -1]
        derivatives = np.zeros((2, len(self.names), traces.shape[1]))
        derivatives[0, :-3] = self.hammer_polarity * rows[0]
        derivatives[1, :-3] = gain * rows[1]
        derivatives[1, -3] = traces[1]
        derivatives[0, -2] = derivatives[1, -1] = 1.0
        scales = np.array([[self.hammer_polarity], [gain]])
        return scales * traces + values[-2:, np.newaxis], derivatives

    def send_through(self, rows: FloatArray, points: slice = ALL_POINTS) -> FloatArray:
        """Send rows of both bodies, shape (2, ..., n), through sensors and low-pass.

        Zeros cost nothing. Returns `points` of them.
        """
        if not all(response.is_flat for response in self.responses):
            rows = np.stack(
                [
                    respond(body, response, self.sampling_rate)
                    for body, response in zip(rows, self.responses, strict=True)
                ]
            )
        if self.cutoff_frequency == 0.0:
            return rows[..., points]
        filtered = np.zeros_like(rows[..., points])
        # The driven hammer knows nothing of the sample.
        needed = rows.any(axis=-1)
        chosen = low_pass(rows[needed], self.cutoff_frequency, self.sampling_rate)
        filtered[needed] = chosen[..., points]
        return filtered


LARGEST_RELATIVE_UNCERTAINTY = 0.5
"""Standard uncertainty over the value above which a parameter counts as not determined [-], our
choice: beyond it the 95 % interval reaches zero."""
MEMBER_PART = 0.3
"""Least part in a combination, over the largest part, that makes a parameter a member [-], our
choice."""
SMALLEST_SINGULAR_VALUE = 1e-6
"""Singular value over the largest, of derivatives scaled to unit length, below which they count
as dependent [-], our choice: the derivatives are good to some 1e-7."""

LARGEST_RESIDUAL = 0.05
"""RMS residual over the peak above which the model does not describe a trace [-], our choice: over
a record of ten contacts it means some 15 % during the contact."""
GOOD_CHI_SQUARE = 2.0
"""Reduced chi-square below which a residual counts as noise [-], our choice: noise alone does not
reach it."""
TRACES = ("hammer", "sample")


def check_independence(names: Sequence[str], derivatives: FloatArray) -> None:
    """Require that no parameter can be replaced by others.

    Parameters
    ----------
    derivatives : ndarray, shape (n, p)
        Of all points in all parameters, weighted.

    Raises
    ------
    NotDeterminedError
        If a parameter moves nothing, or the derivatives are linearly dependent.
    """
    lengths = np.linalg.norm(derivatives, axis=0)
    if not np.all(np.isfinite(lengths)):
        raise NotDeterminedError("identification: the model's derivatives are no finite numbers")
    for name, length in zip(names, lengths, strict=True):
        if length == 0.0:
            raise NotDeterminedError(
                f"{name}: not determined, since the traces do not depend on it"
            )
    _, singular, directions = np.linalg.svd(derivatives / lengths, full_matrices=False)
    if singular[-1] < SMALLEST_SINGULAR_VALUE * singular[0]:
        members = _find_members(names, directions[-1])
        raise NotDeterminedError(
            f"{_join(members)}: not determined, since the traces tell them from each other no"
            " better than rounding does"
        )


def find_undetermined(
    names: Sequence[str], covariance: FloatArray, scales: FloatArray
) -> tuple[str, ...]:
    """Name the combinations that the data leave open.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        Of the parameters.
    scales : ndarray, shape (p,)
        What an uncertainty of each is large or small against: its value, as a rule.

    Returns
    -------
    tuple of str
        One sentence for each principal axis of the relative covariance that is longer than
        `LARGEST_RELATIVE_UNCERTAINTY`; empty: everything is determined.
    """
    relative = covariance / np.outer(scales, scales)
    standard = np.sqrt(np.diag(relative))
    variances, axes = np.linalg.eigh(relative)
    found = []
    for variance, axis in zip(variances[::-1], axes.T[::-1], strict=True):
        if variance <= LARGEST_RELATIVE_UNCERTAINTY**2:
            break
        members = _find_members(names, axis)
        figures = ", ".join(
            f"{name} \N{PLUS-MINUS SIGN}{100.0 * float(standard[names.index(name)]):.2g} %"
            for name in members
        )
        if len(members) == 1:
            found.append(f"{members[0]}: not determined by these traces ({figures})")
        else:
            found.append(f"{_join(members)}: determined only in combination ({figures})")
    return tuple(found)


def describe_misfit(model: str, residual: FloatArray) -> tuple[str, ...]:
    """Say which traces the model does not describe, so that its parameters mean little.

    Parameters
    ----------
    model : str
        Which model, in words.
    residual : ndarray, shape (2,)
        RMS residual of hammer and sample over the peak [-].
    """
    return tuple(
        f"everything: {model} does not describe the {trace}'s trace, of whose peak it leaves"
        f" {100.0 * part:.2g} %"
        for trace, part in zip(TRACES, residual, strict=True)
        if part > LARGEST_RESIDUAL
    )


def explain_covariance(model: str, residual: FloatArray, factors: FloatArray) -> tuple[str, ...]:
    """Say which traces the covariance was scaled up for, noticeably.

    Parameters
    ----------
    model : str
        Which model, in words.
    residual : ndarray, shape (2,)
        RMS residual of hammer and sample over the peak [-].
    factors : ndarray, shape (2,)
        Residual over noise [-].
    """
    return tuple(
        f"{model} leaves {100.0 * part:.2g} % of the {trace}'s peak, {factor:.2g} times its"
        " noise: the covariance is scaled up by the square of that"
        for trace, part, factor in zip(TRACES, residual, factors, strict=True)
        if factor**2 > GOOD_CHI_SQUARE
    )


def _find_members(names: Sequence[str], axis: FloatArray) -> list[str]:
    parts = np.abs(axis)
    return [
        name for name, part in zip(names, parts, strict=True) if part >= MEMBER_PART * parts.max()
    ]


def _join(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


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
class StartingValues(Comparable):
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


CORRELATION_REACH = 5.0
"""How far filtered noise is correlated, over 1 / cutoff [-]: beyond, less than e^-20 is left."""


def compute_raw_noise(mean: MeanHit) -> FloatArray:
    """Return the mean's raw noise [m/s^2], at least that of the converters' steps, shape (2,)."""
    if not mean.count:
        return np.asarray(mean.raw_noise)
    steps = np.sqrt(mean.summary.square_steps / 12.0)
    return np.asarray(np.maximum(mean.raw_noise, steps / mean.count))


@lru_cache(maxsize=16)
def compute_noise_correlation(
    cutoff_frequency: float, sampling_rate: float, step: int = 1
) -> FloatArray:
    """Compute what the low-pass makes of white noise of 1.

    Parameters
    ----------
    cutoff_frequency, sampling_rate : float
        Of the low-pass [Hz].
    step : int
        Points between those that are looked at.

    Returns
    -------
    ndarray, shape (2 k + 1,)
        Autocovariance from -k to k steps, its variance in the middle [-]; read-only.
    """
    if cutoff_frequency == 0.0:
        return make_read_only(np.ones(1))
    reach = math.ceil(CORRELATION_REACH * sampling_rate / cutoff_frequency)
    impulse = np.zeros(4 * reach + 1)
    impulse[2 * reach] = 1.0
    # The low-pass is symmetric in time, so that its autocorrelation is to apply it twice.
    for _ in range(2):
        impulse = low_pass(impulse, cutoff_frequency, sampling_rate)
    most = reach // step * step
    return make_read_only(impulse[2 * reach - most : 2 * reach + most + 1 : step])


EDGE = 1.5
"""Left out at both ends of the record, over 1 / cutoff [-]: the low-pass's padding disturbs them,
by e^-8 at that distance."""
LARGEST_EDGE_PART = 0.1
"""The same over the record at most [-], our choice."""
OVERSAMPLING = 3.0
"""Rate of the fitted points over twice the cutoff [-], our choice: what the low-pass leaves of
the noise beyond is 1e-4, so that nothing is lost by leaving out the points between."""
COARSE_POINTS = 40
"""Points in a contact on which the search begins [-], our choice: the traces are smooth."""
SMALLEST_NOISE = 1e-5
"""Noise over the peak that is assumed at least [-], our choice: a trace without noise would
weigh infinitely."""
TOLERANCE = 1e-5
"""Relative change of cost or parameters at which the search ends [-], our choice: the last step
has then left far less, since Gauss-Newton steps shrink by their square."""
DURATION_RANGE = 5.0
"""tau_p lies within this factor of its start either way [-], our choice."""
STIFFNESS_RANGE = 1e6
"""k lies within this factor of m (pi / tau_p)^2 either way [-], our choice: beyond lies
no metal."""
DAMPING_RANGE = 1e3
"""Largest c over 2 m pi / tau_p [-], our choice."""


@dataclass(frozen=True)
class FitSolution:
    """Where a search ended.

    Attributes
    ----------
    values : ndarray, shape (p,)
        Parameters [SI units].
    cost : float
        Half the weighted sum of squares [-].
    converged : bool
        False: the search used up its evaluations.
    at_bounds : tuple of str
        Parameters at the end of their range.
    """

    values: FloatArray
    cost: float
    converged: bool
    at_bounds: tuple[str, ...]


class FitProblem:
    """The model on the fitted points of two mean traces, each weighted by its noise.

    Parameters
    ----------
    traces : ndarray, shape (2, n)
        Mean traces [m/s^2].
    noise : ndarray, shape (2,)
        White noise of the mean traces before the low-pass [m/s^2].

    Attributes
    ----------
    points : slice
        Those that are fitted: the padding of the low-pass does not reach them.
    independent_points : float
        Of each trace, 2 * cutoff * duration [-].
    peaks : ndarray, shape (2,)
        Largest magnitudes of the traces [m/s^2].
    noise, filtered_noise : ndarray, shape (2,)
        White noise before the low-pass, and what that leaves of it [m/s^2].
    """

    def __init__(self, traces: FloatArray, noise: FloatArray, measured: MeasuredModel) -> None:
        self.traces, self.measured = traces, measured
        self.peaks = np.abs(traces).max(axis=1)
        rate, cutoff, count = measured.sampling_rate, measured.cutoff_frequency, measured.count
        edge, thinning, independent = 0, 1, 1.0
        if cutoff > 0.0:
            thinning = max(int(rate / (2.0 * cutoff * OVERSAMPLING)), 1)
            edge = min(math.ceil(EDGE * rate / cutoff), int(LARGEST_EDGE_PART * count))
            # Points that the thinned problem has as well: both then end at the same values.
            edge = math.ceil(edge / thinning) * thinning
            independent = min(2.0 * cutoff / rate, 1.0)
        self.points = slice(edge, count - edge, thinning)
        self.independent_points = independent * (count - 2 * edge)
        self.noise = np.maximum(noise, SMALLEST_NOISE * self.peaks)
        variance = compute_noise_correlation(cutoff, rate)
        self.filtered_noise = self.noise * math.sqrt(variance[variance.size // 2])
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def thin(self) -> "FitProblem":
        """Return the same problem on every few points: quick to solve, and nearly as good."""
        measured = self.measured
        width = measure_pulse(self.traces[0]).half_amplitude_width
        step = int(VERSED_SINE.pulse_factor * width / COARSE_POINTS)
        if measured.cutoff_frequency > 0.0:
            step = min(step, self.points.step)
        if step <= 1:
            return self
        traces = self.traces[:, ::step]
        return FitProblem(
            traces,
            # As much noise below the cutoff, at fewer points.
            self.noise / math.sqrt(step),
            replace(
                measured,
                sampling_rate=measured.sampling_rate / step,
                count=traces.shape[1],
            ),
        )

    def evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the model's traces and derivatives at the fitted points; the last are kept."""
        if self._last is None or not np.array_equal(self._last[0], values):
            self._last = (values.copy(), *self.measured.evaluate(values, self.points))
        return self._last[1], self._last[2]

    def weigh(self, rows: FloatArray) -> FloatArray:
        """Return rows of both traces, weighted and joined: shape (2, ..., m) to (..., 2 m)."""
        weighted = rows / self.noise.reshape(2, *(1,) * (rows.ndim - 1))
        return np.concatenate([weighted[0], weighted[1]], axis=-1)

    def solve(
        self, start: FloatArray, evaluations: int, tolerance: float = TOLERANCE
    ) -> FitSolution | None:
        """Search for the least sum of squares.

        Parameters
        ----------
        start : ndarray, shape (p,)
            Where to begin [SI units].
        evaluations : int
            Of the model at most.
        tolerance : float
            Relative change of cost or parameters at which the search ends [-].

        Returns
        -------
        FitSolution or None
            None: the search ran into numbers that no float holds.
        """
        # Without bounds it is quicker, and as a rule they are not met.
        free = self._minimise(start, evaluations, tolerance, bounded=False)
        return free or self._minimise(start, evaluations, tolerance, bounded=True)

    def _minimise(
        self, start: FloatArray, evaluations: int, tolerance: float, *, bounded: bool
    ) -> FitSolution | None:
        scales, low, high = self._find_scales_and_bounds(start)

        def compute_residual(scaled: FloatArray) -> FloatArray:
            traces, _ = self.evaluate(scaled * scales)
            return self.weigh(traces - self.traces[:, self.points])

        def compute_jacobian(scaled: FloatArray) -> FloatArray:
            return self.weigh(self.evaluate(scaled * scales)[1]).T * scales

        try:
            found = scipy.optimize.least_squares(
                compute_residual,
                np.clip(start, low, high) / scales,
                jac=compute_jacobian,
                method="trf" if bounded else "lm",
                bounds=(low / scales, high / scales) if bounded else (-np.inf, np.inf),
                x_scale="jac",
                ftol=tolerance,
                xtol=tolerance,
                gtol=tolerance,
                max_nfev=evaluations,
            )
        except (RigError, ValueError, np.linalg.LinAlgError):
            # It strayed to where the model has no meaning.
            return None
        values = found.x * scales
        if not (np.all(np.isfinite(values)) and math.isfinite(found.cost)):
            return None
        if not bounded and np.any((values <= low) | (values >= high)):
            return None
        at_bounds = tuple(
            name for name, mark in zip(self.measured.names, found.active_mask, strict=True) if mark
        )
        return FitSolution(values, float(found.cost), found.status > 0, at_bounds)

    def _find_scales_and_bounds(
        self, start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        given = dict(zip(self.measured.names, start.tolist(), strict=True))
        tau = given["tau_p"]
        ranges: dict[str, tuple[float, float, float]] = {
            "tau_p": (tau, tau / DURATION_RANGE, tau * DURATION_RANGE),
            "t0": (tau, given["t0"] - DURATION_RANGE * tau, given["t0"] + DURATION_RANGE * tau),
            "F0": (abs(given["F0"]) or 1.0, -math.inf, math.inf),
            "sample gain": (abs(given["sample gain"]) or 1.0, -math.inf, math.inf),
            "hammer offset": (float(self.peaks[0]), -math.inf, math.inf),
            "sample offset": (float(self.peaks[1]), -math.inf, math.inf),
        }
        for body, mass in (("1", self.measured.hammer_mass), ("2", self.measured.moving_mass)):
            stiffness = mass * (math.pi / tau) ** 2
            damping = 2.0 * mass * math.pi / tau
            ranges["k" + body] = (
                stiffness, stiffness / STIFFNESS_RANGE, stiffness * STIFFNESS_RANGE,
            )  # fmt: skip
            ranges["c" + body] = (damping, 0.0, damping * DAMPING_RANGE)
        table = np.array([ranges[name] for name in self.measured.names])
        return table[:, 0], table[:, 1], table[:, 2]

    def compute_residual_rms(self, values: FloatArray) -> FloatArray:
        """Return the RMS residual of both traces over the fitted points [m/s^2], shape (2,)."""
        residual = self.traces[:, self.points] - self.evaluate(values)[0]
        return np.asarray(np.sqrt(np.mean(residual**2, axis=1)))

    def compute_covariance(self, values: FloatArray, factors: FloatArray) -> FloatArray:
        """Compute the covariance of the parameters for white noise that went through the low-pass.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Parameters [SI units].
        factors : ndarray, shape (2,)
            By which the noise of each trace is larger than `noise` [-].

        Returns
        -------
        ndarray, shape (p, p)
            [SI units]
        """
        weighted = self.evaluate(values)[1] / self.noise[:, np.newaxis, np.newaxis]
        lengths = np.sqrt(np.sum(weighted**2, axis=(0, 2)))
        weighted /= lengths[:, np.newaxis]
        measured = self.measured
        correlation = compute_noise_correlation(
            measured.cutoff_frequency, measured.sampling_rate, self.points.step
        )
        # Least squares is (J^T J)^-1 J^T r, and r has the covariance C of filtered noise.
        kernel = correlation[np.newaxis, np.newaxis]
        seen = scipy.signal.fftconvolve(weighted, kernel, mode="same", axes=-1)
        information = np.einsum("cip,cjp->ij", weighted, weighted)
        spread = np.einsum("c,cip,cjp->ij", factors**2, weighted, seen, optimize=True)
        inverse = np.linalg.inv(information)
        covariance = inverse @ spread @ inverse / np.outer(lengths, lengths)
        return np.asarray((covariance + covariance.T) / 2.0)

    def step_to_hits(self, values: FloatArray, hits: Sequence[FloatArray]) -> FloatArray:
        """Take one Gauss-Newton step from the mean's solution to every hit.

        Parameters
        ----------
        values : ndarray, shape (p,)
            Solution for the mean [SI units].
        hits : sequence of ndarray, shape (2, n)
            Traces of the hits, aligned as the mean's [m/s^2].

        Returns
        -------
        ndarray, shape (hits, p)
            [SI units]
        """
        traces, derivatives = self.evaluate(values)
        jacobian = self.weigh(derivatives).T
        lengths = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.pinv(jacobian / lengths)
        steps = [inverse @ self.weigh(hit[:, self.points] - traces) / lengths for hit in hits]
        return np.asarray(values + np.array(steps).reshape(-1, values.size))


MOST_STARTS = 4
"""That are tried at most [-], our choice."""
FIRST_EVALUATIONS = 15
"""Evaluations of the model from each start [-], our choice: a good one needs some ten."""
MOST_EVALUATIONS = 50
"""The same when the search goes on from the best [-], our choice."""
ROUGH_TOLERANCE = 1e-4
"""Relative change of cost or parameters at which the search on few points ends [-], our choice:
the one on all points goes on from there."""
HOPELESS_RESIDUAL = 2.0 * LARGEST_RESIDUAL
"""RMS residual over the peak that no search goes on from [-], our choice: of traces that a model
describes, a few steps from one of the starts leave less."""
EQUAL_COST = 1e-3
"""Relative difference of cost below which two minima are one [-], our choice."""
GOOD_RESIDUAL = 0.02
"""RMS residual over the peak below which no other start is tried [-], our choice: a minimum that
is not the lowest leaves several times that."""


class MisfitError(NotDeterminedError):
    """The search found no parameters that come near the traces."""


def find_best_fit(problem: FitProblem, given: StartingValues) -> FitSolution:
    """Search on every few points from several starts, then on all from the best.

    Raises
    ------
    MisfitError
        If the search does not converge.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    coarse = problem.thin()
    starts = find_starts(coarse.measured, coarse.traces, given)
    solution = _search(coarse, islice(starts, MOST_STARTS))
    if coarse is problem:
        return solution
    refined = problem.solve(solution.values, MOST_EVALUATIONS)
    if refined is None or not refined.converged:
        raise MisfitError(_describe_failure(problem, refined))
    return refined


def _search(problem: FitProblem, starts: Iterable[FloatArray]) -> FitSolution:
    """Look a few steps from several starts, and go on from the best."""
    best: FitSolution | None = None
    for values in starts:
        found = problem.solve(values, FIRST_EVALUATIONS, ROUGH_TOLERANCE)
        if found is None:
            continue
        if best is None or found.cost < (1.0 - EQUAL_COST) * best.cost:
            best = found
        elif found.converged and found.cost < (1.0 + EQUAL_COST) * best.cost:
            # Two ways lead to the same place.
            break
        if _is_good(problem, best):
            return best
    if best is not None and not best.converged and not _is_hopeless(problem, best):
        best = problem.solve(best.values, MOST_EVALUATIONS, ROUGH_TOLERANCE)
    if best is None or not best.converged:
        raise MisfitError(_describe_failure(problem, best))
    return best


def _is_hopeless(problem: FitProblem, solution: FitSolution) -> bool:
    """Whether the model is too far from a trace to come near it."""
    rms = problem.compute_residual_rms(solution.values)
    return bool(np.any(rms > HOPELESS_RESIDUAL * problem.peaks))


def _describe_failure(problem: FitProblem, last: FitSolution | None) -> str:
    text = f"identification: the search for the {problem.measured.variant.value} model "
    if last is None:
        return text + "failed from every start"
    left = 100.0 * problem.compute_residual_rms(last.values) / problem.peaks
    return (
        f"{text}did not converge, and leaves {left[0]:.2g} % of the hammer's and"
        f" {left[1]:.2g} % of the sample's peak"
    )


def _is_good(problem: FitProblem, solution: FitSolution) -> bool:
    """Whether no other start can do much better."""
    rms = problem.compute_residual_rms(solution.values)
    by_peak = rms < GOOD_RESIDUAL * problem.peaks
    by_noise = rms**2 < GOOD_CHI_SQUARE * problem.filtered_noise**2
    return solution.converged and not solution.at_bounds and bool(np.all(by_peak | by_noise))


@dataclass(frozen=True)
class Identification:
    """The model laid onto the mean traces of one sample.

    Attributes
    ----------
    variant : ModelVariant
        Which model.
    names : tuple of str
        Parameters: tau_p [s], t0 (start of the contact from the mean's first point) [s], k2
        [N/m], c2 [N s/m], F0 [N]; of the printed model also k1 [N/m] and c1 [N s/m]; gain of the
        sample's channel, signed [-], and offsets of hammer and sample [m/s^2].
    values : ndarray, shape (p,)
        [SI units]
    covariance : ndarray, shape (p, p)
        Of the mean traces' noise [SI units]; scaled up by the square of each channel's
        Birge ratio, residual over what white noise of the baseline's size would leave, where
        that is above 1. Start and offsets scatter more: alignment and baseline have moved them
        before.
    hit_values : ndarray, shape (hits, p)
        Parameters of each hit, one Gauss-Newton step from `values` [SI units]. Their mean is
        `values`; their scatter holds what differs from hit to hit.
    measured, model, residual : ndarray, shape (2, n)
        Mean traces, the low-passed model, and their difference [m/s^2].
    residual_percent : tuple of float
        RMS of the residual over the trace's peak, hammer and sample [%].
    chi_square : float
        Reduced chi-square of both traces [-]; 1: nothing but noise is left.
    criterion : float
        Bayesian information criterion, sum of N ln(mean square over peak^2) over both traces plus
        p ln(2 N), where N = 2 * cutoff * duration is the number of independent points [-]. The
        smaller one describes the traces better; ten less is very strong evidence.
    undetermined : tuple of str
        What the traces do not determine, one sentence each.
    notes : tuple of str
        What else must be known to read the values.
    """

    variant: ModelVariant
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    hit_values: FloatArray
    measured: FloatArray
    model: FloatArray
    residual: FloatArray
    residual_percent: tuple[float, float]
    chi_square: float
    criterion: float
    undetermined: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def find(self, name: str) -> float:
        """Return the value of one parameter [its SI unit]."""
        return float(self.values[self.names.index(name)])

    @property
    def open_parameters(self) -> tuple[str, ...]:
        """Parameters whose standard uncertainty is more than `LARGEST_RELATIVE_UNCERTAINTY`."""
        standard = np.sqrt(np.diag(self.covariance))
        return tuple(
            name
            for name, value, own in zip(self.names, self.values, standard, strict=True)
            if own > LARGEST_RELATIVE_UNCERTAINTY * abs(value) and name not in ("t0", *OFFSETS)
        )

    @property
    def describes_traces(self) -> bool:
        """Whether the residual of both traces is below `LARGEST_RESIDUAL`."""
        return max(self.residual_percent) <= 100.0 * LARGEST_RESIDUAL

    @property
    def force_balance(self) -> float:
        """Force that the sample feels over force that the hammer feels, magnitudes [-].

        1 by Newton's third law if masses and calibrations are right. The printed model takes its
        force from v1 as well, and says less about it.
        """
        return abs(self.find("sample gain"))


def identify_model(
    mean: MeanHit,
    setup: RigSetup,
    sample: str,
    variant: ModelVariant = ModelVariant.DRIVEN,
    start: StartingValues | None = None,
) -> Identification:
    """Fit one variant of the model to both mean traces of a sample.

    Parameters
    ----------
    mean : MeanHit
        Both channels, either polarity.
    setup : RigSetup
        Masses, v1, sensors and the low-pass; all are taken as exact.
    start : StartingValues or None
        What is already believed; poor values do no harm.

    Returns
    -------
    Identification

    Raises
    ------
    NotDeterminedError
        If the sample was not measured, the search does not converge, or the traces do not tell
        the parameters from each other.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    if mean.traces.shape[0] <= 1:
        raise NotDeterminedError("identification: the sample's trace was not measured")
    if variant is ModelVariant.PRINTED and math.isnan(setup.impact_speed):
        raise NotDeterminedError("identification of the printed model: v1 is not known")
    peaks = np.abs(mean.traces).max(axis=1)
    if not np.all(np.isfinite(peaks) & (peaks > 0.0)):
        raise NotDeterminedError(
            "identification: a trace is flat or has points that are no numbers"
        )
    polarity = float(np.sign(mean.traces[0, np.argmax(np.abs(mean.traces[0]))]))
    measured = MeasuredModel(
        variant=variant,
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.get_moving_mass(sample),
        impact_speed=float(np.nan_to_num(setup.impact_speed)),
        sampling_rate=mean.sampling_rate,
        count=mean.traces.shape[1],
        cutoff_frequency=setup.analysis.cutoff_frequency,
        # In the printed model the sample pushes the hammer back; the driven one has F0 signed.
        hammer_polarity=-polarity if variant is ModelVariant.PRINTED else 1.0,
        responses=setup.responses,
    )
    problem = FitProblem(mean.traces, compute_raw_noise(mean), measured)
    solution = find_best_fit(problem, start or StartingValues())
    return _report(problem, solution, mean)


def _report(problem: FitProblem, solution: FitSolution, mean: MeanHit) -> Identification:
    values, names = solution.values, problem.measured.names
    traces, _ = problem.measured.evaluate(values)
    check_independence(names, problem.weigh(problem.evaluate(values)[1]).T)
    rms = problem.compute_residual_rms(values)
    total = 2.0 * problem.independent_points
    freedom = max(total - len(names), 1.0)
    squares = (rms / problem.filtered_noise) ** 2 * total / freedom
    factors = np.sqrt(np.maximum(squares, 1.0))
    covariance = problem.compute_covariance(values, factors)
    if not np.all(np.isfinite(covariance)):
        raise NotDeterminedError("identification: the covariance is no finite number")
    hits = list(mean.cut_hits())
    left = rms / problem.peaks
    variant = problem.measured.variant
    model = f"the {variant.value} model"
    by_peak = np.log(np.maximum(left, SMALLEST_NOISE) ** 2)
    return Identification(
        variant=variant,
        names=names,
        values=make_read_only(values),
        covariance=make_read_only(covariance),
        hit_values=make_read_only(problem.step_to_hits(values, hits)),
        measured=problem.traces,
        model=make_read_only(traces),
        residual=make_read_only(problem.traces - traces),
        residual_percent=(100.0 * float(left[0]), 100.0 * float(left[1])),
        chi_square=float(np.mean(squares)),
        criterion=problem.independent_points * float(by_peak.sum()) + len(names) * math.log(total),
        undetermined=describe_misfit(model, left)
        + tuple(
            f"{name}: not determined, since the search ran to the end of its range"
            for name in solution.at_bounds
        )
        + _find_open_combinations(names, values, covariance, solution.at_bounds),
        notes=explain_covariance(model, left, factors),
    )


def _find_open_combinations(
    names: tuple[str, ...], values: FloatArray, covariance: FloatArray, at_bounds: tuple[str, ...]
) -> tuple[str, ...]:
    scales = np.abs(values)
    scales[names.index("t0")] = scales[names.index("tau_p")]
    chosen = [
        index
        for index, name in enumerate(names)
        if name not in (*at_bounds, *OFFSETS) and scales[index] > 0.0
    ]
    return find_undetermined(
        [names[index] for index in chosen], covariance[np.ix_(chosen, chosen)], scales[chosen]
    )
