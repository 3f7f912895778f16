"""Campaigns on contacts of mixed losses, through sensors that are not stated, apart from the core.

Two free bodies, F = k δⁿ + c1 δᵖ δ' + c2 δᵠ δ', integrated by Runge and Kutta's method; resonance,
corners, hum, noise and converter are added at many times the sampling rate.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.session import Session

FloatArray = NDArray[np.float64]
HITS = 10
STEPS = 3000
"""Of the integration: the force is good to 1e-6 of its peak."""
RATES = (51.2e3, 102.4e3, 250e3, 500e3, 1e6, 2.5e6)
GAIN, MASS = 2e-3, 1e-3
"""Relative standard uncertainties that are stated and drawn [-]."""
ASKED = ("duration", "restitution", "impact_speed", "exponent", "peak_force")


@dataclass(frozen=True)
class Losses:
    """The law of one contact: n, and powers and coefficients of its losses in scaled units."""

    exponent: float
    powers: tuple[float, float]
    shares: tuple[float, float]


@dataclass(frozen=True)
class Pulses:
    """Contacts in scaled units, each from touch to where the force comes back to zero."""

    time: FloatArray  # (k, n) [T]
    force: FloatArray  # (k, n)
    restitution: FloatArray  # (k,)


def collide(losses: Losses, scale: FloatArray, speed: FloatArray) -> Pulses:
    """Integrate x'' = -xⁿ - Σ b xᵐ x', b going with `speed` over that at which they are b."""
    n, powers = losses.exponent, np.array(losses.powers)[:, np.newaxis]
    # T goes with v^-(n-1)/(n+1), and with it b.
    growth = speed ** ((2.0 * powers - n + 1.0) / (n + 1.0))
    factors = scale * np.array(losses.shares)[:, np.newaxis] * growth

    def press(x: FloatArray, v: FloatArray) -> FloatArray:
        x = np.maximum(x, 0.0)
        return np.asarray(x**n + (factors * x**powers).sum(axis=0) * v)

    # The first steps are short: a dashpot's force jumps at touch, a root's rises steeply.
    grid = 9.0 * np.linspace(0.0, 1.0, STEPS) ** 1.5
    x, v = np.zeros(scale.size), np.ones(scale.size)
    states = [(x, v, press(x, v))]
    for h in np.diff(grid).tolist():
        a1 = -press(x, v)
        v2 = v + h / 2 * a1
        a2 = -press(x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = -press(x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = -press(x + h * v3, v4)
        x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        states.append((x, v, press(x, v)))
        if np.all((v < 0.0) & ((x <= 0.0) | (states[-1][2] < 0.0))):
            break
    place, rate, force = (np.array(column).T for column in zip(*states, strict=True))
    time = np.broadcast_to(grid[: place.shape[1]], place.shape)
    # Over what the force is compared with near its end, which is straight there.
    pull = np.where(place > 0.0, force / np.maximum(place, 1e-12) ** min(n, *losses.powers), -1.0)
    out = (rate < 0.0) & ((place <= 0.0) | (force < 0.0))
    last = np.argmax(out, axis=1)
    rows = np.arange(scale.size)
    before, after = pull[rows, last - 1], pull[rows, last]
    left, right = place[rows, last - 1], place[rows, last]
    part = np.where(right > 0.0, before / (before - after), left / (left - np.minimum(right, 0.0)))
    end = time[rows, last - 1] + part * (time[rows, last] - time[rows, last - 1])
    e = -(rate[rows, last - 1] + part * (rate[rows, last] - rate[rows, last - 1]))
    time = np.minimum(time, end[:, np.newaxis])
    force = np.where(time < end[:, np.newaxis], np.maximum(force, 0.0), 0.0)
    return Pulses(time, force, e)


def find_scale(losses: Losses, restitution: float) -> float:
    """Return by how much the shares are to be multiplied for a restitution."""
    low, high = 0.0, 8.0
    for _ in range(4):
        tried = np.linspace(low, high, 24)
        found = collide(losses, tried, np.ones(tried.size)).restitution
        above = int(np.count_nonzero(found > restitution)) - 1
        low, high = tried[max(above, 0)], tried[min(above + 1, tried.size - 1)]
    return float((low + high) / 2.0)


@dataclass(frozen=True)
class Laboratory:
    """What strikes and what measures, and how well it is known."""

    losses: Losses
    restitution: float
    masses: tuple[float, float]  # [kg]
    speed: float  # [m/s]
    spread: float  # of the hits' speeds [-]
    repeat: float  # of their stiffness, as that of the duration [-]
    duration: float  # [s]
    rate: float  # [Hz]
    bits: int
    level: float  # peak over full scale [-]
    noise: float  # over full scale [-]
    hum: float  # the same
    resonances: tuple[float, float]  # [Hz]
    damping: float
    corner: float  # lower, of the sensors [Hz]
    upper: float = 0.0  # of a coupler, one pole [Hz]; 0: none
    states_sensors: bool = False


def draw_laboratory(random: np.random.Generator) -> Laboratory:
    """Draw a laboratory as there are many: 51 kS/s to 2.5 MS/s, 12 to 24 bits."""
    n = random.uniform(1.2, 2.2)
    # Most of a loss does not jump at touch.
    first = float(random.choice([n, 0.5]))
    second = float(random.choice([power for power in (n, 0.5, 0.25, 0.0, 1.0) if power != first]))
    part = random.uniform(0.5, 1.0)
    rate = float(random.choice(RATES))
    bits = int(random.choice([12, 14, 16, 24]))
    # A dozen points and more in the width; steel on steel, or wood.
    shortest = max(150e-6, 24.0 / rate)
    return Laboratory(
        losses=Losses(n, (first, second), (part, 1.0 - part)),
        restitution=random.uniform(0.4, 0.99),
        masses=(random.uniform(0.03, 0.5), random.uniform(0.03, 0.5)),
        speed=10.0 ** random.uniform(-1.5, 0.0),
        spread=10.0 ** random.uniform(-2.3, -1.0),
        repeat=10.0 ** random.uniform(-3.0, -2.3),
        duration=shortest * 10.0 ** random.uniform(0.0, 1.0),
        rate=rate,
        bits=bits,
        level=random.uniform(0.3, 0.8),
        noise=10.0 ** random.uniform(-4.0, -2.8) if bits < 24 else 10.0 ** random.uniform(-5, -4),
        hum=10.0 ** random.uniform(-4.5, -3.0),
        resonances=(10.0 ** random.uniform(4.7, 5.2), 10.0 ** random.uniform(4.7, 5.2)),
        damping=random.uniform(0.01, 0.05),
        corner=10.0 ** random.uniform(-1.0, 0.5),
    )


@dataclass(frozen=True)
class Struck:
    """Ten hits as a session takes them, the set-up that is stated, and the truth."""

    setup: RigSetup
    blocks: list[Block]
    truth: dict[str, float]


def strike(lab: Laboratory, random: np.random.Generator) -> Struck:
    """Strike ten times.

    What is true is the mean of as many hits as one likes: the scatter of ten is in the interval.
    """
    scale = find_scale(lab.losses, lab.restitution)
    draws, weights = np.polynomial.hermite_e.hermegauss(9)
    draws = np.append(random.standard_normal(HITS), draws)
    speeds = np.exp(lab.spread * draws)
    pulses = collide(lab.losses, np.full(draws.size, scale), speeds)
    power = -(lab.losses.exponent - 1.0) / (lab.losses.exponent + 1.0)
    # The middle one of all hits is at the mean speed.
    unit = lab.duration / pulses.time[HITS + weights.size // 2, -1]
    units = unit * speeds**power
    units[:HITS] *= np.exp(lab.repeat * random.standard_normal(HITS))
    both = lab.masses[0] * lab.masses[1] / sum(lab.masses)
    heights = both * lab.speed * speeds / units
    forces = heights[:, np.newaxis] * pulses.force
    durations = units * pulses.time[:, -1]
    highest = forces[:HITS].max()
    scales = [lab_peak / lab.level for lab_peak in highest / np.array(lab.masses)]
    gains = 1.0 + GAIN * random.standard_normal(2)
    blocks = [
        _measure(lab, units[hit] * pulses.time[hit], forces[hit], scales, gains, hit + 1, random)
        for hit in range(HITS)
    ]
    each = {
        "duration": durations,
        "restitution": pulses.restitution,
        "impact_speed": lab.speed * speeds,
        "exponent": np.full(draws.size, lab.losses.exponent),
        "peak_force": forces.max(axis=1),
    }
    truth = {name: float(values[HITS:] @ weights / weights.sum()) for name, values in each.items()}
    return Struck(_state(lab, random), blocks, truth)


def _state(lab: Laboratory, random: np.random.Generator) -> RigSetup:
    """Return what the laboratory knows."""
    hammer, sample = (mass * (1.0 + MASS * random.standard_normal()) for mass in lab.masses)
    window = max(2e-3, 6.0 * lab.duration)
    sensors = tuple(
        Sensor(
            channel,
            sensitivity_uncertainty=GAIN,
            resonance=resonance * lab.states_sensors,
            resonance_damping=lab.damping,
            low_corner=lab.corner * lab.states_sensors,
            upper_corner=lab.upper * lab.states_sensors,
        )
        for channel, resonance in zip(CHANNELS, lab.resonances, strict=True)
    )
    return RigSetup(
        SampleSet((Sample("struck", sample, mass_uncertainty=MASS * sample),), ""),
        hammer_mass=hammer,
        impact_speed=math.nan,
        hammer_mass_uncertainty=MASS * hammer,
        sensors=sensors,
        analysis=AnalysisSettings(
            cutoff_frequency=min(50e3, 0.4 * lab.rate),
            pre_trigger=window / 4.0,
            record_duration=window,
        ),
    )


def _measure(
    lab: Laboratory,
    time: FloatArray,
    force: FloatArray,
    scales: Sequence[float],
    gains: FloatArray,
    number: int,
    random: np.random.Generator,
) -> Block:
    window = max(2e-3, 6.0 * lab.duration)
    count = round(window * lab.rate)
    fine = max(1, math.ceil(5e6 / lab.rate))
    step = 1.0 / (lab.rate * fine)
    start = window / 4.0 + random.uniform() / lab.rate
    grid = np.arange(count * fine) * step
    # What a point of the fine grid is moved by is the impulse around it.
    impulse = scipy.integrate.cumulative_trapezoid(force, time, initial=0.0)
    edges = np.interp(np.append(grid, grid[-1] + step) - step / 2.0 - start, time, impulse)
    pressed = np.diff(edges) / step
    channels = []
    for channel, (mass, sign) in enumerate(zip(lab.masses, (1.0, -1.0), strict=True)):
        trace = sign * gains[channel] * pressed / mass
        natural = 2.0 * math.pi * lab.resonances[channel]
        system = [natural**2], [1.0, 2.0 * lab.damping * natural, natural**2]
        top, bottom, _ = scipy.signal.cont2discrete(system, step, "foh")
        trace = scipy.signal.lfilter(top.ravel(), bottom, trace)
        trace = scipy.signal.lfilter(
            *scipy.signal.butter(1, lab.corner, "high", fs=1.0 / step), trace
        )
        if lab.upper:
            trace = scipy.signal.lfilter(*scipy.signal.butter(1, lab.upper, fs=1.0 / step), trace)
        if lab.bits == 24 and fine > 1:
            # Sigma-delta converters end in a long filter.
            kernel = scipy.signal.firwin(32 * fine + 1, 0.9 / fine, window=("kaiser", 8.0))
            trace = scipy.signal.fftconvolve(trace, kernel, mode="same")
        trace = trace[::fine]
        scale = scales[channel]
        phase = random.uniform(0.0, 2.0 * math.pi)
        trace = trace + scale * lab.hum * np.sin(2.0 * math.pi * 50.0 * grid[::fine] + phase)
        trace += scale * lab.noise * random.standard_normal(count)
        code = scale / 2 ** (lab.bits - 1)
        counts = np.clip(np.rint(trace / code), -(2 ** (lab.bits - 1)), 2 ** (lab.bits - 1) - 1)
        channels.append(ChannelBlock(counts.astype(np.int32), code, 0.0, scale))
    label = HitLabel("struck", number, number)
    return Block(0, lab.rate, channels[0], channels[1], label, last=True)


@dataclass(frozen=True)
class Outcome:
    """What is found of one campaign: the law, and each number's error over its half-width."""

    lab: Laboratory
    law: ContactLaw
    accepted: int
    errors: dict[str, float]  # relative, signed
    ratios: dict[str, float]  # |error| over U


def run(lab: Laboratory, random: np.random.Generator) -> Outcome:
    """Strike, and compare with the truth."""
    struck = strike(lab, random)
    session = Session(struck.setup)
    accepted = sum(hit.accepted for block in struck.blocks for hit in session.feed(block))
    return compare(lab, struck, session, accepted)


def compare(lab: Laboratory, struck: Struck, session: Session, accepted: int) -> Outcome:
    """Hold what a session found against the truth."""
    law = session.estimate_sample("struck").contact_law
    errors, ratios = {}, {}
    for name in ASKED:
        found, true = getattr(law, name), struck.truth[name]
        if found.is_known:
            errors[name] = found.value / true - 1.0
            ratios[name] = abs(found.value - true) / found.expanded
    return Outcome(lab, law, accepted, errors, ratios)


def run_many(count: int, seed: int = 1) -> Iterator[Outcome]:
    """Run campaigns of laboratories that are drawn."""
    for number in range(count):
        random = np.random.default_rng((seed, number))
        yield run(draw_laboratory(random), random)
