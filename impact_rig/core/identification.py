"""The two-body model, identified from both traces."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
import scipy

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.filtering import Chain, show_bodies
from impact_rig.core.hits import MeanHit
from impact_rig.core.model import Body, ImpactModel, ModelVariant, simulate_impacts
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.pulses import VERSED_SINE
from impact_rig.core.records import FloatArray, make_read_only
from impact_rig.core.setup import RigSetup
from impact_rig.core.verdict import CHANNELS

MODEL_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0")
OFFSETS = ("hammer offset", "sample offset")
NAMES = (*MODEL_PARAMETERS, "sample gain", *OFFSETS)
"""What is identified, in SI units: t0 is counted from the first point, the gain is signed."""
ALL_POINTS = slice(None)


@dataclass(frozen=True)
class Limits:
    """Of the search and of what is said of it; all are our choices."""

    frequencies: tuple[float, ...] = (0.8, 1.5, 2.6, 3.5, 4.8, 8.7, 16.0)  # [rad / tau_p] tried
    shortest_tail: int = 8  # [points] after the contact that show a ringing
    step: float = 2.0**-25  # [-] of derivatives: rounding and curvature are then some 3e-8 each
    least_noise: float = 1e-5  # [-] of the peak: a trace without noise would weigh infinitely
    stiffness_range: float = 1e6  # [-] of k over m (pi / tau_p)^2, either way
    near: float = 0.05  # [-] of the peak: traces that leave more do not tell the force balance


LIMITS = Limits()
LARGEST_RELATIVE_UNCERTAINTY = 0.5
"""Standard uncertainty over the value above which a parameter is not determined [-], our choice:
beyond it the 95 % interval reaches zero."""


def find_largest_residual(noise: float) -> float:
    """Return the RMS that a model may leave of a trace that it describes, both over the peak [-].

    Three times the noise, or what hits that differ by 2 % in speed leave at most.
    """
    return max(5e-4, 3.0 * noise)


@dataclass(frozen=True)
class Identification:
    """The driven model laid onto the mean traces of one sample; its parameters are `NAMES`."""

    values: FloatArray  # shape (p,)
    # Of the mean traces' noise, shape (p, p), scaled up by the square of each channel's residual
    # over its noise where that is above 1. Start and offsets scatter more: alignment and baseline
    # have moved them before.
    covariance: FloatArray
    hit_values: FloatArray  # of each hit, one Gauss-Newton step from `values`, shape (hits, p)
    model: FloatArray  # its traces, low-passed [m/s^2], shape (2, n)
    residual_percent: tuple[float, float]  # RMS over the peak of hammer and sample [%]
    chi_square: float  # reduced, of both traces [-]; 1: nothing but noise is left
    misfit: str | None = None  # why no parameter but the force balance is determined

    def find(self, name: str) -> float:
        """Return the value of one parameter [its SI unit]."""
        return float(self.values[NAMES.index(name)])

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the parameters that the traces do not determine."""
        standard = np.sqrt(np.diag(self.covariance))
        return tuple(
            name
            for name, value, own in zip(NAMES, self.values, standard, strict=True)
            if own > LARGEST_RELATIVE_UNCERTAINTY * abs(value) and name not in ("t0", *OFFSETS)
        )

    @property
    def force_balance(self) -> float:
        """Force on the sample over force on the hammer, 1 by Newton's third law [-]."""
        return abs(self.find("sample gain"))


def identify_model(mean: MeanHit, setup: RigSetup, sample: str) -> Identification:
    """Fit the driven model to both mean traces of a sample.

    Masses, sensors and the low-pass are taken as exact.

    Raises
    ------
    NotDeterminedError
        If the sample was not measured, the model does not describe the traces, or they do not
        tell the parameters from each other.
    SignalError
        If the hammer's trace has no whole pulse.
    """
    if mean.traces.shape[0] <= 1:
        raise NotDeterminedError("the sample's trace was not measured")
    peaks = np.abs(mean.traces).max(axis=1)
    if not np.all(np.isfinite(peaks) & (peaks > 0.0)):
        raise NotDeterminedError("a trace is flat or has points that are no numbers")
    problem = FitProblem(
        traces=mean.traces,
        noise=np.maximum(compute_raw_noise(mean), LIMITS.least_noise * peaks),
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.get_moving_mass(sample),
        chains=setup.find_chains(mean.sampling_rate),
    )
    found = problem.solve(problem.find_start())
    return _report(problem, found, mean)


@dataclass(frozen=True)
class FitProblem:
    """The model, seen through two sensors and a low-pass, and the two traces that it is to be."""

    traces: FloatArray  # means [m/s^2], shape (2, n)
    noise: FloatArray  # white, before the low-pass [m/s^2], shape (2,)
    hammer_mass: float  # [kg]
    moving_mass: float  # [kg], with the accelerometer
    chains: tuple[Chain, Chain]  # what both went through

    @property
    def sampling_rate(self) -> float:
        """Of the traces [Hz]."""
        return self.chains[0].sampling_rate

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest magnitudes of the traces [m/s^2], shape (2,)."""
        return np.asarray(np.abs(self.traces).max(axis=1))

    @cached_property
    def points(self) -> slice:
        """Those that are fitted: the padding of the low-pass does not reach them."""
        rate, cutoff = self.sampling_rate, self.chains[0].cutoff_frequency
        count = self.traces.shape[1]
        if cutoff == 0.0:
            return slice(0, count, 1)
        # Three times as many points as the low-pass leaves: nothing is lost.
        step = max(int(rate / (2.0 * cutoff * 3.0)), 1)
        # The low-pass is not right at the record's ends; e^-8 of that is left so far inside.
        edge = min(math.ceil(1.5 * rate / cutoff), int(0.1 * count))
        return slice(edge, count - edge, step)

    def simulate(self, rows: FloatArray) -> FloatArray:
        """Return the accelerations of both bodies for rows of parameters, shape (rows, 2, n).

        The driven model needs neither the hammer's spring nor its speed.
        """
        models = [
            ImpactModel(
                hammer=Body(self.hammer_mass, 1.0, 0.0),
                specimen=Body(self.moving_mass, stiffness, damping),
                contact_time=contact_time,
                impact_speed=0.0,
                peak_force=force,
            )
            for contact_time, _, stiffness, damping, force in rows[:, :5].tolist()
        ]
        return simulate_impacts(
            models,
            self.sampling_rate,
            self.traces.shape[1],
            start=-rows[:, 1],
            variant=ModelVariant.DRIVEN,
        )

    def show(self, bodies: FloatArray, points: slice = ALL_POINTS) -> FloatArray:
        """Return the traces of both bodies' accelerations, shape (rows, 2, n)."""
        return show_bodies(bodies, self.chains)[..., points]

    def evaluate(
        self, values: FloatArray, points: slice = ALL_POINTS
    ) -> tuple[FloatArray, FloatArray]:
        """Return the model's traces, shape (2, m), and derivatives, shape (p, 2, m), SI units."""
        count = len(MODEL_PARAMETERS)
        rate = 2.0 * math.pi / values[0]
        scales = [1.0 / rate, 1.0 / rate]
        scales += [values[2] + self.moving_mass * rate**2, values[3] + self.moving_mass * rate]
        scales.append(abs(values[4]) or 1.0)
        moved = np.tile(values, (count, 1))
        moved[np.diag_indices(count)] += LIMITS.step * np.array(scales)
        steps = np.diagonal(moved) - values[:count]
        bodies = self.simulate(np.concatenate((values[np.newaxis], moved)))
        bodies[1:] = (bodies[1:] - bodies[0]) / steps[:, np.newaxis, np.newaxis]
        shown = self.show(bodies, points)
        gains = np.array([[1.0], [values[-3]]])
        derivatives = np.zeros((len(NAMES), 2, shown.shape[-1]))
        derivatives[:count] = gains * shown[1:]
        derivatives[-3, 1] = shown[0, 1]
        derivatives[-2, 0] = derivatives[-1, 1] = 1.0
        return gains * shown[0] + values[-2:, np.newaxis], derivatives

    def weigh(self, rows: FloatArray) -> FloatArray:
        """Return rows of both traces over the noise and joined: (..., 2, m) to (..., 2 m)."""
        return (rows / self.noise[:, np.newaxis]).reshape(*rows.shape[:-2], -1)

    def solve(self, start: FloatArray) -> FloatArray:
        """Return the parameters with the least sum of squares next to `start`.

        Raises
        ------
        NotDeterminedError
            If the search does not end.
        """
        scales, low, high = self.find_bounds(start)

        # Residual and derivatives are asked for apart, at the same place.
        @lru_cache(maxsize=1)
        def evaluate(*scaled: float) -> tuple[FloatArray, FloatArray]:
            traces, derivatives = self.evaluate(np.array(scaled) * scales, self.points)
            residual = self.weigh(traces - self.traces[:, self.points])
            return residual, (self.weigh(derivatives) * scales[:, np.newaxis]).T

        found = scipy.optimize.least_squares(
            lambda scaled: evaluate(*scaled)[0],
            np.clip(start, low, high) / scales,
            jac=lambda scaled: evaluate(*scaled)[1],
            bounds=(low / scales, high / scales),
            x_scale="jac",
            ftol=1e-5,
            xtol=1e-5,
            gtol=1e-12,
            max_nfev=60,
        )
        if found.status <= 0:
            raise NotDeterminedError("not determined, since no search ends")
        return np.asarray(found.x * scales)

    def find_bounds(self, start: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the size of each parameter, and between which values it is looked for."""
        contact_time, begin, _, _, force, gain, _, _ = start.tolist()
        stiffness = self.moving_mass * (math.pi / contact_time) ** 2
        damping = 2.0 * self.moving_mass * math.pi / contact_time
        # tau_p, and how far the start may be off in it, either way.
        reach = 5.0
        ranges = [
            (contact_time, contact_time / reach, contact_time * reach),
            (contact_time, begin - reach * contact_time, begin + reach * contact_time),
            (stiffness, stiffness / LIMITS.stiffness_range, stiffness * LIMITS.stiffness_range),
            (damping, 0.0, damping * 1e3),
        ]
        amplitudes = abs(force) or 1.0, abs(gain) or 1.0, *self.peaks.tolist()
        ranges += [(size, -math.inf, math.inf) for size in amplitudes]
        sizes, low, high = np.array(ranges).T
        return sizes, low, high

    def find_start(self) -> FloatArray:
        """Return the best of many parameters, with the amplitudes that suit each.

        Raises
        ------
        SignalError
            If the hammer's trace has no whole pulse.
        """
        pulse = measure_pulse(self.traces[0])
        contact_time = VERSED_SINE.pulse_factor * pulse.half_amplitude_width / self.sampling_rate
        begin = pulse.middle / self.sampling_rate - contact_time / 2.0
        ringing = self._find_ringing(contact_time, begin)
        # Damping ratios, lower ones where the sample rings.
        pairs = [
            *product(LIMITS.frequencies, (0.1, 0.3, 0.6)),
            *product((ringing,), (0.01, 0.05, 0.2)),
        ]
        frequencies, ratios = np.array(pairs).T / [[contact_time], [1.0]]
        rows = np.zeros((len(pairs), len(NAMES)))
        rows[:, 0], rows[:, 1], rows[:, 4] = contact_time, begin, 1.0
        rows[:, 2] = self.moving_mass * frequencies**2
        rows[:, 3] = 2.0 * ratios * self.moving_mass * frequencies
        bodies = self.simulate(rows)
        power = np.sum(bodies**2, axis=-1)
        factors = np.sum(bodies * self.traces, axis=-1) / np.where(power > 0.0, power, 1.0)
        left = np.sum((self.traces - factors[..., np.newaxis] * bodies) ** 2, axis=-1)
        rows[:, 4], rows[:, 5] = factors[:, 0], factors[:, 1] / factors[:, 0]
        return np.asarray(rows[np.argmin(left[:, 1])])

    def _find_ringing(self, contact_time: float, begin: float) -> float:
        """Return the strongest frequency of what follows the contact, times tau_p [rad]."""
        tail = self.traces[1, math.ceil((begin + contact_time) * self.sampling_rate) :]
        if tail.size < LIMITS.shortest_tail:
            return LIMITS.frequencies[0]
        length = 4 * tail.size
        strongest = max(int(np.argmax(np.abs(np.fft.rfft(tail, length)))), 1)
        return 2.0 * math.pi * strongest / length * self.sampling_rate * contact_time

    def compute_covariance(self, jacobian: FloatArray, factors: FloatArray) -> FloatArray:
        """Return the covariance of the parameters for white noise that went through the low-pass.

        Parameters
        ----------
        jacobian : ndarray, shape (p, 2, m)
            Of the fitted points, over the noise.
        factors : ndarray, shape (2,)
            By which the noise of each trace is larger than `noise` [-].
        """
        lengths = np.sqrt(np.sum(jacobian**2, axis=(1, 2)))
        scaled = jacobian / np.where(lengths > 0.0, lengths, 1.0)[:, np.newaxis, np.newaxis]
        joined = scaled.reshape(len(lengths), -1)
        is_finite = np.all(np.isfinite(lengths))
        singular = np.linalg.svd(joined, compute_uv=False) if is_finite else np.zeros(1)
        # Derivatives are good to 1e-7.
        if singular[-1] <= 1e-6 * singular[0]:
            raise NotDeterminedError(
                "not determined, since the traces do not tell its parameters apart"
            )
        # Least squares is (J^T J)^-1 J^T r, and r has the covariance C of filtered noise.
        kernel = self.chains[0].correlate_noise(self.points.step)
        seen = scipy.ndimage.convolve1d(scaled, kernel, axis=-1, mode="constant")
        seen *= factors[:, np.newaxis] ** 2
        inverse = np.linalg.inv(joined @ joined.T)
        spread = joined @ seen.reshape(joined.shape).T
        covariance = inverse @ spread @ inverse / np.outer(lengths, lengths)
        return np.asarray((covariance + covariance.T) / 2.0)


def compute_raw_noise(mean: MeanHit) -> FloatArray:
    """Return the mean's raw noise [m/s^2], at least that of the converters' steps, shape (2,)."""
    steps = np.sqrt(mean.square_steps / 12.0)
    return np.asarray(np.maximum(mean.raw_noise, steps / mean.count))


def _report(problem: FitProblem, values: FloatArray, mean: MeanHit) -> Identification:
    noise, points = problem.noise, problem.points
    traces, derivatives = problem.evaluate(values, points)
    jacobian = derivatives / noise[:, np.newaxis]
    residual = problem.traces[:, points] - traces
    rms = np.sqrt(np.mean(residual**2, axis=1))
    chain = problem.chains[0]
    variance = chain.correlate_noise()
    filtered_noise = noise * math.sqrt(variance[variance.size // 2])
    left = rms / problem.peaks
    misfit = None
    for name, part, level in zip(CHANNELS, left, filtered_noise / problem.peaks, strict=True):
        if part > (largest := find_largest_residual(float(level))):
            misfit = (
                "not determined, since the two-body model does not describe both"
                f" traces: it leaves {100.0 * part:.2g} % of the {name}'s peak, where"
                f" {100.0 * largest:.2g} % would be noise"
            )
    if misfit is not None and left.max() > LIMITS.near:
        raise NotDeterminedError(misfit)
    independent = points.stop - points.start
    if chain.cutoff_frequency:
        independent *= min(2.0 * chain.relative_cutoff, 1.0)
    total = 2.0 * independent
    squares = (rms / filtered_noise) ** 2 * total / max(total - len(NAMES), 1.0)
    factors = np.sqrt(np.maximum(squares, 1.0))
    covariance = problem.compute_covariance(jacobian, factors)
    # One Gauss-Newton step from the mean's solution to every hit.
    joined = jacobian.reshape(len(NAMES), -1).T
    lengths = np.linalg.norm(joined, axis=0)
    inverse = np.linalg.pinv(joined / lengths)
    steps = [inverse @ problem.weigh(hit[:, points] - traces) / lengths for hit in mean.cut_hits()]
    return Identification(
        values=make_read_only(values),
        covariance=make_read_only(covariance),
        hit_values=make_read_only(values + np.array(steps).reshape(-1, values.size)),
        model=make_read_only(problem.evaluate(values)[0]),
        residual_percent=(100.0 * float(left[0]), 100.0 * float(left[1])),
        chi_square=float(np.mean(squares)),
        misfit=misfit,
    )
