"""USB relay boards at a serial port: the driver `serial`."""

import contextlib
import termios
from collections.abc import Iterator
from typing import Any, ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import (
    CommandedHolder,
    FoundDevice,
    HolderState,
    take_energized_state,
)

START = 0xA0  # first byte of a frame of the four-byte protocol
OFF, ON = 0, 1  # its operations
MOST_RELAYS = 16  # on one board
SENDING_TIMEOUT = 0.1  # [s]


def make_frame(channel: int, operation: int) -> bytes:
    """Return a frame of the four-byte protocol, which the common USB relay boards speak."""
    return bytes((START, channel, operation, (START + channel + operation) & 0xFF))


class SerialRelay(CommandedHolder):
    """Switches a relay by a serial port.

    The relay is not asked what it does: it counts as obeying as long as its port is there. A board
    that is unplugged drops its relay: wire the magnet through the contact that is closed then, so
    that it goes on holding (`energized = "releases"`).

    Parameters
    ----------
    options : TomlTable
        port, channel, energized, baud_rate.

    Raises
    ------
    ParameterError
        If a key is missing or unknown, or its value cannot be meant.
    """

    description: ClassVar[str] = "a relay on a serial port"
    example: ClassVar[str] = read_example("serial_holder")

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("port", "channel", "energized", "baud_rate")
        channel = options.take_whole("channel", 1, MOST_RELAYS, 1)
        when_on = take_energized_state(options, HolderState.RELEASED)
        self._frames = {
            state: make_frame(channel, ON if state is when_on else OFF) for state in HolderState
        }
        self._path = options.take_text("port", REQUIRED, "/dev/ttyUSB0")
        self._baud_rate = options.take_whole("baud_rate", 300, 4_000_000, 9600)
        self._port: Any = None

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the serial ports of USB devices: there may be a relay at any."""
        from serial.tools.list_ports import comports

        return tuple(
            FoundDevice(
                port.device,
                " ".join(filter(None, (port.manufacturer, port.product, port.serial_number))),
            )
            for port in comports()
            if port.vid is not None
        )

    def configure(self) -> str:
        """Open the port, and hold."""
        from serial import Serial

        try:
            self._port = Serial(
                self._path, self._baud_rate, write_timeout=SENDING_TIMEOUT, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:
            raise DeviceError(
                f"the serial port {self._path} cannot be opened ({error}): plug the relay in, end"
                " other programs that use it, and add this user to the group that owns the port,"
                " often dialout"
            ) from None
        self.hold()
        return f"relay at {self._path}"

    def read_state(self) -> HolderState:
        """Return the last commanded state, if the port is there."""
        with self._report_loss():
            _ = self._port.in_waiting
        return self.commanded

    def close(self) -> None:
        """Close the port, and leave the relay as it is."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError, termios.error):
                port.close()

    def command(self, state: HolderState) -> None:
        """Switch the relay; raises `DeviceError` if its port is gone."""
        with self._report_loss():
            self._port.write(self._frames[state])
        self.commanded = state

    @contextlib.contextmanager
    def _report_loss(self) -> Iterator[None]:
        try:
            yield
        except (OSError, termios.error) as error:
            raise DeviceError(
                f"the relay at {self._path} is gone ({error}): check its cable and plug it in"
            ) from None
