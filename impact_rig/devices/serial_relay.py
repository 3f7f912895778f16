"""USB relay boards and micro-controllers at a serial port: the driver `serial`."""

import contextlib
import errno
import os
import termios
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.protocols import (
    FoundDevice,
    HolderState,
    ToldHolder,
    take_energized_state,
)

START = 0xA0
"""First byte of every frame of the four-byte protocol, which the common USB relay boards speak:
start, channel, operation, and the sum of the three."""
OFF, ON = 0, 1
OFF_AND_ANSWER, ON_AND_ANSWER, QUERY = 2, 3, 5
"""Operations. The answer is a frame with `OFF` or `ON`; simple boards know the first two alone."""
FRAME_SIZE = 4
"""Of the four-byte protocol [byte]."""
LONGEST_CHANNEL = 16
"""Most relays on one board that speaks it [-]: those on sale have 1 to 16."""


@dataclass(frozen=True)
class Exchange:
    """A request, and what may come back.

    Attributes
    ----------
    request : bytes
        To be sent.
    answers : mapping
        What the relay may answer, and what it does then; empty: it does not answer.
    """

    request: bytes
    answers: Mapping[bytes, HolderState] = field(default_factory=dict)


@dataclass(frozen=True)
class RelayProtocol:
    """How one relay is spoken to.

    Attributes
    ----------
    hold, release : Exchange
        Its commands.
    query : Exchange or None
        What it does; None: it cannot be asked.
    line_end : bytes
        Ends every answer; empty: answers have `FRAME_SIZE` bytes.
    """

    hold: Exchange
    release: Exchange
    query: Exchange | None = None
    line_end: bytes = b""


def make_frame(channel: int, operation: int) -> bytes:
    """Return a frame of the four-byte protocol."""
    return bytes((START, channel, operation, (START + channel + operation) & 0xFF))


def read_four_byte_protocol(options: TomlTable) -> RelayProtocol:
    """Return the protocol of the common USB relay boards.

    Parameters
    ----------
    options : TomlTable
        `channel`, `energized`, `answers`.

    Raises
    ------
    ParameterError
        If a value cannot be meant.
    """
    channel = options.take_whole("channel", 1, LONGEST_CHANNEL, 1)
    holds_on = take_energized_state(options, HolderState.RELEASED) is HolderState.HOLDING
    hold, release = (ON, OFF) if holds_on else (OFF, ON)
    if not options.take_boolean("answers"):
        return RelayProtocol(
            Exchange(make_frame(channel, hold)), Exchange(make_frame(channel, release))
        )
    answers = {
        make_frame(channel, hold): HolderState.HOLDING,
        make_frame(channel, release): HolderState.RELEASED,
    }
    asking = {ON: ON_AND_ANSWER, OFF: OFF_AND_ANSWER}
    return RelayProtocol(
        hold=Exchange(make_frame(channel, asking[hold]), answers),
        release=Exchange(make_frame(channel, asking[release]), answers),
        query=Exchange(make_frame(channel, QUERY), answers),
    )


def read_text_protocol(options: TomlTable) -> RelayProtocol:
    """Return a protocol of lines of text.

    Parameters
    ----------
    options : TomlTable
        `hold_command`, `release_command`, `answer`, `query_command`, `holding_answer`,
        `released_answer`, `line_end`.

    Raises
    ------
    ParameterError
        If a command is missing, or a value cannot be meant.
    """
    line_end = options.take_text("line_end", "\n").encode()
    if not line_end:
        raise options.refuse("line_end", 'what ends a line: "\\n", "\\r" or "\\r\\n"')
    hold = _take_line(options, "hold_command", "HOLD")
    release = _take_line(options, "release_command", "RELEASE")
    if hold == release:
        raise options.refuse("release_command", "another one than hold_command")
    answer = _take_line(options, "answer", "OK") if "answer" in options else b""
    query = None
    if "query_command" in options:
        answers = {
            _take_line(options, "holding_answer", "HOLDING"): HolderState.HOLDING,
            _take_line(options, "released_answer", "RELEASED"): HolderState.RELEASED,
        }
        if len(answers) == 1:
            raise options.refuse("released_answer", "another one than holding_answer")
        query = Exchange(_take_line(options, "query_command", "STATE?") + line_end, answers)
    return RelayProtocol(
        Exchange(hold + line_end, {answer: HolderState.HOLDING} if answer else {}),
        Exchange(release + line_end, {answer: HolderState.RELEASED} if answer else {}),
        query,
        line_end,
    )


def _take_line(options: TomlTable, key: str, example: str) -> bytes:
    """Return a line without its end."""
    text = options.take_text(key, REQUIRED, example)
    if not text.isascii() or not text.isprintable() or not text.strip():
        raise options.refuse(key, "one line of ASCII text")
    return text.encode("ascii")


SENDING_TIMEOUT = 0.1
ANSWER_TIMEOUT = 0.4
"""How long a request may take to be sent, and an answer to come [s], our choice: a relay needs
20 ms, and no call of a holder may take longer than half a second."""
LONGEST_LINE = 256
"""After so much without the end of a line it is no answer [byte], our choice."""


class RelayPort:
    """A serial port with a relay at its other end.

    Parameters
    ----------
    path : str
        Of the port.
    baud_rate : int
        [bit/s]

    Raises
    ------
    DeviceError
        If it is not there, in other hands, or no serial port.
    ModuleNotFoundError
        If pySerial is not installed.
    """

    def __init__(self, path: str, baud_rate: int) -> None:
        make_port = import_serial().Serial
        self._path = path
        try:
            self._serial = make_port(
                path,
                baud_rate,
                timeout=ANSWER_TIMEOUT,
                write_timeout=SENDING_TIMEOUT,
                exclusive=True,
            )
        except (OSError, ValueError, termios.error) as error:
            raise DeviceError(_explain(path, error)) from None

    def send(self, exchange: Exchange, line_end: bytes) -> Any:
        """Send a request and return what its answer means; None if there is none to come.

        Raises
        ------
        DeviceError
            If the port is gone, or the answer is missing, cut short, or none that is known.
        """
        try:
            # What came unasked is no answer.
            self._serial.reset_input_buffer()
            self._serial.write(exchange.request)
            if not exchange.answers:
                return None
            if line_end:
                answer = self._serial.read_until(line_end, LONGEST_LINE)
            else:
                answer = self._serial.read(FRAME_SIZE)
        except (OSError, termios.error) as error:
            raise self._lose(error) from None
        return self._understand(exchange, answer, line_end)

    def check(self) -> None:
        """Look whether the port is still there; raises `DeviceError` if it is not."""
        try:
            _ = self._serial.in_waiting
        except (OSError, termios.error) as error:
            raise self._lose(error) from None

    def close(self) -> None:
        """Let the port go; never raises."""
        with contextlib.suppress(OSError, termios.error):
            self._serial.close()

    def _understand(self, exchange: Exchange, answer: bytes, line_end: bytes) -> Any:
        request = f"the relay at {self._path}, told {_show(exchange.request, line_end)},"
        is_whole = answer.endswith(line_end) if line_end else len(answer) == FRAME_SIZE
        wanted = " or ".join(_show(known, line_end) for known in exchange.answers)
        if not answer:
            raise DeviceError(
                f"{request} did not answer within {ANSWER_TIMEOUT:g} s: it must answer {wanted}"
            )
        line = answer.strip() if line_end else answer
        if not is_whole and len(answer) < LONGEST_LINE:
            raise DeviceError(
                f"{request} answered half: {_show(line, line_end)}, and no more within"
                f" {ANSWER_TIMEOUT:g} s: it must answer {wanted}"
            )
        if line not in exchange.answers:
            raise DeviceError(
                f"{request} answered {_show(line, line_end)}: it must answer {wanted}"
            )
        return exchange.answers[line]

    def _lose(self, error: Exception) -> DeviceError:
        return DeviceError(
            f"the relay at {self._path} is gone ({error}): plug it in again, and see to its cable"
        )


def import_serial() -> Any:
    """Return pySerial; raises `ModuleNotFoundError` if it is not installed."""
    # With its tools: there is another package that is called serial, and has none.
    import serial.tools.list_ports

    return serial


def _show(data: bytes, line_end: bytes) -> str:
    """Return bytes as the protocol's manual would print them."""
    if line_end:
        return repr(data.decode("ascii", "backslashreplace").strip())
    return data.hex(" ").upper()


def _explain(path: str, error: Exception) -> str:
    """Return why a port could not be opened, and what would help."""
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return (
            f"there is no serial port {path}: plug the relay in, or correct port in [holder];"
            " `impact-rig devices` lists what is there"
        )
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add this user to the group that owns it, often"
            " dialout, and log in anew"
        )
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{path} is in use by {_find_users(path)}: end that program first"
    return f"{path} cannot be used as a serial port: {error}"


def _find_users(path: str) -> str:
    """Return who else has a file open, as far as this user may see it."""
    target = os.path.realpath(path)
    users = []
    for process in Path("/proc").glob("[0-9]*"):
        # A process may end while it is looked at, or belong to somebody else.
        with contextlib.suppress(OSError):
            if process.name != str(os.getpid()) and any(
                os.path.realpath(item) == target for item in (process / "fd").iterdir()
            ):
                name = (process / "comm").read_text("utf-8").strip()
                users.append(f"{name} (process {process.name})")
    return ", ".join(users) or "another program"


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


class SerialRelay(ToldHolder):
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

    def __init__(self, options: TomlTable) -> None:
        name = options.take_choice("protocol", (FOUR_BYTE, TEXT), FOUR_BYTE)
        options.check_keys(*PORT_KEYS, *PROTOCOL_KEYS[name])
        self._path = options.take_text("port", REQUIRED, "/dev/ttyUSB0")
        self._baud_rate = options.take_whole("baud_rate", 300, FASTEST_BAUD_RATE, 9600)
        read = read_four_byte_protocol if name == FOUR_BYTE else read_text_protocol
        self._protocol: RelayProtocol = read(options)
        self._port: RelayPort | None = None

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the serial ports of USB devices: there may be a relay at any."""
        ports = import_serial().tools.list_ports.comports()
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

    def read_state(self) -> HolderState:
        """Ask the relay; where it cannot be asked, see that its port is there."""
        port = self._get_port()
        if self._protocol.query is None:
            port.check()
            return self.told
        self._compare(port.send(self._protocol.query, self._protocol.line_end))
        return self.told

    def close(self) -> None:
        """Let the port go, and leave the relay as it is."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def tell(self, state: HolderState) -> None:
        """Bring the device into a state; raises `DeviceError` if it does not obey."""
        exchange = self._protocol.hold if state is HolderState.HOLDING else self._protocol.release
        answered = self._get_port().send(exchange, self._protocol.line_end)
        self.told = state
        if answered is not None:
            self._compare(answered)

    def _compare(self, answered: HolderState) -> None:
        if answered is not self.told:
            raise DeviceError(
                f"the relay at {self._path} says that it is {answered.value}, though it was told"
                f" to be {self.told.value}: look at its supply and its jumpers"
            )

    def _get_port(self) -> RelayPort:
        if self._port is None:
            raise DeviceError(f"the relay at {self._path} is not open: configure it first")
        return self._port

    def _describe_adapter(self) -> str:
        """Return what is known of the USB device behind the port."""
        target = os.path.realpath(self._path)
        found = [item for item in self.find_devices() if os.path.realpath(item.address) == target]
        return f" ({found[0].identity})" if found and found[0].identity else ""
