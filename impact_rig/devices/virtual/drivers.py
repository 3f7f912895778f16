"""The virtual rig as a source and a holder: drivers like any other, without a device."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from typing import Any, ClassVar, TypeVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import RigSetup
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import (
    Acquisition,
    AcquisitionPlan,
    CommandedHolder,
    FoundDevice,
    SourceChannel,
)
from impact_rig.devices.virtual.choices import IDENTITY, Fault, Plant
from impact_rig.devices.virtual.delivery import StreamingDigitizer, TriggeredDigitizer
from impact_rig.devices.virtual.rig import (
    DigitizerSettings,
    FaultPlan,
    VirtualHit,
    VirtualRig,
    VirtualRigSettings,
    fault_from_name,
    scheduled_fault_from_text,
)

T = TypeVar("T")
LARGEST_SEED = 2**62
QUANTITIES = {
    "sampling_rate": ("Hz", "2.5 MHz"),
    "record_duration": ("s", "2 ms"),
    "pre_trigger": ("s", "200 us"),
    "hammer_full_scale": ("m/s^2", "2000 m/s^2"),
    "specimen_full_scale": ("m/s^2", "4000 m/s^2"),
}
NUMBERS = ("contact_time_scatter", "amplitude_scatter", "contact_exponent", "restitution")
KEYS = (
    *QUANTITIES, *NUMBERS, "noise", "bits", "plant", "seed", "draw", "fault_probability",
    "faults", "scheduled_faults",
)  # fmt: skip
"""Keys of the table [source]."""
TRIGGER_LEVEL = 0.02  # part of the hammer's full scale


class VirtualSource:
    """Simulates what the accelerometers see of each release, triggered or in a running stream.

    Parameters
    ----------
    options : TomlTable
        Plant, scatter, faults and digitizer, see `read_virtual_rig`.

    Raises
    ------
    ParameterError
        If there is an unknown key, or a value cannot be meant.
    """

    description: ClassVar[str] = "the virtual rig: hits are simulated, no device is needed"
    example: ClassVar[str] = read_example("virtual_source")
    measures_speed: ClassVar[bool] = True

    def __init__(self, options: TomlTable) -> None:
        options.check_keys(*KEYS)
        self._settings = read_virtual_rig(options)
        self._setup: RigSetup | None = None
        self._rig: VirtualRig | None = None  # of that set-up
        self._digitizer: TriggeredDigitizer | StreamingDigitizer

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the one that is always there."""
        return (FoundDevice("virtual", IDENTITY),)

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Make the digitizer that the plan describes; its scales are the driver's own keys.

        Raises
        ------
        ParameterError
            If the record is too short.
        """
        self._settings = self.choose_settings(plan)
        self._digitizer = TriggeredDigitizer(plan.block_size)
        if plan.continuous:
            self._digitizer = StreamingDigitizer(self._settings, plan.block_size, plan.depth)
        self._rig = None
        # What the first hit needs, which then waits for it no more.
        is_law = self._settings.plant is Plant.CONTACT
        import_module("scipy.integrate" if is_law else "scipy.optimize")
        return Acquisition(IDENTITY, plan.sampling_rate, is_simulated=True)

    def choose_settings(self, plan: AcquisitionPlan) -> VirtualRigSettings:
        """Return what the virtual rig is under a plan; raises as `configure`."""
        digitizer = replace(
            self._settings.digitizer,
            sampling_rate=plan.sampling_rate,
            record_duration=plan.record_duration,
            pre_trigger=plan.pre_trigger,
        )
        return replace(self._settings, digitizer=digitizer, gate=plan.gate)

    def arm(self) -> None:
        """Wait for one hit; in continuous mode begin the stream."""
        self._digitizer.arm()

    def read(self, timeout: float) -> Block | None:
        """Return the next block; None if there is none within `timeout` seconds."""
        return self._digitizer.read(timeout)

    def disarm(self) -> None:
        """Stop, and forget what has not been read."""
        self._digitizer.disarm()

    def check(self) -> None:
        """Do nothing: it is always there."""

    def close(self) -> None:
        """Do nothing: there is no device."""

    def take_setup(self, setup: RigSetup) -> None:
        """Take masses and samples."""
        self._setup, self._rig = setup, None

    def check_sample(self, name: str) -> None:
        """Raise `RigError` if the sample is unknown or lacks a reference value."""
        self._make_rig().check_sample(name)

    def strike(self, label: HitLabel, swing_time: float) -> VirtualHit:
        """Simulate the hit while the hammer swings; it comes when the swing is over.

        Raises
        ------
        RigError
            If no set-up has been taken, or the sample cannot be struck.
        """
        contact = time.monotonic() + swing_time
        hit = self._make_rig().strike(label)
        self._digitizer.lay_hit(hit, contact)
        return hit

    def _make_rig(self) -> VirtualRig:
        if self._setup is None:
            raise DeviceError("the virtual rig has no set-up: start the campaign node first")
        if self._rig is None:
            # A running stream has one range.
            is_ranged = isinstance(self._digitizer, TriggeredDigitizer)
            self._rig = VirtualRig(self._setup, self._settings, is_ranged=is_ranged)
        return self._rig


def read_virtual_rig(table: TomlTable) -> VirtualRigSettings:
    """Return the virtual rig's settings in a table [source], with defaults for what is missing.

    Raises
    ------
    ParameterError
        If a value cannot be meant; the message names its line.
    """
    rig = VirtualRigSettings()
    plants = {plant.value: plant for plant in Plant}
    faults = FaultPlan(
        probability=table.take_number("fault_probability", 0.0, 1.0, 0.0),
        faults=tuple(_take_each(table, "faults", fault_from_name)) or tuple(Fault),
        scheduled=tuple(_take_each(table, "scheduled_faults", scheduled_fault_from_text)),
    )
    plant = plants[table.take_choice("plant", tuple(plants), rig.plant.value)]
    seed = table.take_whole("seed", 0, LARGEST_SEED, rig.seed)
    numbers: dict[str, Any] = {
        key: table.take_number(key, default=getattr(rig, key)) for key in NUMBERS
    }
    digitizer = read_digitizer(table)
    with table.locating():
        return VirtualRigSettings(
            plant,
            seed,
            **numbers,
            digitizer=digitizer,
            faults=faults,
            draws=table.take_boolean("draw"),
        )


def read_digitizer(table: TomlTable) -> DigitizerSettings:
    """Return the virtual digitizer's settings in a table; errors as `read_virtual_rig`."""
    default = DigitizerSettings()
    quantities = {
        key: table.take_quantity(key, unit, example, getattr(default, key))
        for key, (unit, example) in QUANTITIES.items()
    }
    noise = table.take_number("noise", default=default.noise)
    bits = table.take_whole("bits", 4, 31, default.bits)
    with table.locating():
        return DigitizerSettings(**quantities, noise=noise, bits=bits)


def _take_each(table: TomlTable, key: str, parse: Callable[[str], T]) -> Iterator[T]:
    """Parse the items of a list with commas."""
    for name in table.take_text(key).split(","):
        if name.strip():
            with table.locating(key):
                yield parse(name.strip())


def make_virtual_plan(table: TomlTable) -> AcquisitionPlan:
    """Return the plan of a simulated source from its table [source].

    Rate, record and full scales have defaults.

    Raises
    ------
    ParameterError
        If a value cannot be meant; the message names its line.
    """
    digitizer = read_digitizer(table)
    scales = digitizer.hammer_full_scale, digitizer.specimen_full_scale
    hammer, specimen = (
        SourceChannel(name, Sensor(name, full_scale=scale))
        for name, scale in zip(CHANNELS, scales, strict=True)
    )
    return AcquisitionPlan(
        sampling_rate=digitizer.sampling_rate,
        record_duration=digitizer.record_duration,
        pre_trigger=digitizer.pre_trigger,
        trigger_level=TRIGGER_LEVEL * digitizer.hammer_full_scale,
        hammer=hammer,
        specimen=specimen,
    )


class VirtualHolder(CommandedHolder):
    """Holds the virtual rig's hammer.

    Parameters
    ----------
    options : TomlTable
        Has no keys.

    Raises
    ------
    ParameterError
        If it has any.
    """

    hammerless: ClassVar[bool] = True
    description: ClassVar[str] = "the virtual rig's holder"
    example: ClassVar[str] = '[holder]\ndriver = "virtual"\n'

    def __init__(self, options: TomlTable) -> None:
        options.check_keys()

    def configure(self) -> str:
        """Hold."""
        self.hold()
        return IDENTITY

    def set_angle(self, angle: float) -> bool:
        """Return that the hammer is there."""
        return True
