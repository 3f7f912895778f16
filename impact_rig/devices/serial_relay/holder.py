"""A relay on a serial port, which switches an electromagnet or a latch."""

import os
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.hammer_holder import HolderState
from impact_rig.devices.serial_relay.port import RelayPort, find_serial_library
from impact_rig.devices.serial_relay.protocols import (
    RelayProtocol,
    read_four_byte_protocol,
    read_text_protocol,
)

FOUR_BYTE, TEXT = "four-byte", "text"
PORT_KEYS = ("port", "baud_rate", "protocol")
PROTOCOL_KEYS = {
    FOUR_BYTE: ("channel", "energized", "answers"),
    TEXT: (
        "hold_command", "release_command", "answer", "query_command", "holding_answer",
        "released_answer", "line_end",
    ),
}  # fmt: skip
FASTEST_BAUD_RATE = 4_000_000
"""Of serial ports on sale [bit/s]."""


class SerialRelay:
    """Switches a relay by a serial port.

    A board that is unplugged drops its relay: wire the magnet through the contact that is closed
    then, so that it goes on holding (`energized = "releases"`). A relay that does not answer
    counts as obeying as long as its port is there.

    Parameters
    ----------
    options : TomlTable
        `PORT_KEYS`, and those of `PROTOCOL_KEYS` of its protocol.

    Raises
    ------
    ParameterError
        If a key is missing or unknown, or its value cannot be meant.
    """

    description: ClassVar[str] = "a relay on a serial port"
    example: ClassVar[str] = """\
[holder]
driver = "serial"
port = "/dev/ttyUSB0"       # better: a name below /dev/serial/by-id, which stays
protocol = "four-byte"      # of the common USB relay boards; or "text", see below
channel = 1                 # relay on the board
energized = "releases"      # or "holds": what the relay does while it is on
answers = false             # true: the board answers commands and queries
baud_rate = 9600
# protocol = "text"         # lines that a board of your own understands
# hold_command = "HOLD"
# release_command = "RELEASE"
# answer = "OK"             # to both; leave it out where there is none
# query_command = "STATE?"  # with what it may answer; leave all three out where there is none
# holding_answer = "HOLDING"
# released_answer = "RELEASED"
# line_end = "\\n"
"""
    is_by_hand: ClassVar[bool] = False

    def __init__(self, options: TomlTable) -> None:
        name = options.take_choice("protocol", (FOUR_BYTE, TEXT), FOUR_BYTE)
        options.check_keys(*PORT_KEYS, *PROTOCOL_KEYS[name])
        self._path = options.take_text("port", REQUIRED, "/dev/ttyUSB0")
        self._baud_rate = options.take_whole("baud_rate", 300, FASTEST_BAUD_RATE, 9600)
        read = read_four_byte_protocol if name == FOUR_BYTE else read_text_protocol
        self._protocol: RelayProtocol = read(options)
        self._port: RelayPort | None = None
        self._told = HolderState.HOLDING

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the serial ports of USB devices: there may be a relay at any."""
        ports = find_serial_library().tools.list_ports.comports()
        return tuple(
            FoundDevice(
                port.device,
                " ".join(filter(None, (port.manufacturer, port.product, port.serial_number))),
            )
            for port in ports
            if port.vid is not None
        )

    def configure(self) -> str:
        """Open the port, hold, and ask the relay where it can be asked."""
        self.close()
        self._port = RelayPort(self._path, self._baud_rate)
        try:
            self.hold()
            self.read_state()
        except DeviceError:
            self.close()
            raise
        return f"relay at {self._path}{self._describe_adapter()}"

    def hold(self) -> None:
        """Switch the relay so that it holds."""
        self._command(HolderState.HOLDING)

    def release(self) -> None:
        """Switch the relay so that it lets go."""
        self._command(HolderState.RELEASED)

    def read_state(self) -> HolderState:
        """Ask the relay; where it cannot be asked, see that its port is there."""
        port = self._find_port()
        if self._protocol.query is None:
            port.check()
            return self._told
        self._compare(port.send(self._protocol.query, self._protocol.line_end))
        return self._told

    def close(self) -> None:
        """Let the port go, and leave the relay as it is."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _command(self, state: HolderState) -> None:
        exchange = self._protocol.hold if state is HolderState.HOLDING else self._protocol.release
        answered = self._find_port().send(exchange, self._protocol.line_end)
        self._told = state
        if answered is not None:
            self._compare(answered)

    def _compare(self, answered: HolderState) -> None:
        if answered is not self._told:
            raise DeviceError(
                f"the relay at {self._path} says that it is {answered.value}, though it was told"
                f" to be {self._told.value}: look at its supply and its jumpers"
            )

    def _find_port(self) -> RelayPort:
        if self._port is None:
            raise DeviceError(f"the relay at {self._path} is not open: configure it first")
        return self._port

    def _describe_adapter(self) -> str:
        """Return what is known of the USB device behind the port."""
        target = os.path.realpath(self._path)
        found = [item for item in self.find_devices() if os.path.realpath(item.address) == target]
        return f" ({found[0].identity})" if found and found[0].identity else ""
