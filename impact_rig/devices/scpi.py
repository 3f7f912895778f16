"""Red Pitaya's boards by their SCPI server, reached with PyVISA: the driver `scpi`."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.records import Block, ChannelBlock
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import (
    NOT_MEASURED,
    Acquisition,
    AcquisitionPlan,
    FoundDevice,
    SourceChannel,
)

PORT = 5000
END = "\r\n"  # of a command, and of an answer
IDENTITY = "REDPITAYA"  # in its answer to *IDN?
TIMEOUT = 2.0  # [s], for a connection or an answer
POLL_PERIOD = 1e-3  # [s], of asking an armed board: a twentieth of a core
FILL_MARGIN = 1e-3  # [s], sampled beyond the pre-trigger before the trigger counts
MEMORY = 16_384  # points of each channel, a ring
ZERO_DELAY = MEMORY // 2  # points after the trigger at a trigger delay of zero
DECIMATIONS = (1, 2, 4, 8, *range(16, 65_537))
RATE_TOLERANCE = 1e-6  # relative
GAINS = {1.0: "LV", 20.0: "HV"}  # by the largest voltage [V]
HYSTERESIS = 5e-3  # [V], the board's own; less below twice this level


class Instrument:
    """An instrument that PyVISA reaches; its errors are a `DeviceError`.

    Parameters
    ----------
    address : str
        Host and port, like "192.168.1.20:5000".

    Raises
    ------
    ParameterError
        If the address cannot be meant.
    """

    library: Any = None  # PyVISA's back end; None: PyVISA-py

    def __init__(self, address: str) -> None:
        host, _, port = address.partition(":")
        port = port or str(PORT)
        if not host.strip() or not port.isdecimal() or not 0 < int(port) < 2**16:
            raise ParameterError(
                f"address is {address!r}: it must be a host and a port, like 192.168.1.20:{PORT}"
            )
        self.resource_name = f"TCPIP::{host}::{port}::SOCKET"  # VISA's
        self._name = f"the SCPI instrument at {address}"
        self._resource: Any = None

    def open(self, timeout: float) -> None:
        """Connect; this, and each answer, may take `timeout` seconds."""
        from pyvisa import ResourceManager
        from pyvisa_py.highlevel import PyVisaLibrary

        milliseconds = round(1e3 * timeout)
        try:
            self._resource = ResourceManager(self.library or PyVisaLibrary()).open_resource(
                self.resource_name,
                open_timeout=milliseconds,
                timeout=milliseconds,
                read_termination=END,
                write_termination=END,
            )
        except Exception as error:  # noqa: BLE001 - PyVISA-py raises plain exceptions
            raise self.make_error(
                f"cannot be reached: {error}; check address, cable and power"
            ) from None

    def close(self) -> None:
        """Close the connection; never raises."""
        with suppress(Exception):
            self._resource.close()

    def send(self, *commands: str) -> None:
        """Send commands that have no answer."""
        for command in commands:
            with self._report_errors(command):
                self._resource.write(command)

    def ask(self, *commands: str) -> str:
        """Send commands, the last of which is a query, and return its answer, a line of text."""
        *before, query = commands
        self.send(*before)
        with self._report_errors(query):
            answer: str = self._resource.query(query).strip()
            if not answer.isprintable():
                raise ValueError(f"{answer!r} is no line of text")
            return answer

    def ask_counts(self, query: str, count: int) -> NDArray[np.int32]:
        """Return the answer to a query, a block of whole numbers of 16 bits, shape (count,)."""
        with self._report_errors(query):
            # PyVISA reads a block much slower while it looks for the end of a line.
            self._resource.read_termination = None
            self._resource.write(query)
            begin = self._resource.read_bytes(2)
            if begin[:1] != b"#":
                raise ValueError(f"{begin!r} begins no block")
            length = int(self._resource.read_bytes(int(begin[1:])))
            if length != 2 * count:
                raise ValueError(f"a block of {length} bytes, where the record has {2 * count}")
            data = self._resource.read_bytes(length)
            if self._resource.read_bytes(len(END)) != END.encode():
                raise ValueError("more than the block")
            self._resource.read_termination = END
            return np.frombuffer(data, ">i2").astype(np.int32)

    def make_error(self, text: str) -> DeviceError:
        """Return an error whose sentence begins with the instrument."""
        return DeviceError(f"{self._name} {' '.join(text.split())}")

    @contextmanager
    def _report_errors(self, query: str) -> Iterator[None]:
        from pyvisa.errors import Error

        try:
            yield
        except OSError as error:
            raise self.make_error(
                f"has closed the connection: {error}; check cable and power, and whether another"
                " program holds it"
            ) from None
        except (Error, ValueError) as error:
            raise self.make_error(
                f"does not answer {query} as it should: {error}; is it the right"
                " instrument, and does another program hold it?"
            ) from None


@dataclass(frozen=True)
class Board:
    """One of Red Pitaya's boards."""

    clock: float  # of its converters [Hz]
    bits: int  # of a count
    channels: int = 2


BOARDS = {
    "125-14": Board(125e6, 14),
    "125-10": Board(125e6, 10),
    "125-14 4-Input": Board(125e6, 14, channels=4),
    "250-12": Board(250e6, 12),
}
"""By the name that is printed on them."""


class ScpiSource:
    """Arms a board, asks until it has triggered, and fetches the record of its channels.

    Parameters
    ----------
    options : TomlTable
        `address`, `board`.

    Raises
    ------
    ParameterError
        If a key is unknown, or its value cannot be meant.
    """

    description: ClassVar[str] = "Red Pitaya's boards, by their SCPI server"
    example: ClassVar[str] = read_example("scpi_source")

    timeout = TIMEOUT

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("address", "board")
        self._options = options
        self._address = options.take_text("address", REQUIRED, f"192.168.1.20:{PORT}")
        with options.locating("address"):
            self._instrument = Instrument(self._address)
        self._board = BOARDS[options.take_choice("board", tuple(BOARDS), "125-14")]
        self._settings: dict[str, str] = {}  # what is set, and read back at each arming
        self._is_armed = False
        self._asked = self._triggered = 0  # [ns since the epoch]; 0: not yet

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: a network is not searched."""
        return ()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Connect, see that it is the right instrument, and set it up.

        Raises
        ------
        DeviceError
            If it is not there, another one, or does not obey.
        ParameterError
            If rate, duration, channel, range, coupling or level are not possible.
        """
        if plan.continuous:
            raise ParameterError("the driver scpi records single hits only: set mode to triggered")
        self._plan = plan
        self._check_plan(plan)
        commands = self._choose_settings(plan)
        self._instrument.open(self.timeout)
        identity = self._check_identity()
        set_up = (f"{name} {value}" for name, value in self._settings.items())
        self._instrument.send("ACQ:RST", *set_up, *commands)
        self._check_settings()
        return Acquisition(f"{identity} at {self._address}", self._rate)

    def arm(self) -> None:
        """Let the board wait for a trigger.

        Raises
        ------
        DeviceError
            If it is gone, or another program has changed its settings.
        """
        self.disarm()
        self._check_settings()
        # An answer says that what was sent before has been done.
        self._instrument.ask("ACQ:TRIG DISABLED", "ACQ:START", "ACQ:TRIG:STAT?")
        time.sleep(self._plan.pre_trigger + FILL_MARGIN)
        self._instrument.ask(f"ACQ:TRIG {self._trigger}", "ACQ:TRIG:STAT?")
        self._is_armed, self._triggered = True, 0
        self._asked = time.time_ns()

    def read(self, timeout: float) -> Block | None:
        """Return a record; None if there is none within `timeout` seconds."""
        deadline = time.monotonic() + timeout
        while not (self._is_armed and self._is_complete()):
            left = deadline - time.monotonic()
            if left <= 0.0:
                return None
            time.sleep(min(POLL_PERIOD, left) if self._is_armed else left)
        self._is_armed = False
        return self._fetch(self._plan)

    def disarm(self) -> None:
        """Stop the board, and forget what has not been read; raises `DeviceError`."""
        if self._is_armed:
            self._is_armed = False
            self._instrument.send("ACQ:TRIG DISABLED", "ACQ:STOP")

    def check(self) -> None:
        """Ask the instrument what it is; raises `DeviceError`."""
        self._check_identity()

    def close(self) -> None:
        """Stop the board if it still listens, and close the connection."""
        with suppress(DeviceError):
            self.disarm()
        self._instrument.close()

    def _check_identity(self) -> str:
        identity = self._instrument.ask("*IDN?")
        if IDENTITY not in identity.upper():
            raise self._instrument.make_error(
                f"is {identity!r}: its answer to *IDN? must contain {IDENTITY!r}; check address"
                " of [source]"
            )
        return identity

    def _check_settings(self) -> None:
        for name, value in self._settings.items():
            answer = self._instrument.ask(f"{name}?")
            if answer.upper() != value:
                raise self._instrument.make_error(
                    f"answers {answer!r} to {name}?, where {value} was set: is"
                    " it the right board, and does another program talk to it, too?"
                )

    def _is_complete(self) -> bool:
        if not self._triggered:
            state = self._instrument.ask("ACQ:TRIG:STAT?")
            now = time.time_ns()
            if state == "WAIT":
                self._asked = now
                return False
            if state != "TD":
                raise self._instrument.make_error(
                    f"answers {state!r} to ACQ:TRIG:STAT?: it must be WAIT or TD"
                )
            # It came between this answer and the one before.
            self._triggered = (self._asked + now) // 2
        return self._instrument.ask("ACQ:TRIG:FILL?") == "1"

    def _fetch(self, plan: AcquisitionPlan) -> Block:
        """Return the record that is complete."""
        instrument = self._instrument
        position = instrument.ask("ACQ:TPOS?")
        if not position.isascii() or not position.isdigit() or int(position) >= MEMORY:
            raise instrument.make_error(
                f"answers {position!r} to ACQ:TPOS?: it must be a whole number below {MEMORY}"
            )
        start = (int(position) - plan.pre_trigger_points) % MEMORY
        hammer, *others = [self._read(channel, start, plan.points) for channel in plan.channels]
        specimen = (*others, NOT_MEASURED)[0]
        stamp = self._triggered - round(1e9 * plan.pre_trigger_points / self._rate)
        return Block(0, self._rate, hammer, specimen, last=True, stamp=stamp)

    def _read(self, channel: SourceChannel, start: int, points: int) -> ChannelBlock:
        """Return points of a channel, from a place of the ring on."""
        query = f"ACQ:SOUR{channel.name}:DATA:START:N? {start},{points}"
        counts = self._instrument.ask_counts(query, points)
        largest = 2 ** (self._board.bits - 1)
        volts = _take_range(channel.options)
        return channel.make_scale(volts / largest, volts, largest - 1).make_block(counts)

    def _check_plan(self, plan: AcquisitionPlan) -> None:
        """Raise `ParameterError` if the board cannot do what the plan says."""
        if plan.points > MEMORY:
            raise self._options.make_error(
                "record_duration",
                f"a record of {plan.points} points is too long for the board, which holds"
                f" {MEMORY}: make record_duration shorter or sampling_rate lower",
            )
        names = [str(number + 1) for number in range(self._board.channels)]
        for channel in plan.channels:
            options = channel.options
            options.check_keys("range")
            if channel.name not in names:
                raise options.make_error(
                    "channel",
                    f"channel of {options.place} is {channel.name or 'missing'}: it must be one of"
                    f" {', '.join(names)}",
                )
        if plan.specimen is not None and plan.specimen.name == plan.hammer.name:
            raise plan.specimen.options.make_error(
                "channel", f"hammer and sample are both on channel {plan.hammer.name}"
            )

    def _choose_settings(self, plan: AcquisitionPlan) -> tuple[str, ...]:
        """Choose rate, trigger and `_settings`; return the commands of what is not read back."""
        decimation = self._choose_decimation(plan.sampling_rate)
        self._rate = self._board.clock / decimation
        level = self._choose_level(plan)
        self._trigger = f"CH{plan.hammer.name}_{'PE' if level > 0.0 else 'NE'}"
        self._settings = {
            "ACQ:DEC:FACTOR": str(decimation),
            **{
                f"ACQ:SOUR{channel.name}:GAIN": GAINS[_take_range(channel.options)]
                for channel in plan.channels
            },
            "ACQ:DATA:UNITS": "RAW",
            "ACQ:TRIG:DLY": str(plan.points - plan.pre_trigger_points - ZERO_DELAY),
        }
        return (
            "ACQ:AVG ON",
            "ACQ:DATA:FORMAT BIN",
            f"ACQ:TRIG:LEV {level:.6g}",
            f"ACQ:TRIG:HYST {min(HYSTERESIS, abs(level) / 2):.6g}",
        )

    def _choose_decimation(self, rate: float) -> int:
        """Return by what the clock is divided."""
        clock = self._board.clock
        best = min(DECIMATIONS, key=lambda decimation: abs(clock / decimation - rate))
        if abs(clock / best - rate) > RATE_TOLERANCE * rate:
            raise self._options.make_error(
                "sampling_rate",
                f"sampling_rate is {rate:.9g} Hz: the nearest rate of the board is"
                f" {clock / best:.9g} Hz",
            )
        return best

    def _choose_level(self, plan: AcquisitionPlan) -> float:
        """Return the voltage of the trigger level at a positive acceleration [V]."""
        level = plan.trigger_level / plan.hammer.compute_scale()
        input_range = _take_range(plan.hammer.options)
        if abs(level) >= input_range:
            raise self._options.make_error(
                "trigger_level",
                f"trigger_level is {plan.trigger_level:g} m/s^2, which is {abs(level):.3g} V at"
                f" the input: it must be below its range of {input_range:g} V",
            )
        return level


def _take_range(options: TomlTable) -> float:
    """Return the largest voltage of an input [V]."""
    value = options.take_quantity("range", "V", "1 V", min(GAINS))
    if value not in GAINS:
        raise options.refuse("range", " or ".join(f'"{volts:g} V"' for volts in GAINS))
    return value
