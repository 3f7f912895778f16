"""Sound cards and USB digitizers with IEPE inputs that appear as such: the driver `sound`."""

import math
import time
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import AcquisitionPlan, ChannelScale, FoundDevice, SourceChannel
from impact_rig.devices.speed_gate import SpeedGate
from impact_rig.devices.streaming import StreamedSource

FULL_COUNT = 2**31
"""Counts of PortAudio at full scale [-]: fewer bits stand at the upper end of its 32."""
RAIL_COUNT = FULL_COUNT - 2**16
"""From here on a channel is overloaded [-]: the largest count of a converter of 16 bits, which is
3e-5 below full scale; those of more bits reach it, too."""


def compute_count_scale(channel: SourceChannel) -> ChannelScale:
    """Return the acceleration of a channel's counts.

    A sensor with a sensitivity gives a voltage, and its channel needs the voltage at full scale,
    `input_range`. One without gives its acceleration, and `full_scale` is that at the largest
    count.

    Raises
    ------
    ParameterError
        If neither is given.
    """
    options, sensor = channel.options, channel.sensor
    options.check_keys("input_range")
    if not math.isnan(sensor.sensitivity):
        voltage = options.take_quantity("input_range", "V", "1.4 V", low=1e-6, high=1e6)
        return channel.make_scale(voltage / FULL_COUNT, voltage, RAIL_COUNT)
    full_scale = sensor.compute_full_scale(channel.moving_mass)
    if not full_scale:
        raise options.make_error(
            "full_scale",
            f"{options.place} lacks sensitivity or full_scale: give"
            ' sensitivity = "10 mV/g" and input_range = "1.4 V" for a sensor at a sound card, or'
            ' full_scale = "20 g", the acceleration of the largest count',
        )
    return ChannelScale(full_scale / FULL_COUNT, full_scale, RAIL_COUNT)


_streams: set[Any] = set()
"""Those of this process that are open: PortAudio looks for devices only while there is none."""


def load_port_audio() -> Any:
    """Return the module `sounddevice`.

    Raises
    ------
    DeviceError
        If PortAudio itself is not installed.
    ModuleNotFoundError
        If the Python package is not installed.
    """
    try:
        import sounddevice
    except OSError:
        raise DeviceError(
            "the driver 'sound' needs the library PortAudio, which is not installed: on Debian and"
            " Ubuntu it is the package libportaudio2"
        ) from None
    return sounddevice


def list_inputs() -> list[dict[str, Any]]:
    """Return PortAudio's description of each device that records, with its `full_name`.

    Raises
    ------
    DeviceError, ModuleNotFoundError
        As `load_port_audio`, or if PortAudio cannot look for them.
    """
    sound = load_port_audio()
    try:
        if not _streams:
            # It looks for devices when it begins, and never again.
            if sound._initialized:  # noqa: SLF001
                sound._terminate()  # noqa: SLF001
            sound._initialize()  # noqa: SLF001
        interfaces = sound.query_hostapis()
        devices = [item for item in sound.query_devices() if item["max_input_channels"] > 0]
    except sound.PortAudioError as error:
        raise DeviceError(f"PortAudio cannot look for sound devices: {describe(error)}") from None
    for device in devices:
        device["full_name"] = f"{device['name']}, {interfaces[device['hostapi']]['name']}"
    return devices


def describe(error: Exception) -> str:
    """Return the text of an error of PortAudio, in one line."""
    return " ".join(str(error.args[0]).split()).rstrip(".")


class SoundSource(StreamedSource):
    """Records a sound card all the time, and cuts the hits out of what it delivers.

    Points that PortAudio reports as lost are a gap, whose length it does not tell: it is estimated
    from the time of the blocks.
    """

    description: ClassVar[str] = "sound cards and USB accelerometers that look like one"
    measures_speed: ClassVar[bool] = True
    example: ClassVar[str] = read_example("sound_source")

    def __init__(self, options: TomlTable) -> None:
        super().__init__()
        options.check_keys("device")
        self.gate_unit = 2.0**31
        self._options = options
        self._device = options.take_text("device", REQUIRED, "USB Audio")
        self._stream: Any = None
        self._columns: list[int] = []  # of the channels, counted from 0
        self._last_block = (0.0, 0)  # block: time of its first point [s], by PortAudio; points

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return all devices that record; errors as `list_inputs`."""
        return tuple(
            FoundDevice(
                device["name"],
                f"{device['full_name']}, {device['max_input_channels']} inputs,"
                f" {device['default_samplerate']:g} Hz",
            )
            for device in list_inputs()
        )

    def open_device(self, plan: AcquisitionPlan) -> None:
        """Open the sound card, and begin to record.

        Raises
        ------
        DeviceError
            If it is not there, has no such rate, or another program has it.
        ParameterError
            If it has no such channel, or the scale of its counts is unknown.
        """
        device = self._choose(list_inputs())
        self._columns = [_parse_column(channel, device) for channel in plan.inputs]
        self.scales = tuple(map(compute_count_scale, plan.channels))
        self.name = f"sound device {device['full_name']}"
        self.sampling_rate = plan.sampling_rate
        sound, channels = load_port_audio(), max(self._columns) + 1
        try:
            self._stream = sound.RawInputStream(
                device=device["index"],
                samplerate=plan.sampling_rate,
                channels=channels,
                dtype="int32",
                callback=self.take_block,
                finished_callback=lambda: self.end("it has stopped"),
            )
            _streams.add(self._stream)
            self._last_block = (0.0, 0)
            self.sampling_rate = float(self._stream.samplerate)
            self._stream.start()
        except sound.PortAudioError as error:
            raise DeviceError(
                f"{self.name} does not record {channels} channels at {plan.sampling_rate:g} Hz:"
                f" {describe(error)}; it prefers {device['default_samplerate']:g} Hz, and no other"
                " program may have it"
            ) from None

    def close(self) -> None:
        """Stop recording, whatever state the stream is in."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close(ignore_errors=True)
            _streams.discard(stream)

    def take_block(self, data: Any, frames: int, times: Any, status: Any) -> None:
        """Take what has come; called by PortAudio's own thread."""
        counts = np.frombuffer(data, np.int32).reshape(frames, -1)[:, self._columns]
        taken = float(times.inputBufferAdcTime)  # 0: some interfaces do not tell it
        before, points = self._last_block
        lost = 0
        if status.input_overflow:
            missing = round((taken - before) * self.sampling_rate) - points
            lost = max(missing, 1) if taken and before else 1
        self._last_block = (taken, frames)
        age = float(times.currentTime) - taken if taken else 0.0
        self.take(counts, round((time.time() - age) * 1e9), lost)

    def _choose(self, inputs: Sequence[dict[str, Any]]) -> dict[str, Any]:
        wanted = self._device
        found = [item for item in inputs if wanted in (item["name"], item["full_name"])] or [
            item for item in inputs if wanted.lower() in item["full_name"].lower()
        ]
        if len(found) == 1:
            return found[0]
        names = ", ".join(repr(device["full_name"]) for device in found or inputs)
        if found:
            text = f"device {wanted!r} may be each of {names}: name one of them"
        else:
            text = f"there is no sound device {wanted!r}: this computer has {names or 'none'}"
        raise DeviceError(str(self._options.make_error("device", text)))


def _parse_column(channel: SourceChannel | SpeedGate, device: dict[str, Any]) -> int:
    """Return the number of a channel, counted from 0."""
    number = int(channel.name) if channel.name.isdecimal() else 0
    if not 1 <= number <= device["max_input_channels"]:
        raise channel.options.make_error(
            "channel",
            f"channel of {channel.options.place} is {channel.name!r}: sound device"
            f" {device['full_name']} has 1 to {device['max_input_channels']}",
        )
    return number - 1
