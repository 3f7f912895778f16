"""A digitizer that speaks Red Pitaya's SCPI over a real TCP socket, without any hardware."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.detection import to_acceleration
from impact_rig.core.records import ChannelBlock, FloatArray
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

    def trigger_on(self, channel: int, sign: int, level: int, hysteresis: int) -> bool:
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
        bool
            Whether it triggers.
        """
        height = sign * self._signal[channel].astype(float)
        low = height < sign * level - hysteresis
        if self._began is None or not low.any():
            return False
        begin = int(np.argmax(low))
        above = height[begin:] >= sign * level
        if not above.any():
            return False
        self._trigger = self._signal_start + begin + int(np.argmax(above))
        return True

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
DEFAULTS = {
    "ACQ:DEC:FACTOR": "1",
    "ACQ:SOUR1:GAIN": "LV",
    "ACQ:SOUR2:GAIN": "LV",
    "ACQ:DATA:FORMAT": "ASCII",
    "ACQ:DATA:UNITS": "VOLTS",
    "ACQ:TRIG:LEV": "0",
    "ACQ:TRIG:HYST": "0.005",
    "ACQ:TRIG:DLY": "0",
    "ACQ:TRIG": "DISABLED",
}
"""Settings of a board that is switched on."""
TRIGGERS = {"CH1_PE": (0, 1), "CH1_NE": (0, -1), "CH2_PE": (1, 1), "CH2_NE": (1, -1)}


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
        self._settings = dict(DEFAULTS)

    def reset(self) -> None:
        """Forget all settings, as a board that is switched on."""
        self._memory.stop()
        self._settings = dict(DEFAULTS)

    def strike(self, volts: FloatArray, rate: float) -> bool:
        """Let voltages come to the inputs from now on; return whether they trigger.

        Parameters
        ----------
        volts : ndarray of float64, shape (2, n)
            One row for each input [V].
        rate : float
            Of its points [Hz].
        """
        if not self._memory.is_running or self._memory.is_triggered():
            return False
        count = max(int(volts.shape[1] * self._compute_rate() / rate), 1)
        places = np.arange(count) * rate
        nearest = np.minimum(
            np.rint(places / self._compute_rate()).astype(int), volts.shape[1] - 1
        )
        steps = np.array([[self._compute_step(channel)] for channel in range(CHANNELS)])
        counts = np.clip(np.rint(volts[:, nearest] / steps), -LARGEST, LARGEST - 1)
        self._memory.lay(counts.astype(np.int16))
        if self._settings["ACQ:TRIG"] == "DISABLED":
            return False
        channel, sign = TRIGGERS[self._settings["ACQ:TRIG"]]
        level, hysteresis = (
            round(float(self._settings[name]) / self._compute_step(channel))
            for name in ("ACQ:TRIG:LEV", "ACQ:TRIG:HYST")
        )
        return self._memory.trigger_on(channel, sign, level, hysteresis)

    def answer(self, line: str) -> bytes | None:
        """Do what a command says; None: it has no answer, or is not understood."""
        header, _, value = line.strip().partition(" ")
        if header in self._settings:
            self._settings[header] = value
            return None
        if header.rstrip("?") in self._settings:
            return self._settings[header.rstrip("?")].encode()
        if header.endswith(":DATA:START:N?"):
            start, count = map(int, value.split(","))
            return self._write(int(header.removeprefix("ACQ:SOUR")[0]) - 1, start, count)
        actions: dict[str, Callable[[], str | None]] = {
            "*IDN?": lambda: self.identity,
            "*OPC?": lambda: "1",
            "ACQ:RST": self.reset,
            "ACQ:START": self._start,
            "ACQ:STOP": self._memory.stop,
            "ACQ:TRIG:STAT?": self._tell_state,
            "ACQ:TRIG:FILL?": lambda: str(int(self._memory.is_full())),
            "ACQ:TPOS?": lambda: str(self._memory.compute_trigger_position()),
        }
        answer = actions[header]() if header in actions else None
        return None if answer is None else answer.encode()

    def _compute_rate(self) -> float:
        return CLOCK / int(self._settings["ACQ:DEC:FACTOR"])

    def _compute_step(self, channel: int) -> float:
        """Return the voltage of one count."""
        return RANGES[self._settings[f"ACQ:SOUR{channel + 1}:GAIN"]] / LARGEST

    def _start(self) -> None:
        if self._memory.is_triggered():
            self._settings["ACQ:TRIG"] = "DISABLED"
        delay = int(self._settings["ACQ:TRIG:DLY"])
        self._memory.start(self._compute_rate(), max(SIZE // 2 + delay, 0))

    def _tell_state(self) -> str:
        is_waiting = self._settings["ACQ:TRIG"] != "DISABLED" and not self._memory.is_triggered()
        return "WAIT" if is_waiting else "TD"

    def _write(self, channel: int, start: int, count: int) -> bytes | None:
        """Return points of a channel, as binary counts; text and volts are not simulated."""
        names = ("ACQ:DATA:FORMAT", "ACQ:DATA:UNITS")
        if [self._settings[name] for name in names] != ["BIN", "RAW"]:
            return None
        data = self._memory.read(channel, start, min(count, SIZE)).astype(">i2").tobytes()
        size = str(len(data))
        return f"#{len(size)}{size}".encode() + data


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


class ScpiDigitizer:
    """The instrument, with the hammer's sensor on its input 1 and the sample's on input 2.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors, signed [V per m/s^2].
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self._sensitivities = (hammer_sensitivity, specimen_sensitivity)
        self.server = LineServer(self._take)
        self.board = RedPitaya()
        self._lock = threading.Lock()

    @property
    def address(self) -> str:
        """Where it listens: host and port."""
        return self.server.address

    def unplug(self) -> None:
        """Let listener and connections vanish at once."""
        self.server.close()

    def plug(self) -> None:
        """Be there, always at the same address, with the settings of a new start."""
        with self._lock:
            self.board.reset()
        self.server.open()

    def feed(self, hit: VirtualHit) -> bool:
        """Let the hammer strike now; return whether that triggers."""
        if Fault.MISSED_TRIGGER in hit.faults:
            return False
        hammer, specimen = (
            sensitivity * _compute_acceleration(channel, hit.hammer.output.size)
            for sensitivity, channel in zip(
                self._sensitivities, (hit.hammer, hit.specimen), strict=True
            )
        )
        with self._lock:
            return self.board.strike(np.stack([hammer, specimen]), hit.sampling_rate)

    def _take(self, line: bytes) -> tuple[bytes, bool]:
        """Return the answer to a line, and that the connection goes on."""
        with self._lock:
            answer = self.board.answer(line.decode("latin-1"))
        return (b"" if answer is None else answer + END), True


def _compute_acceleration(channel: ChannelBlock, size: int) -> FloatArray:
    """Return what a channel of a hit means [m/s^2], zero where it is not measured."""
    if not channel.output.size:
        return np.zeros(size)
    return to_acceleration(channel, channel.output)
