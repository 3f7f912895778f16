"""The interfaces of drivers: acceleration sources and hammer holders."""

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import ParameterError, check_between, check_positive
from impact_rig.core.given.quantity import Comparable
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel, RawArray
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import RigSetup
from impact_rig.devices.speed_gate import SpeedGate

if TYPE_CHECKING:
    from impact_rig.devices.virtual.rig import VirtualHit


NOT_MEASURED = ChannelBlock(np.empty(0, np.int32), scale=1.0, offset=0.0, full_scale=0.0)
"""Stands for a channel that is not measured."""


@dataclass(frozen=True)
class FoundDevice:
    """A device that a driver could use."""

    address: str  # as the rig file names it: "Dev1", "/dev/ttyUSB0"
    identity: str = ""  # model and serial number, as far as known without opening it


@dataclass(frozen=True)
class ChannelScale:
    """Scale of the numbers of a device's channel."""

    scale: float  # [m/s^2], of one
    full_scale: float  # [m/s^2], that sensor and input can show
    rail: float  # number, either sign, from which on the channel is overloaded

    def make_block(self, numbers: RawArray, *, overloaded: bool = False) -> ChannelBlock:
        """Return numbers, shape (n,), as a calibrated block; at the rail it is overloaded, too."""
        at_rail = bool(np.any((numbers >= self.rail) | (numbers <= -self.rail)))
        return ChannelBlock(numbers, self.scale, 0.0, self.full_scale, overloaded or at_rail)


@dataclass(frozen=True)
class SourceChannel(Comparable):
    """One channel of a device, and the sensor that is plugged into it."""

    name: str  # of the channel, for the device: "Dev1/ai0", "1"
    sensor: Sensor  # by its calibration sheet
    moving_mass: float = math.nan  # [kg], that a force acts on; NaN: the sensor measures no force
    options: TomlTable = field(default_factory=lambda: TomlTable({}))  # the driver's own keys

    def compute_scale(self) -> float:
        """Return the acceleration of one volt [m/s^2 per V]; errors as `Sensor.compute_scale`."""
        return self.sensor.compute_scale(self.moving_mass)

    def make_scale(self, step: float, input_range: float, rail: float) -> ChannelScale:
        """Return the scale of numbers that are `step` volts each.

        Parameters
        ----------
        step : float
            [V]
        input_range : float
            Largest voltage of the device's input, either sign [V].
        rail : float
            As in `ChannelScale`.
        """
        scale = self.compute_scale()
        electrical = abs(scale) * input_range
        mechanical = self.sensor.compute_full_scale(self.moving_mass)
        return ChannelScale(step * scale, min(electrical, mechanical or electrical), rail)


@dataclass(frozen=True)
class AcquisitionPlan:
    """Task of a source."""

    sampling_rate: float  # [Hz]
    record_duration: float  # [s], of one triggered record
    pre_trigger: float  # [s], part of the record before the trigger
    trigger_level: float  # [m/s^2], of the hammer, either sign
    hammer: SourceChannel
    specimen: SourceChannel | None  # None: not measured
    continuous: bool = False  # everything that comes; else one record for each arming
    block_size: int = 1000  # points per block, at most
    depth: int = 400  # blocks that may wait before the oldest are lost
    gate: SpeedGate | None = None  # None: the hammer's speed is not measured

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("sampling rate", self.sampling_rate, "Hz")
        check_positive("record duration", self.record_duration, "s")
        check_between("pre-trigger", self.pre_trigger, 0.0, self.record_duration)
        check_positive("trigger level", self.trigger_level, "m/s^2")
        if self.block_size < 1 or self.depth < 1:
            raise ParameterError(
                f"block size is {self.block_size} points, depth {self.depth} blocks: each must be"
                " 1 or more"
            )

    @property
    def channels(self) -> tuple[SourceChannel, ...]:
        """The hammer's and, where it is measured, the sample's."""
        return (self.hammer,) if self.specimen is None else (self.hammer, self.specimen)

    @property
    def inputs(self) -> tuple[SourceChannel | SpeedGate, ...]:
        """The channels and, where the hammer's speed is measured, the barrier's."""
        return self.channels if self.gate is None else (*self.channels, self.gate)

    @property
    def points(self) -> int:
        """Points of one triggered record."""
        return round(self.sampling_rate * self.record_duration)

    @property
    def pre_trigger_points(self) -> int:
        """Points of it before the trigger."""
        return round(self.sampling_rate * self.pre_trigger)


@dataclass(frozen=True)
class Acquisition:
    """Identity and actual settings of a configured source."""

    identity: str  # maker, model, serial number and address, as far as the device tells
    sampling_rate: float  # [Hz]
    is_simulated: bool = False  # its blocks that state no origin count as simulated


class AccelerationSource(Protocol):
    """Delivers the accelerometers' signals; one object for one device.

    The life of a source: `configure`, then any number of times `arm`, `read` ..., `disarm`, then
    `close`, after which it may be configured again; `check` now and then while it is not armed.
    All of it happens in one thread at a time.
    Whatever goes wrong with the device (gone, silent, in other hands, another one than expected,
    nonsense or half an answer) is a `DeviceError` whose sentence names device, what it did, and
    what would be right; nothing blocks for longer than its time-out. A library that is not
    installed may raise `ModuleNotFoundError`. After an error only `close` is called.

    A driver is a class, found by the entry point group `impact_rig.acceleration_sources` and
    called with its options: the table `[source]` of the rig file without the keys that all sources
    share. It checks them with `options.check_keys` and touches no device yet.
    """

    description: ClassVar[str]  # what the driver is for, in a few words
    # Table `[source]` of a rig file to copy, with the driver's own keys explained.
    example: ClassVar[str]
    # Whether it can read a light barrier beside the accelerometers; drivers may leave it out.
    measures_speed: ClassVar[bool] = False

    def __init__(self, options: TomlTable) -> None: ...

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the devices that can be found without touching a setting.

        Raises
        ------
        DeviceError, ModuleNotFoundError
            If the vendor's software is missing.
        """

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Open the device, see that it is the right one, and set it up.

        Raises
        ------
        DeviceError
            If it is not there, held by another program, another one, or does not obey.
        ParameterError
            If it cannot do what the plan says: channel, range, rate.
        """

    def arm(self) -> None:
        """Wait for one trigger; in continuous mode begin the stream. Points count from 0 again."""

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None if there is none within `timeout` seconds.

        Its channels are calibrated, with the device's overload flag; whose hit it is, the device
        does not know. It is as long as the device likes: the node cuts it to size. The block that
        completes a record is its `last`, after which there is none until the next `arm`; a
        continuous stream has no last one.
        """

    def disarm(self) -> None:
        """Stop, and forget what has not been read; nothing happens if it is not armed."""

    def check(self) -> None:
        """Check that the device is still there; called every second while it is not armed.

        It must change nothing and be short: arming waits for it.

        Raises
        ------
        DeviceError
            If the device is gone, or another one.
        """

    def close(self) -> None:
        """Close the device in any state; never raises, safe to call twice."""


@runtime_checkable
class HammerlessSource(AccelerationSource, Protocol):
    """A source that simulates strikes: `strike` says when one happens.

    These methods come from another thread than the others.
    """

    def take_setup(self, setup: RigSetup) -> None:
        """Take masses and samples."""

    def check_sample(self, name: str) -> None:
        """Raise `RigError` if the sample cannot be struck."""

    def strike(self, label: HitLabel, swing_time: float) -> "VirtualHit | None":
        """Simulate the release for an armed record; contact comes after `swing_time` seconds.

        Returns
        -------
        VirtualHit or None
            The truth behind what `read` will deliver; None: unknown.
        """


class HolderState(Enum):
    """State of a holder."""

    HOLDING = "holding"
    RELEASED = "released"


class HammerHolder(Protocol):
    """Holds the hammer at its release angle, and releases it: one object for one device.

    All calls come from one thread. Whatever goes wrong with the device is a `DeviceError` as with
    an `AccelerationSource`; no call takes longer than half a second. A holder never releases by
    itself: not when it is configured, not when it is closed, not after an error, as far as its
    device lets it choose.

    A driver is a class, found by the entry point group `impact_rig.hammer_holders` and called
    with the table `[holder]` of the rig file without the keys that all holders share.
    """

    description: ClassVar[str]  # what the driver is for, in a few words
    # Table `[holder]` of a rig file to copy, with the driver's own keys explained.
    example: ClassVar[str]
    # An operator releases the hammer: `release` only permits it. The time that this may take until
    # the contact is the holder's attribute `patience` [s].
    is_by_hand: ClassVar[bool]
    hammerless: ClassVar[bool]  # no hammer hangs in it: a release strikes nothing

    def __init__(self, options: TomlTable) -> None: ...

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the devices that can be found, as `AccelerationSource.find_devices`."""

    def configure(self) -> str:
        """Open the device, and hold; return what it is, as far as it tells.

        Raises
        ------
        DeviceError
            If it is not there, held by another program, or does not obey.
        """

    def hold(self) -> None:
        """Hold, or go on holding."""

    def release(self) -> None:
        """Release the hammer."""

    def read_state(self) -> HolderState:
        """Ask the device for its state; where it cannot tell, return the last commanded one.

        Raises
        ------
        DeviceError
            If it is gone, or contradicts the last command.
        """

    def close(self) -> None:
        """Close the device as it is, holding or not; never raises, safe to call twice."""


@runtime_checkable
class AngledHolder(Protocol):
    """A `HammerHolder` that can bring the hammer to a release angle."""

    def set_angle(self, angle: float) -> bool:
        """Move the held hammer towards an angle from its rest position [rad]; errors as all.

        Returns
        -------
        bool
            Whether it is there; until it is, this is called again.
        """


def take_energized_state(options: TomlTable, default: HolderState) -> HolderState:
    """Return the state of the holder when it is energized, by the key `energized`."""
    states = {"releases": HolderState.RELEASED, "holds": HolderState.HOLDING}
    usual = next(name for name, state in states.items() if state is default)
    return states[options.take_choice("energized", tuple(states), usual)]


class CommandedHolder:
    """Base of holders that remember the last commanded state.

    By itself a holder without a device, which nothing can go wrong with.
    """

    is_by_hand: ClassVar[bool] = False
    hammerless: ClassVar[bool] = False
    commanded = HolderState.HOLDING

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: there is no device."""
        return ()

    def hold(self) -> None:
        """Hold, or go on holding."""
        self.command(HolderState.HOLDING)

    def release(self) -> None:
        """Release the hammer."""
        self.command(HolderState.RELEASED)

    def command(self, state: HolderState) -> None:
        """Bring the device into a state; raises `DeviceError` if it does not obey."""
        self.commanded = state

    def read_state(self) -> HolderState:
        """Return the last commanded state."""
        return self.commanded

    def close(self) -> None:
        """Do nothing: there is no device."""
