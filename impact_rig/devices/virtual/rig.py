"""The virtual rig: one call, one hit, repeatable by its seed."""

from dataclasses import dataclass, field, replace
from zlib import crc32

import numpy as np

from impact_rig.core.checks import check_between, check_not_negative
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.impact import ImpactModel
from impact_rig.core.model.pulses import VERSED_SINE, PulseShape
from impact_rig.core.setup.paper import HAMMER_DAMPING_COEFFICIENT
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block, ChannelBlock, FloatArray, HitLabel
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.digitizer import DigitizerSettings, digitize, find_scale
from impact_rig.devices.virtual.faults import FaultPlan
from impact_rig.devices.virtual.plants import (
    HitPhysics,
    check_pulse_shape,
    find_nominal_model,
    simulate_plant,
)

OVERLOAD_RANGE = (1.2, 2.0)
"""Peak of an overloaded hit over the hammer's full scale [-]."""
WEAK_RANGE = (0.04, 0.10)
"""Peak of a weak hit over the hammer's full scale [-]."""
DOUBLE_HEIGHT_RANGE = (0.05, 0.60)
"""Second pulse of a double hit over the first [-]."""
DOUBLE_DELAY_RANGE = (1.2, 4.0)
"""Delay of the second pulse, in contact times [-]."""


@dataclass(frozen=True)
class VirtualRigSettings:
    """Physics, scatter and faults of the virtual rig.

    Attributes
    ----------
    plant : Plant
        Which physics.
    seed : int
        The same seed gives the same hits, in whatever order and however often they are asked.
    contact_time_scatter : float
        Standard deviation of tau_p from hit to hit, relative [-].
    amplitude_scatter : float
        Standard deviation of F0 from hit to hit, relative [-].
    pulse_shape : PulseShape
        Of the contact force.
    asymmetry : float
        Of the contact pulse [-], see `HitPhysics`.
    hammer_damping : float
        c1 [N s/m].
    digitizer : DigitizerSettings
        The acquisition chain.
    faults : FaultPlan
        What goes wrong.
    """

    plant: Plant = Plant.PUBLISHED
    seed: int = 1
    contact_time_scatter: float = 3e-3
    amplitude_scatter: float = 2e-2
    pulse_shape: PulseShape = VERSED_SINE
    asymmetry: float = 0.02
    hammer_damping: float = HAMMER_DAMPING_COEFFICIENT
    digitizer: DigitizerSettings = field(default_factory=DigitizerSettings)
    faults: FaultPlan = field(default_factory=FaultPlan)

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        if self.seed < 0:
            raise ParameterError(f"seed is {self.seed}: it must be 0 or more")
        check_between("contact time scatter", self.contact_time_scatter, 0.0, 0.2)
        check_between("amplitude scatter", self.amplitude_scatter, 0.0, 0.2)
        check_pulse_shape(self.plant, self.pulse_shape)
        check_between("asymmetry", self.asymmetry, -0.5, 0.5)
        check_not_negative("hammer damping coefficient", self.hammer_damping, "N s/m")


@dataclass(frozen=True)
class VirtualHit:
    """One hit: the truth, and what the digitizer made of it.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    faults : tuple of Fault
        What went wrong.
    model : ImpactModel
        True parameters of this hit.
    hammer, specimen : ChannelBlock
        The whole record.
    sampling_rate : float
        [Hz]
    """

    label: HitLabel
    faults: tuple[Fault, ...]
    model: ImpactModel
    hammer: ChannelBlock
    specimen: ChannelBlock
    sampling_rate: float

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

        Raises
        ------
        ParameterError
            If the block size is below one point.
        """
        if block_size < 1:
            raise ParameterError(f"block size is {block_size} points: it must be 1 or more")
        if Fault.MISSED_TRIGGER in self.faults:
            return (self._cut(0, 0, stamp, triggered=False, last=True),)
        count = self.hammer.output.size
        starts = list(range(0, count, block_size))
        blocks = [
            self._cut(start, min(start + block_size, count), stamp, last=start == starts[-1])
            for start in starts
        ]
        if Fault.LOST_BLOCK in self.faults and len(blocks) > 1:
            del blocks[(len(blocks) - 1) // 2]
        return tuple(blocks)

    def _cut(
        self, start: int, stop: int, stamp: int, *, triggered: bool = True, last: bool = False
    ) -> Block:
        return Block(
            label=self.label,
            first_sample=start,
            sampling_rate=self.sampling_rate,
            hammer=replace(self.hammer, output=self.hammer.output[start:stop]),
            specimen=replace(self.specimen, output=self.specimen.output[start:stop]),
            triggered=triggered,
            last=last,
            stamp=stamp + round(start / self.sampling_rate * 1e9),
        )


class VirtualRig:
    """Pendulum, samples, sensors and digitizer.

    Parameters
    ----------
    setup : RigSetup
        Masses, speed and the samples' reference values.
    settings : VirtualRigSettings
        Physics, scatter and faults.
    """

    def __init__(self, setup: RigSetup, settings: VirtualRigSettings) -> None:
        self.setup = setup
        self.settings = settings

    def check_sample(self, name: str) -> None:
        """Raise `ParameterError` if the sample is unknown or lacks a reference value."""
        find_nominal_model(self.setup, name, self.settings.hammer_damping)

    def strike(self, label: HitLabel) -> VirtualHit:
        """Simulate one hit.

        The hit depends on seed, sample, impact and attempt alone. Faults are drawn from a
        stream of their own, so that they change nothing in the good hits.

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
        nominal = find_nominal_model(self.setup, label.sample, settings.hammer_damping)
        scatter = physics_source.standard_normal(2)
        model = replace(
            nominal,
            contact_time=nominal.contact_time * (1 + settings.contact_time_scatter * scatter[0]),
            peak_force=nominal.peak_force * (1 + settings.amplitude_scatter * scatter[1]),
        )
        faults = settings.faults.draw(label, fault_source)
        hammer, specimen = self._simulate(model, faults, physics_source, fault_source)
        return VirtualHit(
            label=label,
            faults=faults,
            model=model,
            hammer=self._make_channel(
                hammer, settings.digitizer.hammer_full_scale, physics_source
            ),
            specimen=self._make_channel(
                specimen, settings.digitizer.specimen_full_scale, physics_source
            ),
            sampling_rate=settings.digitizer.sampling_rate,
        )

    def _simulate(
        self,
        model: ImpactModel,
        faults: tuple[Fault, ...],
        physics_source: np.random.Generator,
        fault_source: np.random.Generator,
    ) -> tuple[FloatArray, FloatArray]:
        digitizer = self.settings.digitizer
        start = -digitizer.pre_trigger + digitizer.trigger_jitter * float(
            physics_source.standard_normal()
        )
        physics = HitPhysics(model, self.settings.pulse_shape, self.settings.asymmetry)

        def simulate(first: float) -> FloatArray:
            return np.stack(
                simulate_plant(
                    self.settings.plant, physics, digitizer.sampling_rate, digitizer.count, first
                )
            )

        traces = simulate(start)
        if Fault.DOUBLE_HIT in faults:
            height = fault_source.uniform(*DOUBLE_HEIGHT_RANGE)
            delay = fault_source.uniform(*DOUBLE_DELAY_RANGE) * model.contact_time
            traces = traces + height * simulate(start - delay)
        hammer_peak = float(np.max(np.abs(traces[0])))
        if Fault.OVERLOAD in faults:
            traces *= fault_source.uniform(*OVERLOAD_RANGE) * (
                digitizer.hammer_full_scale / hammer_peak
            )
        elif Fault.WEAK_HIT in faults:
            traces *= fault_source.uniform(*WEAK_RANGE) * (
                digitizer.hammer_full_scale / hammer_peak
            )
        if Fault.DEAD_CHANNEL in faults:
            traces[fault_source.integers(2)] = 0.0
        return traces[0], traces[1]

    def _make_channel(
        self, acceleration: FloatArray, full_scale: float, generator: np.random.Generator
    ) -> ChannelBlock:
        counts = digitize(acceleration, full_scale, self.settings.digitizer, generator)
        return ChannelBlock(
            output=counts,
            scale=find_scale(full_scale, self.settings.digitizer.bits),
            offset=0.0,
            full_scale=full_scale,
        )
