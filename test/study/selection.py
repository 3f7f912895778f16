"""Hits with and without faults of sensors and converters: which are found, by their size.

Contacts of the law, of other materials, n and e each, through sensors that ring, by a converter
with noise and hum. Every fault is what physics makes of it: a second contact is slower, lower and
wider than the first, a zero shifts with the momentum or at once, a low corner droops.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, lfilter

from impact_rig.core.given.filtering import respond
from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import Block, ChannelBlock, FloatArray, HitLabel
from impact_rig.core.given.sensors import SensorResponse
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.session import Session
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.rig import (
    CountArray,
    DigitizerSettings,
    VirtualRigSettings,
    compute_scale,
    couple,
    digitize,
)

SERIES_HITS = 10
"""Good hits of a series [-], as in a campaign."""
EXPONENTS, RESTITUTIONS = (1.3, 1.7), (0.7, 0.9)
"""Of the contacts [-]: what metals show, more or less like Hertz."""
RESONANCES = (40e3, 100e3)
"""Of mounted sensors [Hz]."""
LARGEST_HUM = 2e-4
"""Its amplitude over full scale [-], our choice."""
MAINS_FREQUENCY = 50.0
SHORTEST_DELAY = 1.3
"""Of a second contact from touch to touch, in durations [-]: before, it is the first."""
RECOVERIES = (1e-3, 1.0)
"""In which a zero shift goes [s]: milliseconds to seconds."""
CABLE_FREQUENCY = 2e3
"""Up to which a moving cable makes noise [Hz], our choice."""


@dataclass(frozen=True)
class Fault:
    """What may be wrong with a hit, in several sizes."""

    reason: Reason  # by which it is to be found
    sizes: tuple[float, ...]  # [%] of the peak, but for the corner [Hz]
    sure: float  # size from which on 99 % are to be found; NaN: none is asked for
    text: str

    def name(self, size: float) -> str:
        """Return the name of one size."""
        return self.text.format(size)


SECOND = Fault(Reason.DOUBLE_HIT, (1.5, 2.0, 3.0, 5.0), 5.0, "second contact of {:g} %")
STEP = Fault(Reason.ZERO_SHIFT, (0.2, 0.5, 1.0, 2.0, 5.0), 2.0, "zero shift of {:g} %")
DROOP = Fault(Reason.DROOP, (1.0, 3.0, 5.0, 10.0, 50.0), 50.0, "lower corner of {:g} Hz")
CLIPPED = Fault(Reason.OVERLOAD, (99.8, 99.5, 99.0, 97.0), 97.0, "clipped at {:g} % of the peak")
DROPOUT = Fault(Reason.DROPOUT, (3.0, 5.0, 10.0, 50.0), 10.0, "one point lost {:g} % into it")
TURNED = Fault(Reason.POLARITY, (1.0, 2.0), 1.0, "{:g} of 2 channels turned")
CABLE = Fault(Reason.UNSTEADY_ZERO, (1.0, 2.0, 3.0, 5.0), math.nan, "cable noise of {:g} % RMS")
FAULTS = (SECOND, STEP, DROOP, CLIPPED, DROPOUT, TURNED, CABLE)
SURE = tuple(
    fault.name(size)
    for fault in FAULTS
    if not math.isnan(fault.sure)
    for size in fault.sizes[fault.sizes.index(fault.sure) :]
)
"""Names of what is to be found."""


def strike_good_hits(setup: RigSetup, seed: int, number: int) -> int:
    """Strike a series of good hits and return how many were left out."""
    rig = _Rig(setup, seed, number)
    session = Session(setup)
    for impact in range(1, SERIES_HITS + 1):
        session.feed(rig.strike(HitLabel(rig.sample, impact, impact)))
    return len(session.get_selection(rig.sample).left_out)


def strike_fault(setup: RigSetup, fault: Fault, seed: int, number: int) -> dict[str, bool]:
    """Strike one fault in all its sizes; return by their names which were rightly named."""
    rig = _Rig(setup, seed, number)
    found = {}
    for impact, size in enumerate(fault.sizes, start=2):
        session = Session(setup)
        if fault is TURNED:
            session.feed(rig.strike(HitLabel(rig.sample)))
        (hit,) = session.feed(rig.strike(HitLabel(rig.sample, impact, impact), fault, size))
        reasons = {item.reason for item in hit.rejections + hit.findings}
        found[fault.name(size)] = fault.reason in reasons
    return found


class _Rig:
    """One contact, its sensors and their digitizer, drawn at random; samples take turns."""

    def __init__(self, setup: RigSetup, seed: int, number: int) -> None:
        names = setup.samples.names
        self.sample = names[number % len(names)]
        self._random = random = np.random.default_rng((seed, number))
        self._contact = make_nominal_contact(
            setup, self.sample, random.uniform(*EXPONENTS), random.uniform(*RESTITUTIONS)
        )
        self._sensors = [SensorResponse(random.uniform(*RESONANCES)) for _ in range(2)]
        self._hum = LARGEST_HUM * random.uniform()
        self._is_stated = bool(random.integers(2))

    def strike(self, label: HitLabel, fault: Fault | None = None, size: float = 0.0) -> Block:
        """Return one hit as it is recorded."""
        random, scatter, digitizer = self._random, VirtualRigSettings(), DigitizerSettings()
        contact = self._contact.scatter(
            1.0 + scatter.contact_time_scatter * random.standard_normal(),
            1.0 + scatter.amplitude_scatter * random.standard_normal(),
        )
        rate, count = digitizer.sampling_rate, digitizer.count
        start = digitizer.trigger_jitter * random.standard_normal() - digitizer.pre_trigger
        time = start + np.arange(count) / rate
        traces = np.stack(contact.simulate(rate, count, start))
        peak, part = float(np.abs(traces[0]).max()), size / 100.0
        if fault is SECOND:
            # Without loss F goes with v^(2n / (n + 1)).
            slower = part ** ((contact.exponent + 1.0) / (2.0 * contact.exponent))
            last = time[-1] - contact.duration
            delay = random.uniform(SHORTEST_DELAY * contact.duration, last)
            traces += contact.scatter(1.0, slower).simulate(rate, count, start - delay)
        shape = self._shift_zero(time, traces[0], contact.duration)
        traces = np.stack(
            [respond(*pair, rate) for pair in zip(traces, self._sensors, strict=True)]
        )
        if fault is STEP:
            traces[0] += part * peak * random.choice((-1.0, 1.0)) * shape
        if fault is DROOP:
            traces[0] = couple(traces[0], size, rate)
        if fault is CABLE:
            noise = lfilter(
                *butter(2, CABLE_FREQUENCY, fs=rate), random.standard_normal(2 * count)
            )[count:]
            traces[0] += part * peak * noise / noise.std() * (time > 0.0)
        traces[: int(size) if fault is TURNED else 0] *= -1.0
        scales = digitizer.hammer_full_scale, digitizer.specimen_full_scale
        hum = self._hum * np.sin(2.0 * math.pi * (MAINS_FREQUENCY * time + random.uniform()))
        counts = [
            digitize(trace + scale * hum, scale, digitizer, random)
            for trace, scale in zip(traces, scales, strict=True)
        ]
        if fault is CLIPPED:
            highest = float(np.abs(traces[0]).max())
            rail = round(part * highest / compute_scale(scales[0], digitizer.bits))
            counts[0] = np.clip(counts[0], -rail, rail)
        if fault is DROPOUT:
            counts[0][int(np.searchsorted(time, part * contact.duration))] = 0
        hammer, specimen = (
            self._make_channel(values, scale, compute_scale(scale, digitizer.bits))
            for values, scale in zip(counts, scales, strict=True)
        )
        return Block(0, rate, hammer, specimen, label, last=True)

    def _make_channel(self, counts: CountArray, scale: float, step: float) -> ChannelBlock:
        """Return what a digitizer sends, or what a file has that states neither scale nor step."""
        if self._is_stated:
            return ChannelBlock(counts, step, 0.0, scale)
        return ChannelBlock(counts.astype(np.float64) * step, 1.0, 0.0, 0.0)

    def _shift_zero(self, time: FloatArray, force: FloatArray, duration: float) -> FloatArray:
        """Return how a zero goes that a shock shifts by 1: with the momentum, or at once."""
        random = self._random
        recovery = math.exp(random.uniform(*np.log(RECOVERIES)))
        passed = np.cumsum(force) / force.sum()
        shift = time > random.uniform(0.2, 0.8) * duration if random.integers(2) else passed
        return np.asarray(shift * np.exp(-np.maximum(time - duration, 0.0) / recovery))
