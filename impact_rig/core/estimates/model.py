"""The two-body model of the paper, in closed form, and compared with measurements as there."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy

from impact_rig.core.estimates.equations import estimate_equivalent_mass
from impact_rig.core.given.errors import (
    ParameterError,
    SignalError,
    check_not_negative,
    check_positive,
)
from impact_rig.core.given.filtering import Chain
from impact_rig.core.given.records import FloatArray, make_read_only
from impact_rig.core.mean.mean_hit import MeanHit

FULL_TURN = 2.0 * math.pi
"""w tau_p [rad]."""


class ModelVariant(Enum):
    """Drive of the two bodies.

    `PRINTED` is equations (1) and (2) as they stand. `DRIVEN` is what Figs. 5 and 6 describe:
    the hammer's trace is the versed-sine (4) itself, and the sample is driven by +F(t) alone.
    """

    DRIVEN = "driven"
    PRINTED = "printed"


@dataclass(frozen=True)
class Body:
    """One body: a mass on a spring and a damper."""

    mass: float  # [kg]
    stiffness: float  # [N/m]
    damping_coefficient: float  # [N s/m]

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("mass of a body", self.mass, "kg")
        check_positive("stiffness of a body", self.stiffness, "N/m")
        check_not_negative("damping coefficient of a body", self.damping_coefficient, "N s/m")


@dataclass(frozen=True)
class ImpactModel:
    """Parameters of one impact."""

    hammer: Body  # m1, k1, c1 and m2, k2, c2
    specimen: Body
    contact_time: float  # tau_p [s]
    impact_speed: float  # v1 [m/s]
    peak_force: float  # F0 [N], signed; equation (1) has -F(t) on body 2

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("contact time", self.contact_time, "s")
        for name, value in (("speed", self.impact_speed), ("peak force", self.peak_force)):
            if not np.isfinite(value):
                raise ParameterError(f"impact {name} is {value!r}: it must be a finite number")


def compute_peak_force(
    hammer_mass: float, moving_mass: float, impact_speed: float, contact_time: float
) -> float:
    """Compute F0 [N] of an elastic impact from the momentum balance F0 = 4 m_eq v1 / tau_p.

    The impulse of a versed-sine is F0 tau_p / 2; masses in kg, speed in m/s, time in s. Raises
    `ParameterError` for impossible ones.
    """
    check_positive("contact time", contact_time, "s")
    equivalent = estimate_equivalent_mass(hammer_mass, moving_mass)
    return 4.0 * equivalent * impact_speed / contact_time


def simulate_impact(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.PRINTED,
) -> tuple[FloatArray, FloatArray]:
    """Simulate the accelerations of both bodies on a uniform time grid.

    Parameters
    ----------
    sampling_rate : float
        [Hz]
    start : float
        Time of the first point, counted from the start of the contact [s]; before the contact
        both accelerations are zero.

    Returns
    -------
    hammer, specimen : ndarray, shape (count,)
        x1'' and x2'' [m/s^2]. With v1 and c1 the printed model steps at t = 0 and at tau_p:
        that is the model, and nothing here smooths it.

    Raises
    ------
    ParameterError
        If the sampling rate is no positive number, or the start none at all.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    if not math.isfinite(start):
        raise ParameterError("the start of a time grid must be a finite number")
    rate, contact_time = sampling_rate, model.contact_time
    # The first point in the contact, and the first one beyond it.
    first = min(max(math.ceil(-start * rate), 0), count)
    free = min(max(math.floor((contact_time - start) * rate) + 1, 0), count)
    begin = min(max(start + first / rate, 0.0), contact_time)
    result = np.zeros((2, count))
    result[:, first:free], end = _follow(model, variant, rate, begin * rate, free - first)
    late = max(start + free / rate - contact_time, 0.0)
    scale = contact_time / FULL_TURN
    decays = [
        _find_decays(body, scale * position, speed, late, rate)
        for body, position, speed in (
            (model.hammer, end[0], end[2]),
            (model.specimen, end[1], end[3]),
        )
    ]
    # The driven hammer rests after the contact.
    moving = slice(0, 2) if variant is ModelVariant.PRINTED else slice(1, 2)
    result[moving, free:] = _let_decay(decays[moving], count - free)
    return result[0], result[1]


def _describe(
    model: ImpactModel, sampling_rate: float, variant: ModelVariant
) -> tuple[FloatArray, FloatArray]:
    """Return A of y' = A y during the contact, its time counted in points, and y at the start.

    The state y is the positions of both bodies times w = 2 pi / tau_p, their velocities, and 1,
    cos(w t) and sin(w t), which make the force.
    """
    first, second = model.hammer, model.specimen
    m1, m2, rate = first.mass, second.mass, sampling_rate
    turn = FULL_TURN / model.contact_time / rate
    force = model.peak_force / (2.0 * rate)
    k1, c1, speed, f1, f2 = 0.0, 0.0, 0.0, -force / m1, force / m2
    if variant is ModelVariant.PRINTED:
        k1, c1, speed = first.stiffness, first.damping_coefficient, model.impact_speed
        f1, f2 = 0.0, -force / m2
    k1, k2 = (stiffness / (turn * rate**2) for stiffness in (k1, second.stiffness))
    c1, c2 = c1 / rate, second.damping_coefficient / rate
    matrix = (
        (0.0, 0.0, turn, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, turn, 0.0, 0.0, 0.0),
        (-k1 / m1, k1 / m1, -c1 / m1, c1 / m1, f1, -f1, 0.0),
        (k1 / m2, -(k1 + k2) / m2, c1 / m2, -(c1 + c2) / m2, f2, -f2, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -turn),
        (0.0, 0.0, 0.0, 0.0, 0.0, turn, 0.0),
    )
    return np.array(matrix), np.array((0.0, 0.0, speed, 0.0, 1.0, 1.0, 0.0))


def _follow(
    model: ImpactModel, variant: ModelVariant, rate: float, begin: float, count: int
) -> tuple[FloatArray, list[float]]:
    """Return both accelerations at points from `begin` on, (2, count), and the state at the end.

    By doubling, since e^(2 A t) = (e^(A t))^2.
    """
    matrix, state = _describe(model, rate, variant)
    end = model.contact_time * rate
    last = max(min(int(end - begin), count - 1), 0)
    jump, step, rest = _exponentiate(matrix, [begin, 1.0, end - begin - last])
    path = np.empty((max(count, 1), state.size))
    path[0] = jump @ state
    done, power = 1, step.T
    while done < count:
        more = min(done, count - done)
        np.matmul(path[:more], power, out=path[done : done + more])
        done += more
        power = power @ power
    return (rate * matrix[2:4]) @ path[:count].T, (rest @ path[last]).tolist()


ORDER = 16
"""Order of the exponential's series [-]: the first term left out, 1 / 17!, is below 3e-15."""


def _exponentiate(matrix: FloatArray, times: Sequence[float]) -> FloatArray:
    """Return e^(A t) at each time, shape (times, d, d)."""
    size = len(matrix)
    norm = float(np.abs(matrix).sum(axis=0).max() * max(times))
    squarings = max(math.frexp(norm)[1], 0)
    powers = np.empty((ORDER, size, size))
    powers[0] = matrix
    for done in (1, 2, 4, 8):
        np.matmul(powers[:done], powers[done - 1], out=powers[done : 2 * done])
    terms = (0.5**squarings * np.array(times)[:, np.newaxis]) / np.arange(1.0, ORDER + 1)
    series = np.multiply.accumulate(terms, axis=1)
    result: FloatArray = (series @ powers.reshape(ORDER, -1)).reshape(-1, size, size)
    identity = np.eye(size)
    # e^A - 1 is squared, which keeps the digits of small matrices beside large ones.
    for _ in range(squarings):
        result = result @ (result + 2.0 * identity)
    return result + identity


NEARLY_CRITICAL = 1e-5
"""Distance of both decay rates from their mean, over it, at least [-]: nearer ones count as so far
apart, which changes a trace by 1e-10, and keeps the digits of their difference."""


Decay = tuple[complex, complex, complex, complex]
"""Of two terms whose sum is the acceleration of a body left alone: first values, then factors from
point to point."""


def _find_decays(body: Body, position: float, speed: float, late: float, rate: float) -> Decay:
    """Return the decay of a body from a time `late` after its state on."""
    stiffness = body.stiffness / body.mass
    half = body.damping_coefficient / body.mass / 2.0
    root = cmath.sqrt(half * half - stiffness)
    if abs(root) < NEARLY_CRITICAL * half:
        root = complex(NEARLY_CRITICAL * half)
    fast = -half - root
    # Their product is k / m: -c / 2m + root would lose its digits to a large c.
    slow = stiffness / fast
    return (
        slow**2 * (speed - fast * position) / (slow - fast) * cmath.exp(slow * late),
        fast**2 * (slow * position - speed) / (slow - fast) * cmath.exp(fast * late),
        slow / rate,
        fast / rate,
    )


def _let_decay(decays: Sequence[Decay], count: int) -> FloatArray:
    """Return the accelerations of bodies left alone, shape (bodies, count).

    All points are products of two powers, of twice the root of their number.
    """
    block = math.isqrt(max(count - 1, 0)) + 1
    powers = np.empty((len(decays), block, 4), dtype=np.complex128)
    powers[:, 0] = [(*values, 1.0, 1.0) for *values, _, _ in decays]
    powers[:, 1:] = [
        [[cmath.exp(part * each) for part in (block, 1.0) for each in rates]]
        for _, _, *rates in decays
    ]
    np.multiply.accumulate(powers, axis=1, out=powers)
    far, near = np.conj(powers[..., :2]), powers[..., 2:].copy()
    # The real parts of all products.
    sums: FloatArray = far.view(np.float64) @ near.view(np.float64).swapaxes(1, 2)
    return sums.reshape(len(sums), -1)[:, :count]


@dataclass(frozen=True)
class TraceComparison:
    """One body's model trace laid onto its measured one."""

    measured: FloatArray  # normalised to their own peaks [-], the model shifted; read-only
    model: FloatArray
    peak: float  # by which the measured trace was divided, sign included [m/s^2]
    shift: float  # applied to the model, later is positive [s]
    # Mean square error over the record [%], as in Fig. 6. Forgiving: most of the record is quiet.
    mse_percent: float
    contact_error_percent: float  # RMS error over the contact alone [%]


@dataclass(frozen=True)
class ModelComparison:
    """Both bodies of one sample's mean hit against the model."""

    variant: ModelVariant  # which model
    sampling_rate: float  # [Hz]
    start_time: float  # time of the first point from the start of the contact [s]
    contact_time: float  # tau_p of the model [s]
    hammer: TraceComparison  # of the hammer
    specimen: TraceComparison  # of the sample


def find_extreme(trace: FloatArray) -> float:
    """Return the value of largest magnitude of a trace, shape (n,), sign included.

    Traces are divided by it, so that the comparison is blind to polarity, as it must be for
    equation (1), whose force on body 2 is printed with a minus.

    Raises
    ------
    SignalError
        If the trace is flat or not finite.
    """
    peak = float(trace[np.argmax(np.abs(trace))])
    if not np.isfinite(peak) or peak == 0.0:
        raise SignalError("a flat trace cannot be normalised: it has no peak")
    return peak


def find_best_shift(measured: FloatArray, model: FloatArray, largest: int) -> float:
    """Find the shift of `model` that makes the mean square error least.

    Parameters
    ----------
    measured, model : ndarray, shape (n,)
        Normalised; the model counts as zero beyond its ends.
    largest : int
        Largest shift either way [points].

    Returns
    -------
    float
        In points, later is positive, refined below one point by a parabola.
    """
    count = measured.size
    largest = min(largest, count - 1)
    lags = np.arange(-largest, largest + 1)
    size = scipy.fft.next_fast_len(2 * count - 1, real=True)
    spectra = scipy.fft.rfft(measured, size), scipy.fft.rfft(model, size)
    correlation = scipy.fft.irfft(spectra[0] * spectra[1].conj(), size)[lags]
    energy = np.concatenate(([0.0], np.cumsum(model**2)))
    inside = energy[np.minimum(count, count - lags)] - energy[np.maximum(0, -lags)]
    error = inside - 2.0 * correlation
    best = int(np.argmin(error))
    if 0 < best < error.size - 1:
        left, middle, right = error[best - 1 : best + 2]
        bend = left - 2.0 * middle + right
        if bend > 0.0:
            return float(lags[best] + (left - right) / (2.0 * bend))
    return float(lags[best])


def compare_trace(
    measured: FloatArray, model: FloatArray, sampling_rate: float, contact: slice, largest: int
) -> TraceComparison:
    """Normalise both traces, shift the model onto the measurement and measure what is left.

    Parameters
    ----------
    measured, model : ndarray, shape (n,)
        Filtered alike.
    sampling_rate : float
        [Hz]
    contact : slice
        The points of the contact.
    largest : int
        Largest shift either way [points].
    """
    peak = find_extreme(measured)
    reference, candidate = measured / peak, model / find_extreme(model)
    shift = find_best_shift(reference, candidate, largest)
    # Zeros come in from beyond the ends.
    shifted = scipy.ndimage.shift(candidate, shift, order=3)
    error = shifted - reference
    inside = error[contact]
    return TraceComparison(
        measured=make_read_only(reference),
        model=make_read_only(shifted),
        peak=peak,
        shift=shift / sampling_rate,
        mse_percent=100.0 * float(error @ error) / error.size,
        contact_error_percent=100.0 * math.sqrt(float(inside @ inside) / inside.size),
    )


def compare_with_model(
    mean: MeanHit,
    model: ImpactModel,
    variant: ModelVariant,
    chains: Sequence[Chain],
) -> ModelComparison:
    """Simulate the model on the mean hit's time grid, filter it alike and compare.

    Parameters
    ----------
    mean : MeanHit
        Both channels.
    chains : sequence of Chain
        What both channels went through.

    Raises
    ------
    SignalError
        If a trace is flat.
    """
    rate = mean.sampling_rate
    count = mean.traces.shape[1]
    start_time = model.contact_time / 2.0 - mean.origin / rate
    bodies = simulate_impact(model, rate, count, start=start_time, variant=variant)
    filtered = [chain.show(body) for body, chain in zip(bodies, chains, strict=True)]
    first = max(0, int(np.ceil(-start_time * rate)))
    last = min(count, int(np.floor((model.contact_time - start_time) * rate)) + 1)
    contact = slice(first, last)
    # Beyond one contact time another oscillation would be laid onto the measured one.
    largest = round(model.contact_time * rate)
    hammer, specimen = (
        compare_trace(mean.traces[i], filtered[i], rate, contact, largest) for i in (0, 1)
    )
    return ModelComparison(
        variant=variant,
        sampling_rate=rate,
        start_time=start_time,
        contact_time=model.contact_time,
        hammer=hammer,
        specimen=specimen,
    )
