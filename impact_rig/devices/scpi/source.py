"""Digitizers that take SCPI commands over TCP: the driver `scpi`."""

import contextlib
import re
import socket
import time
from contextlib import suppress
from textwrap import indent
from typing import ClassVar

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.signals.record import Block, ChannelBlock, RawArray
from impact_rig.devices.protocols import (
    NOT_MEASURED,
    Acquisition,
    AcquisitionPlan,
    FoundDevice,
    SourceChannel,
)
from impact_rig.devices.scpi.dialects import (
    ASCII,
    GENERIC_EXAMPLE,
    RED_PITAYA_EXAMPLE,
    ChannelProgram,
    Generic,
    Program,
    RedPitaya,
)

END = b"\r\n"
"""Of a command: SCPI takes the carriage return for white space where only a newline is meant."""
LONGEST_TEXT = 4096
"""Bytes of an answer that is a word or a number, our choice."""
CHUNK = 65_536
"""Bytes that are asked of the socket at once."""
SHOWN = 40
"""Characters of an answer that a message shows, our choice."""
_ADDRESS = re.compile(r"(?:\[(?P<six>[^\]]+)\]|(?P<host>[^:\s]+))(?::(?P<port>\d{1,5}))?")


def parse_address(text: str, default_port: int) -> tuple[str, int]:
    """Return host and port of an address like "192.168.1.20:5000" or "[fe80::1]:5000".

    Raises
    ------
    ParameterError
        If it is none.
    """
    match = _ADDRESS.fullmatch(text)
    port = int(match["port"] or default_port) if match else 0
    if match is None or not 0 < port < 2**16:
        raise ParameterError(
            f"address is {text!r}: it must be a host and a port, like 192.168.1.20:{default_port}"
        )
    return match["six"] or match["host"], port


class ScpiConnection:
    """Says commands, and returns what is answered.

    Whatever goes wrong is a `DeviceError`; after one the connection is of no more use.

    Parameters
    ----------
    host : str
        Name or number.
    port : int
        Of TCP.
    timeout : float
        That a connection, and each answer as a whole, may take [s].

    Raises
    ------
    DeviceError
        If nobody is there.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self._name = f"the SCPI instrument at {host}:{port}"
        self._timeout = timeout
        self._buffer = bytearray()
        self._has_answered = self._is_answering = False
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except TimeoutError:
            raise DeviceError(
                f"{self._name} does not answer within {timeout:g} s: check address, cable and"
                " power"
            ) from None
        except ConnectionRefusedError:
            raise DeviceError(
                f"{self._name} refuses connections: start its SCPI server, and check the port"
            ) from None
        except (OSError, UnicodeError) as error:
            raise DeviceError(f"{self._name} cannot be reached: {_describe(error)}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self) -> None:
        """Hang up, whatever the other side does."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def send(self, command: str) -> None:
        """Say a command that has no answer.

        Raises
        ------
        DeviceError
            If the instrument is gone.
        """
        self._socket.settimeout(self._timeout)
        try:
            self._socket.sendall(command.encode() + END)
        except TimeoutError:
            raise DeviceError(f"{self._name} takes no more commands: restart it") from None
        except OSError as error:
            raise self._make_loss_error(error) from None

    def ask(self, query: str, longest: int = LONGEST_TEXT) -> str:
        """Return the answer to a query: a line of text, without its end.

        Raises
        ------
        DeviceError
            If the instrument is gone or silent, answers half a line, more than `longest` bytes, or
            what is no text.
        """
        deadline = self._say(query)
        while (end := self._buffer.find(b"\n")) < 0:
            if len(self._buffer) > longest:
                raise self.make_nonsense_error(query, bytes(self._buffer), "a line of text")
            self._receive(query, deadline)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        self._is_answering = False
        text = line.decode("latin-1").strip()
        if not (text.isascii() and text.isprintable()):
            raise self.make_nonsense_error(query, line, "a line of text")
        self._has_answered = True
        return text

    def ask_block(self, query: str, longest: int) -> bytes:
        """Return the answer to a query: a definite-length block of IEEE 488.2.

        Such a block is ``#``, the number of digits of its length, its length, its bytes.

        Raises
        ------
        DeviceError
            If the instrument is gone or silent, sends half a block, more than `longest` bytes, or
            something else.
        """
        deadline = self._say(query)
        begin = self._read(2, query, deadline)
        digits = int(begin[1:]) if begin[1:].isdigit() else 0
        wanted = "a block of bytes"
        if begin[:1] != b"#" or not digits:
            raise self.make_nonsense_error(query, begin + bytes(self._buffer), wanted)
        length = self._read(digits, query, deadline)
        if not length.isdigit() or int(length) > longest:
            wanted = f"a block of {longest} bytes at most"
            raise self.make_nonsense_error(query, begin + length, wanted)
        data = self._read(int(length), query, deadline)
        if (end := self._read(1, query, deadline)) == b"\r":
            end = self._read(1, query, deadline)
        if end != b"\n":
            raise self.make_nonsense_error(query, end, "the end of the block")
        self._is_answering = False
        return data

    def wait(self, seconds: float) -> None:
        """Wait while nothing is asked.

        Raises
        ------
        DeviceError
            If the instrument goes away, or says something by itself.
        """
        self._socket.settimeout(max(seconds, 1e-3))
        try:
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return
        except OSError as error:
            raise self._make_loss_error(error) from None
        if not data:
            raise self._make_loss_error(None)
        raise self.make_nonsense_error("nothing", data, "silence")

    def make_nonsense_error(self, query: str, answer: bytes | str, wanted: str) -> DeviceError:
        """Return the error that an answer makes no sense: it should be what is `wanted`."""
        shown = repr(answer[:SHOWN]).removeprefix("b")
        more = " ..." if len(answer) > SHOWN else ""
        return DeviceError(
            f"{self._name} answers {shown}{more} to {query}: {wanted} should come; is it the right"
            " instrument, and does nobody else talk to it?"
        )

    def make_error(self, text: str) -> DeviceError:
        """Return an error whose sentence begins with the instrument."""
        return DeviceError(f"{self._name} {text}")

    def _say(self, query: str) -> float:
        """Send a query, and return until when its answer must be there."""
        if self._buffer:
            raise self.make_nonsense_error("nothing", bytes(self._buffer), "silence")
        self.send(query)
        self._is_answering = False
        return time.monotonic() + self._timeout

    def _read(self, count: int, query: str, deadline: float) -> bytes:
        while len(self._buffer) < count:
            self._receive(query, deadline)
        data = bytes(self._buffer[:count])
        del self._buffer[:count]
        return data

    def _receive(self, query: str, deadline: float) -> None:
        """Take what comes next."""
        left = deadline - time.monotonic()
        try:
            if left <= 0.0:
                raise TimeoutError
            self._socket.settimeout(left)
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            if self._is_answering:
                raise self.make_error(
                    f"has sent half of its answer to {query}, and nothing more within"
                    f" {self._timeout:g} s: check its network"
                ) from None
            raise self.make_error(
                f"does not answer {query} within {self._timeout:g} s: is it the right instrument,"
                " and does it still work?"
            ) from None
        except OSError as error:
            raise self._make_loss_error(error) from None
        if not data:
            raise self._make_loss_error(None)
        self._buffer += data
        self._is_answering = True

    def _make_loss_error(self, error: OSError | None) -> DeviceError:
        reason = f": {_describe(error)}" if error is not None else ""
        if not self._has_answered:
            return self.make_error(
                f"closes the connection at once{reason}: another program may hold it"
            )
        middle = " in the middle of its answer" if self._is_answering else ""
        return self.make_error(
            f"has closed the connection{middle}{reason}: check its cable and power"
        )


def _describe(error: Exception) -> str:
    """Return what went wrong, as the system says it."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror[:1].lower() + error.strerror[1:]
    return str(error) or type(error).__name__


LONGEST_NUMBER = 32
"""Characters of a number that is sent as text, comma and space included, our choice."""


def fetch_points(
    connection: ScpiConnection, program: ChannelProgram, start: int, points: int
) -> RawArray:
    """Return the points of one channel.

    Parameters
    ----------
    connection : ScpiConnection
        To the instrument.
    program : ChannelProgram
        How to ask.
    start : int
        Where the record begins in the instrument's memory.
    points : int
        Of the record.

    Returns
    -------
    ndarray of int32 or float64, shape (points,)
        Counts, or numbers where the instrument sends such.

    Raises
    ------
    DeviceError
        If it does not answer, or not with so many numbers.
    """
    for command in program.commands:
        connection.send(command)
    query = program.query.replace("{start}", str(start))
    if program.points_format == ASCII:
        values = _parse_text(connection, query, points)
    else:
        kind = np.dtype(program.points_format)
        # One more than wanted: a longer record is named by its length, below.
        data = connection.ask_block(query, 2 * points * kind.itemsize)
        if len(data) % kind.itemsize:
            raise connection.make_nonsense_error(query, data, f"numbers of {kind.itemsize} bytes")
        values = np.frombuffer(data, kind)
    if values.size != points:
        raise connection.make_error(
            f"answers {query} with {values.size} points: the record has {points}"
        )
    if values.dtype.kind == "f":
        if not np.all(np.isfinite(values)):
            raise connection.make_error(f"answers {query} with what is no number")
        return values.astype(np.float64)
    return values.astype(np.int32)


def make_channel_block(
    output: RawArray, program: ChannelProgram, channel: SourceChannel
) -> ChannelBlock:
    """Return points with their calibration, and whether they reach the rails."""
    low, high = program.rails
    scale = channel.compute_scale() * program.step
    return ChannelBlock(
        output=output,
        scale=scale,
        offset=-program.zero * scale,
        full_scale=channel.compute_full_scale(program.input_range),
        overloaded=bool(np.any((output <= low) | (output >= high))),
    )


def _parse_text(connection: ScpiConnection, query: str, points: int) -> RawArray:
    """Ask for numbers as text."""
    text = connection.ask(query, 2 * points * LONGEST_NUMBER)
    try:
        return np.array([float(word) for word in text.strip("{}").split(",")])
    except ValueError:
        raise connection.make_nonsense_error(query, text, "numbers with commas") from None


PORT = 5000
"""Where Red Pitaya's server listens."""
TIMEOUT = 2.0
"""How long a connection or an answer may take [s], our choice."""
LONGEST_TIMEOUT = 5.0
"""[s], our choice: well below what the accelerometers wait for a driver."""
POLL_PERIOD = 1e-3
"""How often an armed instrument is asked whether it has triggered [s], our choice: it costs a
twentieth of a core, and the record comes half of this later."""
NANO = 1e9

PROFILES: dict[str, type[RedPitaya | Generic]] = {"red_pitaya": RedPitaya, "generic": Generic}
"""Kinds of instruments."""
EXAMPLE = f"""\
{RED_PITAYA_EXAMPLE}
# Any other instrument, by its commands:
{indent(GENERIC_EXAMPLE, "# ")}"""


class ScpiSource:
    """Arms an instrument, asks until it has triggered, and fetches the record of its channels.

    Parameters
    ----------
    options : TomlTable
        Table [source] of the rig file without what all sources share.

    Raises
    ------
    ParameterError
        If a key or a value is none that the profile knows.
    """

    description: ClassVar[str] = (
        "a digitizer that speaks SCPI over TCP: Red Pitaya, or any other by its commands"
    )
    example: ClassVar[str] = EXAMPLE

    def __init__(self, options: TomlTable) -> None:
        profile = PROFILES[options.take_choice("profile", tuple(PROFILES), "red_pitaya")]
        options.check_keys("address", "profile", "identity", "timeout", *profile.KEYS)
        address = options.take_text("address", REQUIRED, f"192.168.1.20:{PORT}")
        try:
            self._host, self._port = parse_address(address, PORT)
        except ParameterError as error:
            raise options.make_error("address", str(error)) from None
        self._identity = options.take_text("identity", profile.IDENTITY)
        self._timeout = options.take_quantity(
            "timeout", "s", f"{TIMEOUT:g} s", TIMEOUT, low=1e-3, high=LONGEST_TIMEOUT
        )
        self._profile = profile(options)
        self._connection: ScpiConnection | None = None
        self._plan: AcquisitionPlan | None = None
        self._program: Program | None = None
        self._is_armed = False
        self._passed = 0
        self._asked = self._triggered = 0

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: nobody on a network is asked who did not ask for it."""
        return ()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Connect, see that it is the right instrument, and set it up.

        Raises
        ------
        DeviceError
            If it is not there, another one, or does not obey.
        ParameterError
            If it cannot do what the plan says.
        """
        if plan.continuous:
            raise ParameterError(
                "a source that speaks SCPI gives records of single hits: set mode to triggered"
            )
        self.close()
        program = self._profile.make_program(plan)
        self._connection = ScpiConnection(self._host, self._port, self._timeout)
        try:
            identity = self._check_identity(self._connection)
            _set_up(self._connection, program)
        except DeviceError:
            self.close()
            raise
        self._plan, self._program = plan, program
        return Acquisition(f"{identity} at {self._host}:{self._port}", program.sampling_rate)

    def arm(self) -> None:
        """Let the instrument wait for a trigger.

        Raises
        ------
        DeviceError
            If it is gone, or somebody else has changed its settings.
        """
        connection, _, program = self._require()
        self.disarm()
        for setting in program.settings:
            if setting.query and not setting.is_obeyed(answer := connection.ask(setting.query)):
                raise connection.make_error(
                    f"answers {answer!r} to {setting.query}, where {setting.answer} was set:"
                    " another program talks to it, too"
                )
        query = program.milestones[0].query
        # An answer says that what was said before has been done.
        for commands, pause in ((program.start, program.fill_time), (program.arm, 0.0)):
            if commands:
                for command in commands:
                    connection.send(command)
                connection.ask(query)
                time.sleep(pause)
        self._is_armed, self._passed = True, 0
        self._asked = time.time_ns()

    def read(self, timeout: float) -> Block | None:
        """Return a record; None if there is none within `timeout` seconds.

        Raises
        ------
        DeviceError
            If the instrument is gone, or does not answer as it should.
        """
        connection, plan, program = self._require()
        if not self._is_armed:
            connection.wait(timeout)
            return None
        deadline = time.monotonic() + timeout
        while not self._is_complete(connection, program):
            left = deadline - time.monotonic()
            if left <= 0.0:
                return None
            time.sleep(min(POLL_PERIOD, left))
        self._is_armed = False
        return self._fetch(connection, plan, program)

    def disarm(self) -> None:
        """Stop the instrument, and forget what has not been read; raises `DeviceError`."""
        if self._is_armed and self._connection is not None and self._program is not None:
            self._is_armed = False
            for command in self._program.stop:
                self._connection.send(command)

    def check(self) -> None:
        """Ask the instrument who it is; raises `DeviceError`."""
        self._check_identity(self._require()[0])

    def close(self) -> None:
        """Stop the instrument as far as it listens, and hang up."""
        with suppress(DeviceError):
            self.disarm()
        self._is_armed = False
        if self._connection is not None:
            self._connection.close()
        self._connection = self._plan = self._program = None

    def _require(self) -> tuple[ScpiConnection, AcquisitionPlan, Program]:
        if self._connection is None or self._plan is None or self._program is None:
            raise DeviceError("the SCPI instrument is not configured: configure it first")
        return self._connection, self._plan, self._program

    def _check_identity(self, connection: ScpiConnection) -> str:
        identity = connection.ask("*IDN?")
        if self._identity.upper() not in identity.upper():
            raise connection.make_error(
                f"is {identity!r}: its answer to *IDN? must contain {self._identity!r}; check"
                " address and identity of [source]"
            )
        return identity

    def _is_complete(self, connection: ScpiConnection, program: Program) -> bool:
        """Ask for the milestone that comes next, and return whether there is none any more."""
        while self._passed < len(program.milestones):
            milestone = program.milestones[self._passed]
            answer = connection.ask(milestone.query)
            now = time.time_ns()
            if answer != milestone.answer:
                if milestone.waiting and answer != milestone.waiting:
                    wanted = f"{milestone.waiting} or {milestone.answer}"
                    raise connection.make_nonsense_error(milestone.query, answer, wanted)
                self._asked = now
                return False
            if not self._passed:
                # It came between this answer and the one before.
                self._triggered = (self._asked + now) // 2
            self._passed += 1
        return True

    def _fetch(self, connection: ScpiConnection, plan: AcquisitionPlan, program: Program) -> Block:
        """Return the record that is complete."""
        start = self._read_start(connection, plan, program)
        asked = [(program.hammer, plan.hammer)]
        if program.specimen is not None and plan.specimen is not None:
            asked.append((program.specimen, plan.specimen))
        hammer, *others = [
            make_channel_block(fetch_points(connection, of, start, plan.points), of, channel)
            for of, channel in asked
        ]
        return Block(
            first_sample=0,
            sampling_rate=program.sampling_rate,
            hammer=hammer,
            specimen=others[0] if others else NOT_MEASURED,
            last=True,
            stamp=self._triggered - round(plan.pre_trigger_points * NANO / program.sampling_rate),
        )

    @staticmethod
    def _read_start(connection: ScpiConnection, plan: AcquisitionPlan, program: Program) -> int:
        """Return where the record begins in the instrument's memory."""
        if not program.position:
            return 0
        answer = connection.ask(program.position)
        if not answer.isascii() or not answer.isdigit() or int(answer) >= program.memory:
            wanted = f"a whole number below {program.memory}"
            raise connection.make_nonsense_error(program.position, answer, wanted)
        return (int(answer) - plan.pre_trigger_points) % program.memory


def _set_up(connection: ScpiConnection, program: Program) -> None:
    """Say all settings, and see that they are obeyed."""
    for setting in program.settings:
        connection.send(setting.command)
        if setting.query and not setting.is_obeyed(answer := connection.ask(setting.query)):
            raise connection.make_error(
                f"does not obey {setting.command}: it answers {answer!r} to {setting.query}; is"
                " it the right profile and board?"
            )
