"""Campaigns on contacts of mixed losses, through sensors that are not stated, apart from the core.

Two free bodies, F = k δⁿ + c1 δᵖ δ' + c2 δᵠ δ', integrated by `core.contacts`; resonance, corners,
hum, noise and converter are added at many times the sampling rate.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from core.contacts import FloatArray, Motion, integrate
from core.struck import resonate

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.session import Session

HITS = 10
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


def collide(losses: Losses, scale: float, speed: float = 1.0) -> Motion:
    """Return the contact at `speed` over that at which the shares are `scale` times as large."""
    n = losses.exponent
    # T goes with v^-(n-1)/(n+1), and with it the losses.
    parts = [
        (power, scale * share * speed ** ((2.0 * power - n + 1.0) / (n + 1.0)))
        for power, share in zip(losses.powers, losses.shares, strict=True)
    ]

    def press(x: float, v: float) -> float:
        x = max(x, 0.0)
        return float(x**n + sum(factor * x**power for power, factor in parts) * v)

    return integrate(press)


def find_scale(losses: Losses, restitution: float) -> float:
    """Return by how much the shares are to be multiplied for a restitution."""
    found: float = scipy.optimize.brentq(
        lambda scale: collide(losses, scale).restitution - restitution, 1e-4, 8.0, xtol=1e-6
    )
    return found


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
    pulses = [collide(lab.losses, scale, speed) for speed in speeds.tolist()]
    power = -(lab.losses.exponent - 1.0) / (lab.losses.exponent + 1.0)
    # The middle one of all hits is at the mean speed.
    unit = lab.duration / pulses[HITS + weights.size // 2].time[-1]
    units = unit * speeds**power
    units[:HITS] *= np.exp(lab.repeat * random.standard_normal(HITS))
    both = lab.masses[0] * lab.masses[1] / sum(lab.masses)
    heights = both * lab.speed * speeds / units
    forces = heights[:, np.newaxis] * [pulse.force for pulse in pulses]
    highest = forces[:HITS].max()
    scales = [lab_peak / lab.level for lab_peak in highest / np.array(lab.masses)]
    gains = 1.0 + GAIN * random.standard_normal(2)
    blocks = [
        _measure(lab, units[hit] * pulses[hit].time, forces[hit], scales, gains, hit + 1, random)
        for hit in range(HITS)
    ]
    each = {
        "duration": units * [pulse.time[-1] for pulse in pulses],
        "restitution": np.array([pulse.restitution for pulse in pulses]),
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
    sensors = tuple(Sensor(channel, sensitivity_uncertainty=GAIN) for channel in CHANNELS)
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
        trace = resonate(trace, lab.resonances[channel], lab.damping, 1.0 / step)
        trace = scipy.signal.lfilter(
            *scipy.signal.butter(1, lab.corner, "high", fs=1.0 / step), trace
        )
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
    errors: dict[str, float]  # relative, signed
    ratios: dict[str, float]  # |error| over U


def run(lab: Laboratory, random: np.random.Generator) -> Outcome:
    """Strike, and compare with the truth."""
    struck = strike(lab, random)
    session = Session(struck.setup)
    for block in struck.blocks:
        session.feed(block)
    law = session.estimate_sample("struck").contact_law
    errors, ratios = {}, {}
    for name in ASKED:
        found, true = getattr(law, name), struck.truth[name]
        if found.is_known:
            errors[name] = found.value / true - 1.0
            ratios[name] = abs(found.value - true) / found.expanded
    return Outcome(lab, law, errors, ratios)


def run_many(count: int, seed: int = 1) -> Iterator[Outcome]:
    """Run campaigns of laboratories that are drawn."""
    for number in range(count):
        random = np.random.default_rng((seed, number))
        yield run(draw_laboratory(random), random)
