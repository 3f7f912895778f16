"""Two free bodies that meet, and the accelerometers on them: nothing of it is the package's.

The contact's law is integrated by DOP853, once for each n and A; a second contact is one of its
own, slower, and so lower and wider.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.signal import butter, cont2discrete, lfilter

from impact_rig.core.records import Block, ChannelBlock, HitLabel

FloatArray = NDArray[np.float64]
RATE, COUNT, START = 2.5e6, 5000, 200e-6
HAMMER, SAMPLE, SPEED = 0.1, 0.10538, 0.0819
FULL_SCALES = (2000.0, 4000.0)


@lru_cache(maxsize=64)
def collide(exponent: float, loss: float) -> Any:
    """Integrate x'' = -x^n (1 + A x') from touch to separation."""

    def separate(_time: float, state: FloatArray) -> float:
        return float(state[0])

    separate.terminal, separate.direction = True, -1  # type: ignore[attr-defined]
    return solve_ivp(
        lambda _time, x: (x[1], -(max(x[0], 0.0) ** exponent) * (1.0 + loss * x[1])),
        (0.0, 60.0),
        (0.0, 1.0),
        method="DOP853",
        rtol=1e-9,
        atol=1e-11,
        events=separate,
        dense_output=True,
    )


@lru_cache(maxsize=16)
def find_loss(exponent: float, restitution: float) -> float:
    """Return A of bodies that part with `restitution`, to three digits."""
    if restitution == 1.0:
        return 0.0

    def exceed(loss: float) -> float:
        return -collide(exponent, loss).y[1, -1] - restitution

    return round(brentq(exceed, 0.01, 5.0, xtol=1e-4), 3)


@dataclass(frozen=True)
class Impact:
    """One impact, and what sensors and converter make of it; parts of the hammer's peak."""

    duration: float = 212e-6
    exponent: float = 1.5
    restitution: float = 0.9
    sample_mass: float = SAMPLE
    second: tuple[float, float] = (0.0, 0.0)  # its speed over the first's; from touch to touch
    resonance: float = 70e3
    noise: float = 1e-3  # of full scale
    hum: float = 0.0
    zero_shift: float = 0.0
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
    unloading: float = 0.0  # spring that unloads over the one that loads, by Walton and Braun

    def find_force(self, time: FloatArray) -> FloatArray:
        """Return force over the hammer's mass [m/s^2]."""
        if self.unloading:
            return self._find_crush(time)
        loss = find_loss(self.exponent, self.restitution)
        unit = self.duration / collide(self.exponent, loss).t[-1]
        both = HAMMER * self.sample_mass / (HAMMER + self.sample_mass)
        total = np.zeros(time.size)
        for part, delay in ((1.0, 0.0), self.second):
            if not part:
                continue
            # A goes with the speed; T with its power of -(n - 1)/(n + 1).
            motion = collide(self.exponent, round(loss * part, 3))
            scale = unit * part ** ((1.0 - self.exponent) / (1.0 + self.exponent))
            inside = (time > delay) & (time < delay + scale * motion.t[-1])
            depth, rate = motion.sol((time[inside] - delay) / scale)
            height = both * self.speed * part / scale / HAMMER
            rate = 1.0 + round(loss * part, 3) * rate
            total[inside] += height * np.maximum(depth, 0.0) ** self.exponent * rate
        return total

    def _find_crush(self, time: FloatArray) -> FloatArray:
        """Return it for one spring that loads, and a stiffer one that unloads."""
        both = HAMMER * self.sample_mass / (HAMMER + self.sample_mass)
        load = 0.5 * np.pi / self.duration * (1.0 + self.unloading**-0.5)
        unload = load * self.unloading**0.5
        top = 0.5 * np.pi / load
        force = np.where(time < top, np.sin(load * time), np.cos(unload * (time - top)))
        inside = (time > 0.0) & (time < self.duration)
        return np.asarray(np.where(inside, both * self.speed * load / HAMMER * force, 0.0))

    def measure(self) -> FloatArray:
        """Return both channels as the converter gives them [m/s^2]."""
        random = np.random.default_rng(self.seed)
        start = START + 1e-6 * random.standard_normal()
        time = np.arange(COUNT) / RATE - start
        force = self.find_force(time)
        peak = force.max()
        traces = np.outer((self.signs[0], self.signs[1] * HAMMER / self.sample_mass), force)
        angular = 2.0 * np.pi * self.resonance
        top, bottom, _ = cont2discrete(
            ([angular**2], [1.0, 0.04 * angular, angular**2]), 1.0 / RATE, "foh"
        )
        traces = lfilter(top.ravel(), bottom, traces)
        ratio = np.array([[1.0], [HAMMER / self.sample_mass]])
        # The crystal keeps a charge that grows with the shock, and lets it go.
        after = np.cumsum(force) / force.sum()
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
        return Block(0, RATE, channels[0], channels[1], label, last=True)
