"""The virtual rig: one call, one hit, repeatable by its seed; its digitizer and its faults."""

import math
from dataclasses import dataclass, field, replace
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from impact_rig.configuration.rig_checks import VIRTUAL_RATE
from impact_rig.core.estimates.model import ImpactModel
from impact_rig.core.given.errors import ParameterError, check_between, check_count, check_positive
from impact_rig.core.given.records import (
    NO_SPEED,
    SIMULATED,
    Block,
    ChannelBlock,
    FloatArray,
    HitLabel,
    MeasuredSpeed,
    Origin,
)
from impact_rig.core.given.setup import RigSetup
from impact_rig.devices.speed_gate import SpeedGate
from impact_rig.devices.virtual.choices import IDENTITY, Fault, Plant
from impact_rig.devices.virtual.contact import HERTZ_EXPONENT, Contact, make_nominal_contact
from impact_rig.devices.virtual.draws import Drawn, draw_truth
from impact_rig.devices.virtual.plants import (
    HitPhysics,
    make_nominal_model,
    make_published_model,
    simulate_plant,
)


def fault_from_name(name: str) -> Fault:
    """Return the fault called `name`; raises `ParameterError` for an unknown one."""
    try:
        return Fault(name)
    except ValueError:
        known = ", ".join(fault.value for fault in Fault)
        raise ParameterError(f"unknown fault {name!r}: the virtual rig knows {known}") from None


@dataclass(frozen=True)
class ScheduledFault:
    """A fault scheduled for one hit, at its first attempt."""

    fault: Fault
    impact: int  # of the series, counted from 1
    sample: str = ""  # empty: every sample

    def __post_init__(self) -> None:
        """Refuse an impossible impact number."""
        check_between("impact number of a fault", self.impact, 1, 1_000_000)


def scheduled_fault_from_text(text: str) -> ScheduledFault:
    """Read ``3:double_hit`` or ``steel small/3:double_hit``.

    Raises
    ------
    ParameterError
        If the text has another form, or the fault is unknown.
    """
    place, colon, name = text.rpartition(":")
    sample, _, impact = place.rpartition("/")
    if not colon or not impact.isdecimal():
        raise ParameterError(
            f"scheduled fault {text!r}: write IMPACT:FAULT or SAMPLE/IMPACT:FAULT, for example"
            " 3:double_hit"
        )
    return ScheduledFault(fault_from_name(name), int(impact), sample)


@dataclass(frozen=True)
class FaultPlan:
    """When which fault is injected."""

    probability: float = 0.0  # of each of `faults`, for each hit
    faults: tuple[Fault, ...] = tuple(Fault)
    scheduled: tuple[ScheduledFault, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a probability outside 0 to 1."""
        check_between("fault probability", self.probability, 0.0, 1.0)

    def draw(self, label: HitLabel, generator: np.random.Generator) -> tuple[Fault, ...]:
        """Return the faults of one hit; always draws the same number of random numbers."""
        drawn = generator.random(len(Fault))
        chosen = {
            fault
            for fault, value in zip(Fault, drawn, strict=True)
            if fault in self.faults and value < self.probability
        }
        chosen.update(
            item.fault
            for item in self.scheduled
            if item.impact == label.impact
            and label.attempt == 1
            and item.sample in ("", label.sample)
        )
        return tuple(fault for fault in Fault if fault in chosen)


CountArray = NDArray[np.int32]

SHORTEST_RECORD = 100
"""Points of a record: fewer show no pulse and its baseline."""


@dataclass(frozen=True)
class DigitizerSettings:
    """The virtual acquisition chain; the paper's digitizer by default."""

    sampling_rate: float = VIRTUAL_RATE  # [Hz]
    record_duration: float = 2e-3  # [s]
    pre_trigger: float = 0.2e-3  # [s], from the first point to the contact, jitter apart
    bits: int = 12
    hammer_full_scale: float = 2000.0  # [m/s^2]: the paper's hits reach 22 to 53 % of it
    specimen_full_scale: float = 4000.0  # [m/s^2]: the paper's hits reach 8 to 45 % of it
    noise: float = 1e-3  # white, standard deviation, part of full scale: two steps
    offset: float = 2e-3  # unknown to the estimator, part of full scale
    coupling_frequency: float = 0.1  # [Hz], -3 dB of the AC coupling; 0: DC coupled
    trigger_jitter: float = 1e-6  # [s], standard deviation of the trigger's position

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("sampling rate", self.sampling_rate, "Hz")
        check_positive("record duration", self.record_duration, "s")
        if self.count < SHORTEST_RECORD:
            raise ParameterError(
                f"record duration is {self.record_duration:g} s, which is {self.count} points at"
                f" {self.sampling_rate:g} Hz: a record needs {SHORTEST_RECORD}",
                "record duration",
            )
        check_between("pre-trigger", self.pre_trigger, 0.0, self.record_duration)
        check_between("bits", self.bits, 4, 31)
        check_positive("hammer full scale", self.hammer_full_scale, "m/s^2")
        check_positive("sample full scale", self.specimen_full_scale, "m/s^2")
        check_between("noise", self.noise, 0.0, 1.0)

    @property
    def count(self) -> int:
        """Points in one record."""
        return round(self.sampling_rate * self.record_duration)


def compute_scale(full_scale: float, bits: int) -> float:
    """Return the acceleration of one count [m/s^2]."""
    return full_scale / 2.0 ** (bits - 1)


def digitize(
    acceleration: FloatArray,
    full_scale: float,
    settings: DigitizerSettings,
    generator: np.random.Generator,
) -> CountArray:
    """Couple, offset, add noise, quantise and clip one channel.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        True acceleration [m/s^2].
    full_scale : float
        Of the channel [m/s^2].
    settings : DigitizerSettings
        The chain.
    generator : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    ndarray of int32, shape (n,)
        Counts within the converter's range.
    """
    signal = couple(acceleration, settings.coupling_frequency, settings.sampling_rate)
    noise = settings.noise * generator.standard_normal(signal.size)
    signal = signal + full_scale * (settings.offset + noise)
    largest = 2 ** (settings.bits - 1)
    counts = np.rint(signal / compute_scale(full_scale, settings.bits))
    return np.clip(counts, -largest, largest - 1).astype(np.int32)


def couple(signal: FloatArray, coupling_frequency: float, sampling_rate: float) -> FloatArray:
    """High-pass a signal, shape (n,), at rest before its first point, by one RC stage."""
    if coupling_frequency == 0.0:
        return signal
    pole = math.exp(-2.0 * math.pi * coupling_frequency / sampling_rate)
    gain = (1.0 + pole) / 2.0
    steps = (gain * np.diff(signal, prepend=0.0)).tolist()
    # As `scipy.signal.lfilter`, whose package takes longer to load than a campaign to strike.
    level = 0.0
    return np.array([level := pole * level + step for step in steps])


OVERLOAD_RANGE = (1.2, 2.0)
"""Peak of an overloaded hit over the hammer's full scale [-]."""
WEAK_RANGE = (0.035, 0.048)
"""Peak of a weak hit over the hammer's full scale [-]."""
DOUBLE_HEIGHT_RANGE = (0.05, 0.60)
"""Second pulse of a double hit over the first [-]: a copy, on the plant `contact` a contact of its
own, slower and wider."""
DOUBLE_DELAY_RANGE = (1.2, 4.0)
"""Delay of the second pulse, in contact times [-]."""


@dataclass(frozen=True)
class VirtualRigSettings:
    """Physics, scatter and faults of the virtual rig."""

    plant: Plant = Plant.PUBLISHED
    seed: int = 1  # the same seed gives the same hits, in any order
    contact_time_scatter: float = 3e-3  # of tau_p from hit to hit, standard, relative
    amplitude_scatter: float = 2e-2  # of F0, on the plant `contact` of v, standard, relative
    contact_exponent: float = HERTZ_EXPONENT  # n of the plant `contact`
    restitution: float = 0.0  # e of the plant `contact`; 0: the material's
    digitizer: DigitizerSettings = field(default_factory=DigitizerSettings)
    faults: FaultPlan = field(default_factory=FaultPlan)
    gate: SpeedGate | None = None  # the light barrier; None: the speed is not measured
    # True masses, gains and clock are drawn within their ±, once for a seed.
    draws: bool = False

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_count("seed", self.seed, 0)
        check_between("contact time scatter", self.contact_time_scatter, 0.0, 0.2)
        check_between("amplitude scatter", self.amplitude_scatter, 0.0, 0.2)
        check_between("contact exponent", self.contact_exponent, 0.5, 4.0)
        check_between("restitution", self.restitution or 1.0, 0.1, 1.0)

    @property
    def origin(self) -> Origin:
        """Origin of its hits."""
        return Origin(SIMULATED, f"{IDENTITY}, plant {self.plant.value}")


@dataclass(frozen=True)
class VirtualHit:
    """One hit: its true parameters and its digitized signals."""

    label: HitLabel
    faults: tuple[Fault, ...]
    model: ImpactModel  # true parameters of this hit
    hammer: ChannelBlock  # the whole record
    specimen: ChannelBlock
    sampling_rate: float  # [Hz]
    origin: Origin
    contact: Contact | None = None  # its true law on the plant `contact`
    speed: MeasuredSpeed = NO_SPEED  # by the light barrier

    def split(self, block_size: int, stamp: int) -> tuple[Block, ...]:
        """Return the record as the stream of blocks that the accelerometers deliver.

        Parameters
        ----------
        block_size : int
            Points per block.
        stamp : int
            Time of the first point, nanoseconds since the epoch.

        Returns
        -------
        tuple of Block
            A missed trigger gives one empty block; a lost block is missing in the middle.
        """
        whole = Block(
            0,
            self.sampling_rate,
            self.hammer,
            self.specimen,
            self.label,
            last=True,
            stamp=stamp,
            origin=self.origin,
            impact_speed=self.speed,
        )
        if Fault.MISSED_TRIGGER in self.faults:
            return (replace(whole.cut(0, 0), triggered=False, last=True),)
        blocks = list(whole.split(block_size))
        if Fault.LOST_BLOCK in self.faults and len(blocks) > 1:
            del blocks[(len(blocks) - 1) // 2]
        return tuple(blocks)


def make_nominal_physics(setup: RigSetup, sample: str, settings: VirtualRigSettings) -> HitPhysics:
    """Return a hit on `sample` without scatter.

    Raises
    ------
    ParameterError
        If the sample or the control sample lacks what the plant needs.
    """
    # The check mass swings free: no plant puts it on a spring.
    if settings.plant is Plant.CONTACT or sample == setup.samples.check_sample:
        contact = make_nominal_contact(
            setup, sample, settings.contact_exponent, settings.restitution
        )
        return HitPhysics(contact.make_model(), contact=contact)
    make_model = make_published_model if settings.plant is Plant.PUBLISHED else make_nominal_model
    return HitPhysics(make_model(setup, sample))


def _scatter_physics(nominal: HitPhysics, duration: float, force: float) -> HitPhysics:
    """Return a hit whose contact time and force (or speed) are scaled by these factors."""
    if nominal.contact is not None:
        contact = nominal.contact.scatter(duration, force)
        return replace(nominal, model=contact.make_model(), contact=contact)
    time, peak = nominal.model.contact_time * duration, nominal.model.peak_force * force
    return replace(nominal, model=replace(nominal.model, contact_time=time, peak_force=peak))


def _slow_down(physics: HitPhysics, contact: Contact, height: float) -> HitPhysics:
    """Return a slower and wider contact whose peak is `height` times the given one's."""
    # Without loss F goes with v^(2n / (n + 1)).
    exponent = contact.exponent
    return _scatter_physics(physics, 1.0, height ** ((exponent + 1.0) / (2.0 * exponent)))


class VirtualRig:
    """Pendulum, samples, sensors and digitizer.

    Parameters
    ----------
    setup : RigSetup
        Masses, speed and the samples' reference values.
    settings : VirtualRigSettings
        Physics, scatter and faults.
    is_ranged : bool
        The digitizer's full scales follow the speed of the release angle, as if a person set the
        amplifiers.
    """

    def __init__(
        self, setup: RigSetup, settings: VirtualRigSettings, *, is_ranged: bool = True
    ) -> None:
        self._truth = draw_truth(setup, settings.seed) if settings.draws else Drawn(setup)
        self.setup = self._truth.setup
        self.settings = settings
        self._is_ranged = is_ranged
        self._nominal: dict[str, HitPhysics] = {}  # by sample: it is the same for each hit

    def check_sample(self, name: str) -> None:
        """Raise `ParameterError` if the sample is unknown or lacks a reference value."""
        self._find_nominal(name)

    def _find_nominal(self, sample: str) -> HitPhysics:
        if sample not in self._nominal:
            self._nominal[sample] = make_nominal_physics(self.setup, sample, self.settings)
        return self._nominal[sample]

    def strike(self, label: HitLabel) -> VirtualHit:
        """Simulate one hit.

        The hit depends on seed, sample, impact and attempt alone. Faults are drawn from
        another stream, so that they change nothing in the good hits.

        Raises
        ------
        ParameterError
            If the sample is unknown or lacks a reference value.
        """
        settings = self.settings
        key = (crc32(label.sample.encode()), label.impact, label.attempt)
        physics_source, fault_source = (
            np.random.default_rng(np.random.SeedSequence((settings.seed, *key, stream)))
            for stream in (0, 1)
        )
        nominal = self._find_nominal(label.sample)
        scatter = physics_source.standard_normal(2)
        duration = 1 + settings.contact_time_scatter * scatter[0]
        force = 1 + settings.amplitude_scatter * scatter[1]
        physics = _scatter_physics(nominal, duration, force)
        # A law's speed scatters itself; else force goes with speed over contact time.
        speed = nominal.model.impact_speed * force * (duration if physics.contact is None else 1.0)
        faults = settings.faults.draw(label, fault_source)
        digitizer = self._choose_range(label.sample)
        traces = self._simulate(physics, digitizer, faults, physics_source, fault_source)
        hammer, specimen = (
            gain * trace for gain, trace in zip(self._truth.gains, traces, strict=True)
        )
        return VirtualHit(
            label=label,
            faults=faults,
            model=physics.model,
            hammer=make_channel(hammer, digitizer.hammer_full_scale, digitizer, physics_source),
            specimen=make_channel(
                specimen, digitizer.specimen_full_scale, digitizer, physics_source
            ),
            sampling_rate=digitizer.sampling_rate,
            origin=settings.origin,
            contact=physics.contact,
            speed=self._measure_speed(float(speed)),
        )

    def _measure_speed(self, speed: float) -> MeasuredSpeed:
        """Let the hammer pass the light barrier, whose flag leaves it just before the contact."""
        gate, rate = self.settings.gate, self.settings.digitizer.sampling_rate
        if gate is None:
            return NO_SPEED
        # Of the flag that this rig has, for all hits.
        source = np.random.default_rng(np.random.SeedSequence((self.settings.seed, 2)))
        true = gate.distance + gate.distance_uncertainty * float(source.standard_normal())
        ways = true * np.linspace(1.1, 0.1, gate.edges) * gate.rate / speed
        if ways[0] >= 1.0:  # it is let go in the barrier
            return NO_SPEED
        # Points are counted from the contact back.
        points = np.floor(-np.arcsin(ways) / gate.rate * rate)
        return gate.measure((points + 0.5) / rate, 0.0, 1.0 / rate)

    def _choose_range(self, sample: str) -> DigitizerSettings:
        """Return the digitizer as it is set for the hits on a sample."""
        digitizer, setup = self.settings.digitizer, self.setup
        if not (self._is_ranged and setup.samples.find(sample).has_angle):
            return digitizer
        factor = setup.for_series(sample).impact_speed / setup.impact_speed
        return replace(
            digitizer,
            hammer_full_scale=factor * digitizer.hammer_full_scale,
            specimen_full_scale=factor * digitizer.specimen_full_scale,
        )

    def _simulate(
        self,
        physics: HitPhysics,
        digitizer: DigitizerSettings,
        faults: tuple[Fault, ...],
        physics_source: np.random.Generator,
        fault_source: np.random.Generator,
    ) -> tuple[FloatArray, FloatArray]:
        jitter = digitizer.trigger_jitter * float(physics_source.standard_normal())
        start = -digitizer.pre_trigger + jitter

        def simulate(first: float, physics: HitPhysics = physics) -> FloatArray:
            rate = digitizer.sampling_rate * self._truth.clock
            return np.stack(
                simulate_plant(self.settings.plant, physics, rate, digitizer.count, first)
            )

        traces = simulate(start)
        if Fault.DOUBLE_HIT in faults:
            height = fault_source.uniform(*DOUBLE_HEIGHT_RANGE)
            delay = fault_source.uniform(*DOUBLE_DELAY_RANGE) * physics.model.contact_time
            traces = traces + (
                height * simulate(start - delay)
                if physics.contact is None
                else simulate(start - delay, _slow_down(physics, physics.contact, height))
            )
        hammer_peak = float(np.max(np.abs(traces[0])))
        to_full_scale = digitizer.hammer_full_scale / hammer_peak
        if Fault.OVERLOAD in faults:
            traces *= fault_source.uniform(*OVERLOAD_RANGE) * to_full_scale
        elif Fault.WEAK_HIT in faults:
            traces *= fault_source.uniform(*WEAK_RANGE) * to_full_scale
        if Fault.DEAD_CHANNEL in faults:
            traces[fault_source.integers(2)] = 0.0
        return traces[0], traces[1]


def make_channel(
    acceleration: FloatArray,
    full_scale: float,
    digitizer: DigitizerSettings,
    generator: np.random.Generator,
) -> ChannelBlock:
    """Return one channel's true acceleration [m/s^2], shape (n,), as the digitizer delivers it."""
    return ChannelBlock(
        output=digitize(acceleration, full_scale, digitizer, generator),
        scale=compute_scale(full_scale, digitizer.bits),
        offset=0.0,
        full_scale=full_scale,
    )
