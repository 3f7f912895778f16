"""A digitizer that speaks Red Pitaya's SCPI over a real TCP socket, without any hardware."""

import contextlib
import re
import socket
import struct
import threading
import time
from collections.abc import Callable
from enum import Enum
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.detection import to_acceleration
from impact_rig.core.signals.record import ChannelBlock, FloatArray
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import VirtualHit

CountArray = NDArray[np.int16]

SIZE = 16_384
"""Points of each channel."""
QUIET = 100
"""Points at either end of a signal that stand for the rest that goes on before and after it."""


class RingMemory:
    """Two or more channels, sampled all the time since `start`, by the clock of this computer.

    What was sampled is worked out when somebody looks: nothing runs in the meantime.

    Parameters
    ----------
    channels : int
        How many.
    """

    def __init__(self, channels: int) -> None:
        self._stored: CountArray = np.zeros((channels, SIZE), np.int16)
        self._signal: CountArray = np.zeros((channels, QUIET), np.int16)
        self._signal_start = 0
        self._rate = 1.0
        self._began: float | None = None
        self._origin = 0
        self._post = 0
        self._trigger: int | None = None

    @property
    def is_running(self) -> bool:
        """Whether it samples, or has until its trigger's delay was over."""
        return self._began is not None

    def start(self, rate: float, post: int) -> None:
        """Begin to sample at `rate` [Hz]; of what follows a trigger, `post` points are kept."""
        self.stop()
        self._rate, self._post = rate, post
        self._signal_start = -self._signal.shape[1]
        self._began = time.monotonic()

    def stop(self) -> None:
        """Keep what is there."""
        if self._began is not None:
            self._stored = self._look(np.arange(SIZE))
            self._origin = self.compute_write_position()
        self._began, self._trigger = None, None

    def lay(self, signal: CountArray) -> None:
        """Let a signal, of shape (channels, n), come in from now on."""
        self._signal, self._signal_start = signal, self._count()

    def trigger_now(self) -> None:
        """Trigger, whatever comes in."""
        self._trigger = self._count()

    def trigger_on(self, channel: int, sign: int, level: int, hysteresis: int) -> float | None:
        """Look for the trigger in the signal that was laid.

        Parameters
        ----------
        channel : int
            Counted from 0.
        sign : int
            1: the signal must rise through the level; -1: fall.
        level, hysteresis : int
            In counts: it must have been further than the hysteresis from the level before.

        Returns
        -------
        float or None
            How long until the memory is full [s]; None: no trigger.
        """
        height = sign * self._signal[channel].astype(float)
        low = height < sign * level - hysteresis
        if self._began is None or not low.any():
            return None
        begin = int(np.argmax(low))
        above = height[begin:] >= sign * level
        if not above.any():
            return None
        self._trigger = self._signal_start + begin + int(np.argmax(above))
        full = self._began + (self._trigger + self._post) / self._rate
        return full - time.monotonic()

    def is_triggered(self) -> bool:
        """Return whether the trigger has come."""
        return self._trigger is not None and self._count() >= self._trigger

    def is_full(self) -> bool:
        """Return whether all that follows the trigger is written."""
        return self._trigger is not None and self._count() >= self._trigger + self._post

    def compute_write_position(self) -> int:
        """Return where the next point will be written."""
        return (self._origin + self._count()) % SIZE

    def compute_trigger_position(self) -> int:
        """Return where the trigger's point was written; without one, where the first point was."""
        return (self._origin + (self._trigger or 0)) % SIZE

    def read(self, channel: int, start: int, count: int) -> CountArray:
        """Return `count` points of a channel, counted from 0, from a place of the ring on."""
        return self._look((start + np.arange(count)) % SIZE)[channel]

    def _count(self) -> int:
        """Return how many points have been written since the start."""
        if self._began is None:
            return 0
        count = int((time.monotonic() - self._began) * self._rate)
        return count if self._trigger is None else min(count, self._trigger + self._post)

    def _look(self, positions: NDArray[np.int64]) -> CountArray:
        """Return what stands at some places of the ring now, of shape (channels, n)."""
        count = self._count()
        newest = self._origin + count - 1
        points = count - 1 - (newest - positions) % SIZE
        fresh = self._signal[:, self._compute_places(points)]
        return np.where(points >= 0, fresh, self._stored[:, positions])

    def _compute_places(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which place of the signal each point shows: its ends go on by themselves."""
        places = points - self._signal_start
        size = self._signal.shape[1]
        quiet = min(QUIET, size)
        before, after = places % quiet, size - quiet + (places - size) % quiet
        return np.where(places < 0, before, np.where(places >= size, after, places))


IDENTITY = "REDPITAYA,INSTR2024,0,01-16"
"""What a board of the year 2024 answers."""
CLOCK = 125e6
"""Samples of the converters of a STEMlab 125-14 [Hz]."""
LARGEST = 2**13
"""Counts of its 14 bits, either sign."""
CHANNELS = 2
RANGES = {"LV": 1.0, "HV": 20.0}
"""Largest voltage of an input by its gain, either sign [V]."""
FAST_DECIMATIONS = (1, 2, 4, 8)
SLOW_DECIMATIONS = range(16, 65_537)
HYSTERESIS = 0.005
"""Of the trigger when it is switched on [V]."""

Arguments = list[str]


_Method = TypeVar("_Method", bound=Callable[..., bytes | str | None])
_COMMANDS: list[tuple[re.Pattern[str], Callable[..., bytes | str | None]]] = []


def _compile(notation: str) -> re.Pattern[str]:
    """Return what a command in SCPI's notation matches: small letters may be left out."""
    nodes = []
    for node in notation.rstrip("?").split(":"):
        short = re.match("[^a-z]*", node)
        begin = short[0] if short else ""
        end = node[len(begin) :]
        nodes.append(re.escape(begin).replace(r"\#", r"(\d)") + (f"(?:{end})?" if end else ""))
    return re.compile(":".join(nodes) + (r"\?" if notation.endswith("?") else ""), re.IGNORECASE)


def _command(notation: str) -> Callable[[_Method], _Method]:
    """Let a method do what a command says."""

    def keep(method: _Method) -> _Method:
        _COMMANDS.append((_compile(notation), method))
        return method

    return keep


class RedPitaya:
    """A STEMlab 125-14 without its plug.

    Attributes
    ----------
    identity : str
        What it answers to ``*IDN?``.
    """

    def __init__(self) -> None:
        self.identity = IDENTITY
        self._memory = RingMemory(CHANNELS)
        self._set_defaults()

    def _set_defaults(self) -> None:
        self._decimation, self._delay = 1, 0
        self._gains = ["LV"] * CHANNELS
        self._is_binary, self._is_raw = False, False
        self._level, self._hysteresis = 0.0, HYSTERESIS
        self._trigger: tuple[int, int] | None = None

    @_command("ACQ:RST")
    def reset(self, _: Arguments | None = None) -> None:
        """Forget all settings, as a board that is switched on."""
        self._memory.stop()
        self._set_defaults()

    def strike(self, volts: FloatArray, rate: float) -> float | None:
        """Let voltages come to the inputs from now on.

        Parameters
        ----------
        volts : ndarray of float64, shape (2, n)
            One row for each input [V].
        rate : float
            Of its points [Hz].

        Returns
        -------
        float or None
            How long until the record is complete [s]; None: they do not trigger.
        """
        if not self._memory.is_running or self._memory.is_triggered():
            return None
        count = max(int(volts.shape[1] * self._compute_rate() / rate), 1)
        places = np.arange(count) * rate
        nearest = np.minimum(
            np.rint(places / self._compute_rate()).astype(int), volts.shape[1] - 1
        )
        steps = np.array([[self._compute_step(channel)] for channel in range(CHANNELS)])
        counts = np.clip(np.rint(volts[:, nearest] / steps), -LARGEST, LARGEST - 1)
        self._memory.lay(counts.astype(np.int16))
        if self._trigger is None:
            return None
        channel, sign = self._trigger
        step = self._compute_step(channel)
        level, hysteresis = round(self._level / step), round(self._hysteresis / step)
        return self._memory.trigger_on(channel, sign, level, hysteresis)

    def answer(self, line: str) -> bytes | None:
        """Do what a command says; None: it has no answer, or is not understood."""
        header, _, rest = line.strip().partition(" ")
        arguments = [part.strip().upper() for part in rest.split(",")]
        for pattern, method in _COMMANDS:
            match = pattern.fullmatch(header)
            if match is None:
                continue
            try:
                channels = [_read_channel(group) for group in match.groups()]
                answer = method(self, *channels, arguments)
            except (ValueError, KeyError):
                # The real one keeps such a thing in its list of errors, and says nothing.
                return None
            return answer.encode() if isinstance(answer, str) else answer
        return None

    def _compute_rate(self) -> float:
        return CLOCK / self._decimation

    def _compute_step(self, channel: int) -> float:
        """Return the voltage of one count."""
        return RANGES[self._gains[channel]] / LARGEST

    @_command("*IDN?")
    def _identify(self, _: Arguments) -> str:
        return self.identity

    @_command("*OPC?")
    def _tell_done(self, _: Arguments) -> str:
        return "1"

    @_command("ACQ:START")
    def _start(self, _: Arguments) -> None:
        if self._memory.is_triggered():
            self._trigger = None
        self._memory.start(self._compute_rate(), max(SIZE // 2 + self._delay, 0))

    @_command("ACQ:STOP")
    def _stop(self, _: Arguments) -> None:
        self._memory.stop()

    @_command("ACQ:DEC:Factor")
    def _set_decimation(self, arguments: Arguments) -> None:
        value = int(arguments[0])
        if value not in FAST_DECIMATIONS and value not in SLOW_DECIMATIONS:
            raise ValueError(value)
        self._decimation = value

    @_command("ACQ:DEC:Factor?")
    def _tell_decimation(self, _: Arguments) -> str:
        return str(self._decimation)

    @_command("ACQ:SOUR#:GAIN")
    def _set_gain(self, channel: int, arguments: Arguments) -> None:
        RANGES[arguments[0]]
        self._gains[channel] = arguments[0]

    @_command("ACQ:SOUR#:GAIN?")
    def _tell_gain(self, channel: int, _: Arguments) -> str:
        return self._gains[channel]

    @_command("ACQ:DATA:FORMAT")
    def _set_format(self, arguments: Arguments) -> None:
        self._is_binary = {"BIN": True, "ASCII": False}[arguments[0]]

    @_command("ACQ:DATA:Units")
    def _set_units(self, arguments: Arguments) -> None:
        self._is_raw = {"RAW": True, "VOLTS": False}[arguments[0]]

    @_command("ACQ:DATA:Units?")
    def _tell_units(self, _: Arguments) -> str:
        return "RAW" if self._is_raw else "VOLTS"

    @_command("ACQ:TRig:LEV")
    def _set_level(self, arguments: Arguments) -> None:
        self._level = _read_voltage(arguments[0])

    @_command("ACQ:TRig:HYST")
    def _set_hysteresis(self, arguments: Arguments) -> None:
        self._hysteresis = _read_voltage(arguments[0])

    @_command("ACQ:TRig:DLY")
    def _set_delay(self, arguments: Arguments) -> None:
        self._delay = int(arguments[0])

    @_command("ACQ:TRig:DLY?")
    def _tell_delay(self, _: Arguments) -> str:
        return str(self._delay)

    @_command("ACQ:TRig")
    def _set_trigger(self, arguments: Arguments) -> None:
        channel, edge = {
            "DISABLED": (None, 0), "NOW": (None, 1),
            "CH1_PE": (0, 1), "CH1_NE": (0, -1), "CH2_PE": (1, 1), "CH2_NE": (1, -1),
        }[arguments[0]]  # fmt: skip
        self._trigger = None if channel is None else (channel, edge)
        if arguments[0] == "NOW":
            self._memory.trigger_now()

    @_command("ACQ:TRig:STAT?")
    def _tell_state(self, _: Arguments) -> str:
        return "TD" if self._trigger is None or self._memory.is_triggered() else "WAIT"

    @_command("ACQ:TRig:FILL?")
    def _tell_fill(self, _: Arguments) -> str:
        return str(int(self._memory.is_full()))

    @_command("ACQ:WPOS?")
    def _tell_write_position(self, _: Arguments) -> str:
        return str(self._memory.compute_write_position())

    @_command("ACQ:TPOS?")
    def _tell_trigger_position(self, _: Arguments) -> str:
        return str(self._memory.compute_trigger_position())

    @_command("ACQ:BUF:SIZE?")
    def _tell_size(self, _: Arguments) -> str:
        return str(SIZE)

    @_command("ACQ:SOUR#:DATA:STArt:N?")
    def _tell_data(self, channel: int, arguments: Arguments) -> bytes:
        start, count = (int(argument) for argument in arguments)
        return self._write(channel, start, min(count, SIZE))

    @_command("ACQ:SOUR#:DATA:LATest:N?")
    def _tell_latest_data(self, channel: int, arguments: Arguments) -> bytes:
        count = min(int(arguments[0]), SIZE)
        return self._write(channel, self._memory.compute_write_position() - count, count)

    def _write(self, channel: int, start: int, count: int) -> bytes:
        """Return points of a channel as they are asked for."""
        counts = self._memory.read(channel, start, count)
        values = counts if self._is_raw else counts * self._compute_step(channel)
        if not self._is_binary:
            return ("{" + ",".join(f"{value:.9g}" for value in values) + "}").encode()
        data = values.astype(">i2" if self._is_raw else ">f4").tobytes()
        size = str(len(data))
        return f"#{len(size)}{size}".encode() + data


def _read_channel(text: str) -> int:
    """Return the place of an input in our lists."""
    channel = int(text) - 1
    if channel not in range(CHANNELS):
        raise ValueError(text)
    return channel


def _read_voltage(text: str) -> float:
    number, _, unit = text.partition(" ")
    return float(number) * {"": 1.0, "V": 1.0, "MV": 1e-3}[unit]


HOST = "127.0.0.1"
LONGEST_LINE = 65_536
"""Bytes; who sends more without an end of line is thrown out."""
ABORT = struct.pack("ii", 1, 0)
"""SO_LINGER: a connection that is closed is gone at once."""

Taker = Callable[[bytes], tuple[bytes, bool]]
"""Takes a line without its end; returns what to send back, and whether the connection goes on."""


class LineServer:
    """Serves any number of connections, each in a thread.

    Parameters
    ----------
    take : callable
        Answers a line; called by several threads.

    Attributes
    ----------
    is_busy : bool
        Every connection is closed as soon as it is made.
    """

    def __init__(self, take: Taker) -> None:
        self.is_busy = False
        self._take = take
        # Any that is free, and the same one ever after.
        self._port = 0
        self._lock = threading.Lock()
        self._listener: socket.socket | None = None
        self._connections: set[socket.socket] = set()
        self._threads: list[threading.Thread] = []

    @property
    def address(self) -> str:
        """Host and port."""
        return f"{HOST}:{self._port}"

    def open(self) -> None:
        """Listen; nothing happens if it does already."""
        if self._listener is not None:
            return
        listener = socket.create_server((HOST, self._port))
        self._port = listener.getsockname()[1]
        self._listener = listener
        self._run(self._accept, listener)

    def close(self) -> None:
        """Close listener and connections, and return when nobody can reach anything any more."""
        with self._lock:
            listener, self._listener = self._listener, None
            connections = list(self._connections)
        if listener is not None:
            # Closing alone does not wake who waits in accept or recv.
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()
        for connection in connections:
            with contextlib.suppress(OSError):
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
                connection.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        self._threads.clear()

    def _run(self, target: Callable[[socket.socket], None], argument: socket.socket) -> None:
        thread = threading.Thread(target=target, args=(argument,), daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                is_open = self._listener is listener and not self.is_busy
                if is_open:
                    self._connections.add(connection)
            if is_open:
                self._run(self._serve, connection)
            else:
                connection.close()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            self._answer_lines(connection)
        with self._lock:
            self._connections.discard(connection)
        connection.close()

    def _answer_lines(self, connection: socket.socket) -> None:
        """Answer until the other side or we have enough."""
        waiting = b""
        while len(waiting) < LONGEST_LINE and (data := connection.recv(4096)):
            *lines, waiting = (waiting + data).split(b"\n")
            for line in lines:
                answer, goes_on = self._take(line)
                if answer:
                    connection.sendall(answer)
                if not goes_on:
                    return


END = b"\r\n"
NONSENSE = b"\x00\xffQX!"


class ScpiFault(Enum):
    """How an instrument may misbehave when it is asked."""

    NONE = "nothing"
    SILENT = "it does not answer"
    HALF = "it sends half of its answer"
    CUT = "it sends half of its answer and closes the connection"
    NONSENSE = "its answer makes no sense"


class ScpiDigitizer:
    """The instrument, with the hammer's sensor on its input 1 and the sample's on input 2.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors, signed [V per m/s^2].
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self._sensitivities = (hammer_sensitivity, specimen_sensitivity)
        self._server = LineServer(self._take)
        self._lock = threading.Lock()
        self._board = RedPitaya()
        self._fault, self._fault_on = ScpiFault.NONE, ""

    @property
    def address(self) -> str:
        """Where it listens: host and port."""
        return self._server.address

    def unplug(self) -> None:
        """Let listener and connections vanish at once."""
        self._server.close()

    def plug(self) -> None:
        """Be there, always at the same address, switched on anew."""
        with self._lock:
            self._board.reset()
        self._server.open()

    def feed(self, hit: VirtualHit) -> float | None:
        """Let the hammer strike now.

        Returns
        -------
        float or None
            When the record will be complete in the instrument, seconds since the epoch; None: it
            does not trigger.
        """
        if Fault.MISSED_TRIGGER in hit.faults:
            return None
        hammer, specimen = (
            sensitivity * _compute_acceleration(channel, hit.hammer.output.size)
            for sensitivity, channel in zip(
                self._sensitivities, (hit.hammer, hit.specimen), strict=True
            )
        )
        with self._lock:
            wait = self._board.strike(np.stack([hammer, specimen]), hit.sampling_rate)
            return None if wait is None else time.time() + wait

    def misbehave(self, fault: ScpiFault, on: str = "") -> None:
        """Answer wrongly from now on, where the command contains `on`."""
        with self._lock:
            self._fault, self._fault_on = fault, on

    def set_identity(self, identity: str) -> None:
        """Answer this to ``*IDN?``, as another instrument."""
        with self._lock:
            self._board.identity = identity

    def set_busy(self, *, is_busy: bool) -> None:
        """Close every connection as soon as it is made, as if somebody else had it, or not."""
        self._server.is_busy = is_busy

    def _take(self, line: bytes) -> tuple[bytes, bool]:
        """Return the answer to a line, and whether the connection goes on."""
        text = line.decode("latin-1")
        with self._lock:
            answer = self._board.answer(text)
            fault = self._fault if self._fault_on in text else ScpiFault.NONE
        if answer is None or fault is ScpiFault.SILENT:
            return b"", True
        if fault is ScpiFault.NONSENSE:
            return NONSENSE + END, True
        if fault in {ScpiFault.HALF, ScpiFault.CUT}:
            return answer[: (len(answer) + 1) // 2], fault is ScpiFault.HALF
        return answer + END, True


def _compute_acceleration(channel: ChannelBlock, size: int) -> FloatArray:
    """Return what a channel of a hit means [m/s^2], zero where it is not measured."""
    if not channel.output.size:
        return np.zeros(size)
    return to_acceleration(channel, channel.output)
