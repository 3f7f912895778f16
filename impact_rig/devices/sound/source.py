"""The driver `sound`: accelerometers at a sound card, or that are one by USB."""

from collections.abc import Sequence
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.sound.calibration import find_count_scale
from impact_rig.devices.sound.capture import SoundCapture
from impact_rig.devices.sound.name_calibration import find_name_calibrations
from impact_rig.devices.sound.port_audio import SoundInput, list_inputs
from impact_rig.devices.streaming.source import StreamedSource, Streaming


class SoundSource(StreamedSource):
    """Records a sound card all the time, and cuts the hits out of what it delivers."""

    description: ClassVar[str] = "sound cards and USB accelerometers that look like one"
    example: ClassVar[str] = """\
[source]
driver = "sound"
device = "USB Audio"         # a part of its name, or its number; impact-rig devices lists them
sampling_rate = "192 kHz"
record_duration = "20 ms"

[source.hammer]
channel = 1                  # counted from 1: the left one
sensitivity = "10 mV/g"
input_range = "1.4 V"        # voltage of the largest count
full_scale = "500 g"

[source.specimen]
channel = 2
full_scale = "500 g"         # without a sensitivity: acceleration of the largest count
"""

    def __init__(self, options: TomlTable) -> None:
        super().__init__()
        options.check_keys("device")
        self._options = options
        self._device = _take_device(options)

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return all devices that record.

        Raises
        ------
        DeviceError, ModuleNotFoundError
            If PortAudio or `sounddevice` is missing.
        """
        return tuple(
            FoundDevice(
                device.name,
                f"{device.interface}, {device.channels} inputs, {device.sampling_rate:g} Hz",
            )
            for device in list_inputs()
        )

    def open_device(self, plan: AcquisitionPlan, capacity: int) -> Streaming:
        """Open the sound card, and begin to record.

        Raises
        ------
        DeviceError
            If it is not there, or another program has it.
        ParameterError
            If it has no such channel or rate, or nobody says what its counts stand for.
        """
        device = self._choose(list_inputs())
        channels = [plan.hammer] if plan.specimen is None else [plan.hammer, plan.specimen]
        columns = [_find_column(channel, device) for channel in channels]
        known = dict(enumerate(find_name_calibrations(device.name)))
        scales = tuple(
            find_count_scale(channel, known.get(column))
            for channel, column in zip(channels, columns, strict=True)
        )
        return Streaming(SoundCapture(device, plan.sampling_rate, columns, capacity), scales)

    def _choose(self, inputs: Sequence[SoundInput]) -> SoundInput:
        wanted = self._device
        found = [
            device for device in inputs if wanted in (device.number, device.name, device.full_name)
        ] or [
            device
            for device in inputs
            if isinstance(wanted, str) and wanted.lower() in device.full_name.lower()
        ]
        if len(found) == 1:
            return found[0]
        names = ", ".join(repr(device.full_name) for device in found or inputs)
        if found:
            text = f"device {wanted!r} may be each of {names}: name one of them"
        else:
            text = f"there is no sound device {wanted!r}: this computer has {names or 'none'}"
        raise DeviceError(str(self._options.make_error("device", text)))


def _take_device(options: TomlTable) -> str | int:
    value = options.get("device")
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    name = options.take_text("device", REQUIRED, "USB Audio")
    if not name.strip():
        raise options.refuse("device", "a part of its name in quotes, or its number")
    return name


def _find_column(channel: SourceChannel, device: SoundInput) -> int:
    """Return which of a device's channels is meant, counted from 0."""
    number = int(channel.name) if channel.name.isdecimal() else 0
    if not 1 <= number <= device.channels:
        raise channel.options.make_error(
            "channel",
            f"channel of {channel.options.place} is {channel.name!r}: sound device"
            f" {device.full_name} has 1 to {device.channels}",
        )
    return number - 1
