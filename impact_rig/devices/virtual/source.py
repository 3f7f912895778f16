"""The virtual rig as a source of accelerations: a driver like any other, without a device."""

import time
from dataclasses import replace
from typing import ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.acceleration_source import (
    AcquiredBlock,
    Acquisition,
    AcquisitionPlan,
    SourceChannel,
)
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.devices.virtual.streaming_digitizer import StreamingDigitizer
from impact_rig.devices.virtual.triggered_digitizer import TriggeredDigitizer

IDENTITY = "virtual rig"
DEFAULT_SETTINGS = VirtualRigSettings()
TRIGGER_LEVEL = 0.02
"""Part of the hammer's full scale that would trigger [-], our choice; the simulation knows when a
hit comes."""


class VirtualSource:
    """Simulates what the accelerometers see of each release, triggered or in a running stream.

    Parameters
    ----------
    options : TomlTable
        None: how the virtual rig behaves is said elsewhere, in the table [virtual].
    settings : VirtualRigSettings
        Of rig, digitizer and faults; what a plan says of the digitizer goes before.

    Raises
    ------
    ParameterError
        If there are options.
    """

    description: ClassVar[str] = "the virtual rig: hits are simulated, no device is needed"
    example: ClassVar[str] = '[source]\ndriver = "virtual"  # how it behaves: see [virtual]\n'

    def __init__(
        self, options: TomlTable, settings: VirtualRigSettings = DEFAULT_SETTINGS
    ) -> None:
        for key in options:
            raise options.make_error(
                key,
                f"{options.place} has a key {key!r}, which the virtual rig does not know: how it"
                " behaves is said in [virtual]",
            )
        self._settings = settings
        self._setup: RigSetup | None = None
        self._rig: VirtualRig | None = None
        self._digitizer: TriggeredDigitizer | StreamingDigitizer | None = None
        self._has_specimen = True

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the one that is always there."""
        return (FoundDevice("virtual", IDENTITY),)

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Make the digitizer that the plan describes.

        Raises
        ------
        ParameterError
            If the record is too short.
        """
        self._settings = replace(
            self._settings, digitizer=_follow_plan(self._settings.digitizer, plan)
        )
        self._has_specimen = plan.specimen is not None
        self._digitizer = (
            StreamingDigitizer(self._settings, plan.block_size, plan.depth)
            if plan.continuous
            else TriggeredDigitizer(plan.block_size)
        )
        self._make_rig()
        return Acquisition(IDENTITY, plan.sampling_rate)

    def arm(self) -> None:
        """Wait for one hit; in continuous mode begin the stream."""
        self._get_digitizer().arm()

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block; None if there is none within `timeout` seconds."""
        block = self._get_digitizer().read(timeout)
        if block is None or self._has_specimen:
            return block
        return replace(block, specimen=replace(block.specimen, output=block.specimen.output[:0]))

    def disarm(self) -> None:
        """Stop, and forget what has not been read."""
        if self._digitizer is not None:
            self._digitizer.disarm()

    def check(self) -> None:
        """See that it is configured; raises `DeviceError`."""
        self._get_digitizer()

    def close(self) -> None:
        """Let the digitizer go."""
        self._digitizer = None

    def take_setup(self, setup: RigSetup) -> None:
        """Take masses and samples."""
        self._setup = setup
        self._make_rig()

    def check_sample(self, name: str) -> None:
        """Raise `RigError` if the sample is unknown or lacks a reference value."""
        self._get_rig().check_sample(name)

    def strike(self, label: HitLabel, swing_time: float) -> VirtualHit:
        """Simulate the hit while the hammer swings; it comes when the swing is over.

        Raises
        ------
        RigError
            If no set-up has been taken, or the sample cannot be struck.
        """
        contact = time.monotonic() + swing_time
        hit = self._get_rig().strike(label)
        self._get_digitizer().lay(hit, contact)
        return hit

    def _make_rig(self) -> None:
        if self._setup is not None:
            self._rig = VirtualRig(self._setup, self._settings)

    def _get_rig(self) -> VirtualRig:
        if self._rig is None:
            raise DeviceError("the virtual rig has no set-up: start the campaign node first")
        return self._rig

    def _get_digitizer(self) -> TriggeredDigitizer | StreamingDigitizer:
        if self._digitizer is None:
            raise DeviceError("the virtual rig is closed: configure it first")
        return self._digitizer


def make_virtual_plan(
    digitizer: DigitizerSettings, *, continuous: bool, block_size: int, depth: int
) -> AcquisitionPlan:
    """Return the plan that asks of the virtual rig what its settings say.

    Parameters
    ----------
    digitizer : DigitizerSettings
        Rate, record and full scales.
    continuous : bool
        Without a trigger.
    block_size, depth : int
        As in `AcquisitionPlan`.
    """
    scales = {"hammer": digitizer.hammer_full_scale, "specimen": digitizer.specimen_full_scale}
    hammer, specimen = (
        SourceChannel(name, Sensor(name, full_scale=scale)) for name, scale in scales.items()
    )
    return AcquisitionPlan(
        sampling_rate=digitizer.sampling_rate,
        record_duration=digitizer.record_duration,
        pre_trigger=digitizer.pre_trigger,
        trigger_level=TRIGGER_LEVEL * digitizer.hammer_full_scale,
        hammer=hammer,
        specimen=specimen,
        continuous=continuous,
        block_size=block_size,
        depth=depth,
    )


def _follow_plan(digitizer: DigitizerSettings, plan: AcquisitionPlan) -> DigitizerSettings:
    hammer = plan.hammer.sensor.find_full_scale(plan.hammer.moving_mass)
    specimen = plan.specimen.sensor.find_full_scale() if plan.specimen else 0.0
    return replace(
        digitizer,
        sampling_rate=plan.sampling_rate,
        record_duration=plan.record_duration,
        pre_trigger=plan.pre_trigger,
        hammer_full_scale=hammer or digitizer.hammer_full_scale,
        specimen_full_scale=specimen or digitizer.specimen_full_scale,
    )
