"""PortAudio: which inputs there are, and what its errors mean."""

from dataclasses import dataclass
from typing import Any

from impact_rig.core.errors import DeviceError

NO_SUCH_CHANNELS = -9998
NO_SUCH_RATE = -9997
"""Codes of PortAudio's errors that a setting is to blame for."""

_streams: set[Any] = set()
"""Those of this process that are open: PortAudio looks for devices only while there is none."""


@dataclass(frozen=True)
class SoundInput:
    """A device that records.

    Attributes
    ----------
    number : int
        By which PortAudio knows it, until devices come or go.
    name, interface : str
        Of the device, and of what reaches it: "ALSA", "Core Audio", "Windows WASAPI".
    channels : int
        That it has at most.
    sampling_rate : float
        That it prefers [Hz].
    """

    number: int
    name: str
    interface: str
    channels: int
    sampling_rate: float

    @property
    def full_name(self) -> str:
        """Name and interface."""
        return f"{self.name}, {self.interface}"


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


def list_inputs() -> tuple[SoundInput, ...]:
    """Return all devices that record, those that were plugged in just now, too.

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
        return tuple(
            SoundInput(
                device["index"],
                device["name"],
                interfaces[device["hostapi"]]["name"],
                device["max_input_channels"],
                device["default_samplerate"],
            )
            for device in sound.query_devices()
            if device["max_input_channels"] > 0
        )
    except sound.PortAudioError as error:
        raise DeviceError(f"PortAudio cannot look for sound devices: {tell(error)}") from None


def open_stream(**settings: Any) -> Any:
    """Open a stream that records, as `sounddevice.RawInputStream`, and start it.

    Raises
    ------
    sounddevice.PortAudioError
        If that fails.
    """
    stream = load_port_audio().RawInputStream(**settings)
    _streams.add(stream)
    try:
        stream.start()
    except BaseException:
        close_stream(stream)
        raise
    return stream


def close_stream(stream: Any) -> None:
    """Close a stream, whatever state it is in."""
    stream.close(ignore_errors=True)
    _streams.discard(stream)


def tell(error: Exception) -> str:
    """Return what an error of PortAudio says, in one line."""
    return " ".join(str(error.args[0]).split()).rstrip(".")
