"""Series of other laboratories, simulated apart from the package: what is said of them, and how.

Two bodies meet by a law with two losses at once; the sample is free, on a spring to the ground
with viscous, dry or quadratic damping, or its sensor stands on a mount that rings. Motion is
integrated by DOP853 from first touch to the record's end; sensors, couplers, converters and what a
laboratory states wrongly come after. Each series has one of eight causes of error.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from core.contacts import FloatArray
from core.struck import resonate
from scipy.integrate import solve_ivp
from scipy.signal import butter, lfilter

from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.session import Session

COVERED = 1.5
"""Half widths of its 95 % interval within which a figure is right [-]: 99.7 % of honest ones."""
NAME = "struck"


class Cause(Enum):
    """What is wrong, or unusual, in a series."""

    LAW = "laws, speeds and sensors of all kinds"
    GAIN = "a gain, a speed or a sample that is not the stated one"
    RINGING = "a mount or an inner mode that rings"
    FRICTION = "damping that depends on the amplitude"
    UNSTATED = "two gains that are not stated"
    SERIES = "a gain that drifts, or two groups of strength"
    CORNER = "a coupler's upper corner that is not stated"
    CRUSHED = "a contact of no law"
    MEMORY = "a part of the stiffness relaxes, tan delta 0.05 to 0.3"
    MODES = "a structure of many modes"
    SPEED = "a mass 5 %, v1 4 %, the axis 20 degrees or 5 mm off, where gains and v1 are stated"
    SENSORS = "two sensors of 45 to 90 kHz that are not stated"


NAMED: dict[Cause, set[Subject | Reason]] = {
    Cause.LAW: {Subject.SENSOR, Subject.PULSE_SHAPE, Subject.CONVERTER, Subject.SCATTER},
    Cause.GAIN: {Subject.MOMENTA, Subject.IMPACT_SPEED, Subject.MASS},
    Cause.RINGING: {Subject.FREE_DECAY, Subject.MOMENTA},
    Cause.FRICTION: {Subject.FREE_DECAY},
    Cause.UNSTATED: {Subject.MOMENTA, Subject.IMPACT_SPEED},
    Cause.SERIES: {
        Subject.TREND,
        Subject.GROUPS,
        Subject.HITS,
        Subject.IMPACT_SPEED,
        Subject.MOMENTA,
        Reason.INCONSISTENT,
    },
    Cause.CORNER: {Subject.CONTACT_LAW},
    Cause.CRUSHED: {Subject.CONTACT_LAW, Subject.PULSE_SHAPE, Subject.IMPACT_SPEED},
    Cause.MEMORY: {Subject.CONTACT_LAW, Subject.PULSE_SHAPE, Subject.IMPACT_SPEED},
    Cause.MODES: {Subject.FREE_DECAY, Subject.MOMENTA},
    Cause.SPEED: {Subject.MOMENTA, Subject.IMPACT_SPEED, Subject.MASS},
    Cause.SENSORS: {Subject.CONTACT_LAW},
}
"""What a warning, a note or a rejection is about that names a cause."""
OF_GAINS = {Subject.MOMENTA, Subject.MASS}
"""What tells of gains: it names nothing that goes by the pulse's shape alone."""
SHAPED = {"duration", "restitution", "exponent", "equivalent_stiffness"}
"""Figures of the law that go by the pulse's shape alone."""


@dataclass(frozen=True)
class Laboratory:
    """How one laboratory strikes and measures; stated values are what it tells the package."""

    hammer: float = 0.1  # masses [kg]
    sample: float = 0.105
    speed: float = 0.08  # [m/s], in the mean
    speeds: tuple[float, ...] = (1.0,)  # of hits in turn, over the mean
    scatter: float = 0.02  # of the speed [-]
    exponent: float = 1.5  # n
    losses: tuple[tuple[float, float], ...] = ()  # power m and size of each, scaled
    crush: float = 1.0  # stiffness on the way out over that on the way in
    relaxing: tuple[float, float] = (0.0, 1.0)  # share of k, and its time [durations]
    duration: float = 212e-6  # about, by Hertz
    spring: tuple[float, float] = (0.0, 0.0)  # frequency [Hz] and zeta of a held sample
    friction: float = 0.0  # dry, over m2 g-like: acceleration [m/s^2]
    air: float = 0.0  # quadratic damping [1/m]
    mount: tuple[float, float] = (0.0, 0.0)  # frequency [Hz] and zeta of a sensor's mount
    modes: tuple[tuple[float, float, float], ...] = ()  # frequency, zeta, part of J / m2
    rate: float = 2.5e6
    record: float = 2e-3
    before: float = 2.5e-4  # of the record, before the impact [s]
    bits: int = 14
    noise: float = 5e-4  # of full scale
    hum: float = 0.0
    resonances: tuple[float, float] = (0.0, 0.0)  # of the sensors, not stated [Hz]
    ringing: float = 0.02  # their zeta
    corner: float = 0.0  # upper, of couplers, not stated [Hz]
    window: float = 0.0  # exponential, of an analyser [1/s]
    gains: tuple[float, float] = (1.0, 1.0)  # true over stated
    warming: float = 0.0  # of both gains, over the series [-]
    slowing: float = 0.0  # of the converters' clock, over the series [-]
    clock: float = 0.0  # by how much it runs fast all the time [-]
    stated_speed: float = 1.0  # over the true one; NaN: none is stated
    stated_sample: float = 1.0
    speed_uncertainty: float = 0.0  # that is stated, over it; 0: none
    gain_uncertainty: float = 0.0  # that is stated; 0: none
    mass_uncertainty: float = 1e-4  # that is stated, over the masses; 0: none
    clock_uncertainty: float = 1e-4  # that is stated [-]
    hits: int = 10
    seed: int = 0


@dataclass(frozen=True)
class Motion:
    """One hit as it was."""

    time: FloatArray  # from first touch [s]
    accelerations: FloatArray  # of hammer and sample's sensor, (2, n) [m/s^2]
    duration: float  # [s]
    restitution: float
    force: float  # largest [N]
    impulse: float  # [N s]


def strike(lab: Laboratory, speed: float) -> Motion:
    """Integrate one hit: from touch until the bodies part, then the sample alone."""
    both = 1.0 / (1.0 / lab.hammer + 1.0 / lab.sample)
    # A Hertz contact without loss lasts 3.218 T at the mean speed.
    unit = lab.duration / 3.218
    stiffness = both / (unit ** (lab.exponent + 1.0) * lab.speed ** (lab.exponent - 1.0))
    length = lab.speed * unit
    angular, ratio = 2.0 * math.pi * lab.spring[0], lab.spring[1]

    def press(depth: float, rate: float) -> float:
        x = max(depth, 0.0)
        force = stiffness * x**lab.exponent
        if rate < 0.0 and lab.crush != 1.0:
            force *= max(1.0 - (1.0 - (x / deepest[0]) ** 1.0) * (1.0 - 1.0 / lab.crush), 0.0)
        for power, size in lab.losses:
            scaled = size * (x / length) ** power * rate / lab.speed
            force += stiffness * length**lab.exponent * scaled
        return force

    share, relaxation = lab.relaxing[0], lab.relaxing[1] * lab.duration

    def hold(state: FloatArray) -> float:
        """Return the support's acceleration of the sample."""
        path, velocity = state[1], state[3]
        held = -(angular**2) * path - 2.0 * ratio * angular * velocity
        held -= lab.friction * math.tanh(velocity / 1e-5) if lab.friction else 0.0
        return held - lab.air * velocity * abs(velocity)

    deepest = [1.0]

    def move(state: FloatArray, force: float) -> list[float]:
        behind = stiffness * max(state[0] - state[1], 0.0) ** lab.exponent - state[4]
        return [
            state[2],
            state[3],
            -force / lab.hammer,
            force / lab.sample + hold(state),
            behind / relaxation,
        ]

    def touch(_time: float, state: FloatArray) -> list[float]:
        depth, rate = state[0] - state[1], state[2] - state[3]
        deepest[0] = max(deepest[0], depth) if deepest[0] != 1.0 else max(depth, 1e-15)
        return move(state, max(press(depth, rate) - share * state[4], 0.0))

    def part(time: float, state: FloatArray) -> float:
        if time < unit:
            return 1.0
        return float(press(state[0] - state[1], state[2] - state[3]) - share * state[4])

    part.terminal, part.direction = True, -1  # type: ignore[attr-defined]
    options = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-15, "dense_output": True}
    found = solve_ivp(
        touch, (0.0, 20.0 * unit), (0.0, 0.0, speed, 0.0, 0.0), events=part, max_step=unit / 8.0,
        **options,
    )  # fmt: skip
    end = float(found.t[-1])
    fine = np.linspace(0.0, end, 2001)
    states = found.sol(fine)
    forces = lab.hammer * -np.gradient(states[2], fine)
    accelerations = [np.stack((-forces / lab.hammer, np.gradient(states[3], fine)))]
    times = [fine]
    rest = solve_ivp(
        lambda _time, state: move(state, 0.0), (end, lab.record), found.y[:, -1],
        max_step=2e-5, **options,
    )  # fmt: skip
    late = np.linspace(end, lab.record, 8001)[1:]
    after = rest.sol(late)
    tail = np.array([hold(state) for state in after.T])
    accelerations.append(np.stack((np.zeros(late.size), tail)))
    times.append(late)
    return Motion(
        np.concatenate(times),
        np.concatenate(accelerations, axis=1),
        end,
        float(states[3, -1] - states[2, -1]) / speed,
        float(forces.max()),
        lab.hammer * (speed - float(states[2, -1])),
    )


def measure(
    lab: Laboratory, motion: Motion, number: int, random: np.random.Generator
) -> FloatArray:
    """Return what the converters give of one hit, (2, n) [m/s^2]."""
    rate = lab.rate
    time = np.arange(int(lab.record * rate)) / rate - lab.before - random.uniform() / rate
    time = time / (1.0 + lab.clock + lab.slowing * number / (lab.hits - 1.0))
    traces = np.stack([np.interp(time, motion.time, a, 0.0) for a in motion.accelerations])
    traces[:, time < 0.0] = 0.0
    # A mode swings about the rigid body, and takes no momentum.
    rigid = traces[1]
    modes = [part * (rigid - resonate(rigid, f, ratio, rate)) for f, ratio, part in lab.modes]
    traces[1] = resonate(traces[1], *lab.mount, rate) + np.sum(modes, axis=0)
    traces = np.stack(
        [resonate(*pair, lab.ringing, rate) for pair in zip(traces, lab.resonances, strict=True)]
    )
    if lab.corner:
        traces = lfilter(*butter(1, lab.corner, fs=rate), traces)
    drift = 1.0 - lab.warming * (1.0 - number / (lab.hits - 1.0))
    traces *= drift * np.array(lab.gains)[:, np.newaxis]
    scales = 1.4 * np.array([[900.0], [900.0]]) * (lab.speed / 0.08) * (212e-6 / lab.duration)
    scales[1] *= lab.hammer / lab.sample * 1.5
    hum = lab.hum * np.sin(2.0 * math.pi * (50.0 * time + random.uniform()))
    traces += scales * (hum + lab.noise * random.standard_normal(traces.shape))
    step = scales / 2 ** (lab.bits - 1)
    traces = np.rint(traces / step) * step
    return np.asarray(traces * np.exp(-lab.window * np.maximum(time, 0.0)))


@dataclass(frozen=True)
class Truth:
    """What is true of a series, in the mean of its hits."""

    figures: dict[str, tuple[float, float]] = field(default_factory=dict)  # from, to
    absent: frozenset[str] = frozenset()  # what has no true value, and so may not be given


def run_series(lab: Laboratory) -> tuple[SampleEstimate, Truth, list[Note | Finding]]:
    """Strike a series; return what is estimated, what is true, and all that is said."""
    random = np.random.default_rng(lab.seed)
    stated = lab.sample * lab.stated_sample
    part, gain = lab.mass_uncertainty, lab.gain_uncertainty
    setup = RigSetup(
        SampleSet((Sample(NAME, stated, mass_uncertainty=part * stated),), NAME),
        lab.hammer,
        lab.speed * lab.stated_speed,
        AnalysisSettings(record_duration=lab.record, pre_trigger=0.8 * lab.before),
        impact_speed_uncertainty=lab.speed
        * lab.speed_uncertainty
        * np.nan_to_num(lab.stated_speed),
        hammer_mass_uncertainty=part * lab.hammer,
        clock_uncertainty=lab.clock_uncertainty,
        sensors=tuple(Sensor(name, sensitivity_uncertainty=gain) for name in CHANNELS),
    )
    session, motions, speeds = Session(setup), list[Motion](), list[float]()
    known: dict[float, Motion] = {}
    for number in range(lab.hits):
        speed = lab.speed * lab.speeds[number % len(lab.speeds)]
        speed *= 1.0 + lab.scatter * random.standard_normal()
        motion = known.setdefault(speed, strike(lab, speed))
        traces = measure(lab, motion, number, random)
        hammer, sample = (ChannelBlock(trace, 1.0, 0.0, 0.0) for trace in traces)
        label = HitLabel(NAME, number + 1, number + 1)
        hits = session.feed(Block(0, lab.rate, hammer, sample, label, last=True))
        if any(hit.accepted for hit in hits):
            motions.append(motion)
            speeds.append(speed)
    results = session.estimate_all()
    (estimate,) = results.samples
    said: list[Note | Finding] = [item for hit in results.rejected for item in hit.rejections]
    said += (*estimate.warnings, *estimate.notes, *estimate.contact_law.notes)
    return estimate, find_truth(lab, motions, speeds), said


def find_truth(lab: Laboratory, motions: Sequence[Motion], speeds: Sequence[float]) -> Truth:
    """Return the true figures of the accepted hits."""

    def mean(values: Sequence[float]) -> tuple[float, float]:
        return (float(np.mean(values)),) * 2 if len(values) else (math.nan,) * 2

    both = 1.0 / (1.0 / lab.hammer + 1.0 / lab.sample)
    durations = [motion.duration for motion in motions]
    figures = {
        "paper.contact_time": mean(durations),
        "contact_law.duration": mean(durations),
        "contact_law.restitution": mean([motion.restitution for motion in motions]),
        "contact_law.impact_speed": mean(speeds),
        "paper.peak_force": mean([motion.force for motion in motions]),
        "checks.impulse": mean([motion.impulse for motion in motions]),
        "checks.traced_mass": (lab.sample, lab.sample),
    }
    absent = set[str]()
    damping = (
        "free_decay.stiffness",
        "free_decay.damping_coefficient",
        "free_decay.damping_ratio",
    )
    if lab.spring[0]:
        angular = 2.0 * math.pi * lab.spring[0]
        figures[damping[0]] = (lab.sample * angular**2,) * 2
        low = high = lab.spring[1]
        if not lab.friction and not lab.air:
            figures[damping[2]] = (low, high)
            figures[damping[1]] = (2.0 * low * angular * lab.sample,) * 2
        elif motions:
            figures[damping[2]] = _find_damping_range(lab, motions[0])
        absent |= {"checks.momentum_ratio", "checks.stated_restitution"}
    else:
        absent |= set(damping[:2]) | {"paper.damping_coefficient", "paper.damping_ratio"}
        energies = [
            both * speed**2 / 2.0 * (1.0 - motion.restitution**2)
            for speed, motion in zip(speeds, motions, strict=True)
        ]
        figures |= {
            "contact_law.peak_force": figures["paper.peak_force"],
            "contact_law.impulse": figures["checks.impulse"],
            "contact_law.energy_loss": mean(energies),
            "contact_law.exponent": (lab.exponent, lab.exponent),
            "contact_law.equivalent_stiffness": mean(
                [both * (math.pi / d) ** 2 for d in durations]
            ),
            "checks.stated_restitution": mean([motion.restitution for motion in motions]),
            "checks.separation_restitution": mean([motion.restitution for motion in motions]),
            "checks.momentum_ratio": (1.0, 1.0),
        }
    return Truth(figures, frozenset(absent))


def _find_damping_range(lab: Laboratory, motion: Motion) -> tuple[float, float]:
    """Return zeta between the first and the last maxima of the tail, as they fall."""
    is_seen = (motion.time > motion.duration + 2e-5) & (motion.time < lab.record - lab.before)
    trace = motion.accelerations[1][is_seen]
    inner = np.abs(trace)
    peaks = np.flatnonzero((inner[1:-1] > inner[:-2]) & (inner[1:-1] >= inner[2:])) + 1
    heights = inner[peaks]
    heights = heights[heights > 0.1 * heights.max()]
    if heights.size < 3:
        return lab.spring[1], lab.spring[1]
    decrements = np.log(heights[:-1] / heights[1:]) / math.pi
    return float(decrements.min()), float(decrements.max())


@dataclass(frozen=True)
class Verdict:
    """What became of one series."""

    cause: Cause
    lab: Laboratory
    given: int  # figures with a number
    wrong: dict[str, float]  # figures outside, in half widths
    named: bool  # of each of them a warning or note names the cause
    has_law: bool

    @property
    def is_silent(self) -> bool:
        """Whether a figure is wrong, and nothing says so."""
        return bool(self.wrong) and not self.named

    @property
    def outcome(self) -> str:
        """All right, right without a law, a figure off with the cause named, or without."""
        if self.wrong:
            return "silent" if self.is_silent else "named"
        return "right" if self.has_law else "no law"


def judge(cause: Cause, lab: Laboratory) -> Verdict:
    """Hold every figure of a series against the truth."""
    estimate, truth, said = run_series(lab)
    wrong: dict[str, float] = {}
    given = 0
    for name, (low, high) in truth.figures.items():
        found = read(estimate, name)
        # One accepted hit has no scatter, and claims no interval.
        if not (found.is_known and math.isfinite(low) and math.isfinite(found.expanded)):
            continue
        given += 1
        away = max(abs(found.value - low), abs(found.value - high))
        wide = found.expanded or 1e-12 * abs(found.value)
        if away > COVERED * wide:
            wrong[name] = away / wide
    for name in truth.absent:
        if read(estimate, name).is_known:
            wrong[name] = math.inf
    codes = {item.reason if isinstance(item, Finding) else item.about for item in said}
    named = all(find_names(cause, name) & codes for name in wrong)
    return Verdict(cause, lab, given, wrong, named, estimate.contact_law.is_known)


def find_names(cause: Cause, name: str) -> set[Subject | Reason]:
    """Return what names a wrong figure."""
    part, _, attribute = name.partition(".")
    if part != "contact_law":
        return NAMED[cause]
    names = NAMED[cause] | {Subject.CONTACT_LAW}
    return names - OF_GAINS if attribute in SHAPED else names


def read(estimate: SampleEstimate, name: str) -> Quantity:
    """Return a figure by the names of its part and its field."""
    part, _, attribute = name.partition(".")
    found: Quantity = getattr(getattr(estimate, part), attribute)
    return found


def draw_laboratory(cause: Cause, random: np.random.Generator) -> Laboratory:
    """Draw a laboratory of one cause."""
    powers = random.choice([0.0, 0.25, 0.5, 1.0, 1.5], 2, replace=False)
    strength = random.uniform(0.02, 0.35)
    share = random.uniform()
    lab = Laboratory(
        hammer=random.uniform(0.05, 0.3),
        sample=random.uniform(0.05, 0.5),
        speed=random.uniform(0.05, 0.5),
        exponent=random.uniform(1.3, 1.7),
        losses=((float(powers[0]), strength * share), (float(powers[1]), strength * (1 - share))),
        duration=random.uniform(120e-6, 400e-6),
        bits=int(random.choice([12, 14, 16, 24])),
        noise=random.uniform(2e-4, 1e-3),
        record=3e-3,
        seed=int(random.integers(2**31)),
    )
    return _VARY[cause](lab, random)


def _vary_law(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    return replace(
        lab,
        exponent=random.uniform(1.2, 2.2),
        resonances=2 * (random.choice([0.0, random.uniform(50e3, 100e3)]),),
        hum=random.uniform(0.0, 3e-4),
        scatter=random.choice([0.02, 0.2]),
        speeds=(1.0,) if random.uniform() < 0.7 else (0.6, 1.0, 1.6),
        rate=float(random.choice([500e3, 1e6, 2.5e6])),
    )


def _vary_gain(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    sign = random.choice([-1.0, 1.0])
    kind = int(random.integers(4))
    off = 1.0 + sign * random.uniform(0.04, 0.1)
    crush = 1.0 if random.uniform() < 0.5 else 2.0
    changes = (
        {"gains": (off, 1.0)}, {"gains": (1.0, off)}, {"stated_speed": off},
        {"stated_sample": float(random.choice([0.1, 0.5, 2.0, 8.0]))},
    )  # fmt: skip
    return replace(lab, crush=crush, **changes[kind])


def _vary_ringing(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    ratio = random.uniform(0.005, 0.05)
    if random.uniform() < 0.3:
        return replace(lab, spring=(random.uniform(2e3, 6e3), ratio), record=4e-3)
    return replace(lab, mount=(random.uniform(7e3, 20e3), ratio), record=4e-3)


def _vary_friction(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    held = replace(
        lab,
        spring=(random.uniform(2e3, 6e3), random.uniform(0.005, 0.02)),
        record=6e-3,
        noise=1e-4,
    )
    largest = 2.0 * held.hammer * held.speed / held.sample * 2.0 * math.pi * held.spring[0] / 4.0
    kind = int(random.integers(3))
    if kind == 0:
        return replace(held, friction=random.uniform(0.005, 0.02) * largest)
    if kind == 1:
        scale = held.speed * held.hammer / held.sample
        return replace(
            held, air=random.uniform(0.02, 0.1) * 2.0 * math.pi * held.spring[0] / scale
        )
    return replace(held, window=random.uniform(3.0, 5.0) / held.record)


def _vary_unstated(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    one, other = (1.0 + 0.03 * random.standard_normal(2)).tolist()
    together = random.uniform() < 0.5
    return replace(lab, gains=(one, one if together else other))


def _vary_series(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    if random.uniform() < 0.5:
        return replace(lab, warming=random.uniform(0.03, 0.08), scatter=0.002)
    return replace(lab, speeds=(0.5,) * 5 + (1.5,) * 5, scatter=0.02)


def _vary_corner(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    return replace(lab, corner=random.uniform(25e3, 80e3))


def _vary_crushed(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    return replace(lab, crush=random.uniform(1.3, 4.0), losses=())


def _vary_memory(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    time, loss = random.uniform(0.1, 1.0), random.uniform(0.05, 0.3)  # tan delta
    # At the frequency of the pulse, half a period long.
    turn = math.pi * time
    share = loss * (1.0 + turn**2) / (turn + loss)
    # A part that relaxes softens the pulse.
    linear = replace(lab, exponent=float(random.choice([1.0, 1.5])), losses=(), duration=1e-3)
    return replace(
        linear, relaxing=(share, time), rate=500e3, record=8e-3, before=1.5e-3, noise=3e-4
    )


def _vary_modes(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    modes = [
        (f, random.uniform(2e-4, 1.5e-3), random.uniform(0.2, 1.0))
        for f in random.uniform(900.0, 4470.0, 9)
    ]
    return replace(lab, modes=tuple(modes), sample=random.uniform(0.5, 5.0), record=40e-3)


def _vary_speed(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    lab = replace(lab, gain_uncertainty=0.005, speed_uncertainty=0.005)
    off = 1.0 + random.choice([-1.0, 1.0]) * np.array([0.05, 0.04])
    # 5 mm from the axis of a bar of 30 x 50 mm: radius of gyration 16.2 mm.
    eccentric = 1.0 / (1.0 + (5.0 / 16.2) ** 2)
    changes = (
        {"stated_sample": off[0]}, {"stated_speed": off[1]},
        {"gains": (math.cos(math.radians(20.0)), 1.0)},
        {"sample": lab.sample * eccentric, "stated_sample": 1.0 / eccentric,
         "gains": (1.0, eccentric)},
    )  # fmt: skip
    return replace(lab, **changes[int(random.integers(4))])


def _vary_sensors(lab: Laboratory, random: np.random.Generator) -> Laboratory:
    resonances = tuple(random.uniform(45e3, 90e3, 2).tolist())
    return replace(lab, resonances=resonances, ringing=random.uniform(0.005, 0.04))


_VARY: dict[Cause, Callable[[Laboratory, np.random.Generator], Laboratory]] = {
    Cause.LAW: _vary_law,
    Cause.GAIN: _vary_gain,
    Cause.RINGING: _vary_ringing,
    Cause.FRICTION: _vary_friction,
    Cause.UNSTATED: _vary_unstated,
    Cause.SERIES: _vary_series,
    Cause.CORNER: _vary_corner,
    Cause.CRUSHED: _vary_crushed,
    Cause.MEMORY: _vary_memory,
    Cause.MODES: _vary_modes,
    Cause.SPEED: _vary_speed,
    Cause.SENSORS: _vary_sensors,
}


def judge_all(count: int, seed: int, causes: Sequence[Cause] = tuple(Cause)) -> Iterator[Verdict]:
    """Yield the verdicts on `count` series, causes in turn."""
    for number in range(count):
        cause = causes[number % len(causes)]
        random = np.random.default_rng((seed, number))
        yield judge(cause, draw_laboratory(cause, random))
