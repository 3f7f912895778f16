"""Two bodies that meet, and the accelerometers on them: nothing of it is the package's.

A second contact is a separate hit: slower, lower and wider.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, cont2discrete, lfilter

from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import Session

from .contacts import FloatArray, Motion, find_loss, strike_body

RATE, COUNT, START = 2.5e6, 5000, 200e-6
HAMMER, SAMPLE, SPEED, DURATION = 0.1, 0.10538, 0.0819, 212e-6
FULL_SCALES = (2000.0, 4000.0)


def resonate(traces: FloatArray, frequency: float, ratio: float, rate: float) -> FloatArray:
    """Return what a second-order system shows of accelerations; of 0 Hz all."""
    if not frequency:
        return traces
    w = 2.0 * np.pi * frequency
    top, bottom, _ = cont2discrete(([w**2], [1.0, 2.0 * ratio * w, w**2]), 1.0 / rate, "foh")
    return np.asarray(lfilter(top.ravel(), bottom, traces))


@dataclass(frozen=True)
class Impact:
    """One impact, and what sensors and converter make of it; parts of the hammer's peak."""

    duration: float = DURATION
    exponent: float = 1.5
    restitution: float = 0.9
    sample_mass: float = SAMPLE
    second: tuple[float, float] = (0.0, 0.0)  # its speed over the first's; from touch to touch
    resonance: float = 70e3  # 0: none
    noise: float = 1e-3  # of full scale
    hum: float = 0.0
    zero_shift: float = 0.0
    shifts_at: float = np.nan  # where in the contact the zero shifts at once
    recovery: float = np.inf  # of the zero shift [s]
    corner: float = 0.1  # [Hz]
    drift: float = 0.0  # over the record
    cable_noise: float = 0.0
    clip: float = np.inf
    stated_scale: bool = True
    signs: tuple[int, int] = (1, -1)
    dropout: float = np.nan  # where in the contact
    low_pass: float = 0.0  # of an amplifier, not stated [Hz]
    speed: float = SPEED
    seed: int = 0
    motion: Motion | None = None  # of another law; else by exponent and restitution
    rate_factor: float = 1.0  # sampling rate that is stated over the true one
    gain: float = 1.0  # of what is stated

    @property
    def equivalent_mass(self) -> float:
        """Of the bodies that move [kg]."""
        return 1.0 / (1.0 / HAMMER + 1.0 / self.sample_mass)

    def find_force(self, time: FloatArray) -> FloatArray:
        """Return force over the hammer's mass [m/s^2]."""
        if self.motion is not None:
            return self._stretch(self.motion, self.motion.force, time, 1.0, self.duration)
        loss = find_loss(self.exponent, self.restitution)
        total = np.zeros(time.size)
        for part, delay in ((1.0, 0.0), self.second):
            if not part:
                continue
            # A goes with the speed; T with its power of -(n - 1)/(n + 1).
            whole, motion = (
                strike_body(self.exponent, round(loss * item, 3)) for item in (1.0, part)
            )
            duration = self.duration * motion.time[-1] / whole.time[-1]
            duration *= part ** ((1.0 - self.exponent) / (1.0 + self.exponent))
            total += self._stretch(motion, motion.force, time - delay, part, duration)
        return total

    def _stretch(
        self, motion: Motion, force: FloatArray, time: FloatArray, part: float, duration: float
    ) -> FloatArray:
        unit = duration / motion.time[-1]
        height = self.equivalent_mass * self.speed * part / unit / HAMMER
        return height * np.interp(time / unit, motion.time, force, 0.0, 0.0)

    def measure(self) -> FloatArray:
        """Return both channels as the converter gives them [m/s^2]."""
        random = np.random.default_rng(self.seed)
        start = START + 1e-6 * random.standard_normal()
        time = np.arange(COUNT) / RATE - start
        force = self.find_force(time)
        peak = force.max()
        traces = np.outer((self.signs[0], self.signs[1] * HAMMER / self.sample_mass), force)
        if self.motion is not None and self.motion.recoil is not None:
            unit = self.duration / self.motion.time[-1]
            recoil = np.interp(time / unit, self.motion.time, self.motion.recoil, 0.0, 0.0)
            traces[1] = -self.speed / unit * recoil
        traces *= self.gain
        traces = resonate(traces, self.resonance, 0.02, RATE)
        ratio = np.array([[1.0], [HAMMER / self.sample_mass]])
        # The crystal keeps a charge that grows with the shock, and lets it go.
        after = np.cumsum(force) / force.sum()
        if np.isfinite(self.shifts_at):
            after = time > self.shifts_at * self.duration
        gone = np.exp(-np.maximum(time - self.duration, 0.0) / self.recovery)
        traces += self.zero_shift * peak * ratio * after * gone
        traces = lfilter(*butter(1, self.corner, "high", fs=RATE), traces)
        traces += self.drift * peak * ratio * np.arange(COUNT) / COUNT
        if self.cable_noise:
            slow = butter(2, 2e3, fs=RATE)
            noise = lfilter(*slow, random.standard_normal((2, 2 * COUNT)))[:, COUNT:]
            moving = np.clip(time / 50e-6, 0.0, 1.0)
            traces += self.cable_noise * peak * ratio * moving * noise / noise.std()
        if self.low_pass:
            traces = lfilter(*butter(2, self.low_pass, fs=RATE), traces)
        scales = np.array(FULL_SCALES)[:, np.newaxis]
        hum = self.hum * np.sin(2.0 * np.pi * (50.0 * time + random.uniform()))
        traces += scales * (hum + self.noise * random.standard_normal(traces.shape))
        traces[0] = np.clip(traces[0], -self.clip * peak, self.clip * peak)
        step = scales / 2**11
        counts = np.clip(np.rint(traces / step), -2048, 2047)
        if np.isfinite(self.dropout):
            counts[0, round((start + self.dropout * self.duration) * RATE)] = 0.0
        return counts * step

    def make_block(self, label: HitLabel) -> Block:
        """Return the hit as a digitizer sends it; where no scale is stated, as a file has it."""
        channels = []
        for trace, scale in zip(self.measure(), FULL_SCALES, strict=True):
            if self.stated_scale:
                counts = np.rint(trace / scale * 2**11).astype(np.int32)
                channels.append(ChannelBlock(counts, scale / 2**11, 0.0, scale))
            else:
                channels.append(ChannelBlock(trace, 1.0, 0.0, 0.0))
        return Block(0, self.rate_factor * RATE, channels[0], channels[1], label, last=True)


SETUP = RigSetup(
    SampleSet((Sample("struck", SAMPLE),), "struck"), hammer_mass=HAMMER, impact_speed=SPEED
)


def repeat(impact: Impact, hits: int = 5) -> list[Impact]:
    """Return hits that differ in their noise."""
    return [replace(impact, seed=seed) for seed in range(1, hits + 1)]


def judge(impacts: Iterable[Impact]) -> tuple[Session, list[JudgedHit]]:
    """Return a session that was fed these hits, and their verdicts."""
    session, hits = Session(SETUP), list[JudgedHit]()
    for record, impact in enumerate(impacts, start=1):
        hits += session.feed(impact.make_block(HitLabel("struck", record, record)))
    return session, hits
