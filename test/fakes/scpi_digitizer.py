"""A digitizer that speaks Red Pitaya's SCPI over a real TCP socket, without any hardware."""

import contextlib
import math
import socket
import socketserver
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.records import FloatArray
from impact_rig.devices.virtual.rig import VirtualHit

CountArray = NDArray[np.int16]

SIZE = 16_384  # points of each channel
QUIET = 100  # points at either end of a signal, which repeat before and after it
IDENTITY = "REDPITAYA,INSTR2024,0,01-16"  # of a board of the year 2024
CLOCK = 125e6  # [Hz], of the converters of a STEMlab 125-14
LARGEST = 2**13  # counts of its 14 bits, either sign
CHANNELS = 2
RANGES = {"LV": 1.0, "HV": 20.0}  # [V], of an input by its gain, either sign
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
SLOPES = {"CH1_PE": 1, "CH1_NE": -1}
"""Of the triggers, all on the hammer's input."""


class RedPitaya:
    """A STEMlab 125-14 without its plug.

    Its memory is a ring that is written since the last start: what was there before stays where
    nothing new was written.

    Attributes
    ----------
    identity : str
        What it answers to ``*IDN?``.
    """

    def __init__(self) -> None:
        self.identity = IDENTITY
        self._ring: CountArray = np.zeros((CHANNELS, SIZE), np.int16)
        self._written = 0  # points, since it was made
        self.reset()

    def reset(self) -> None:
        """Forget all settings, as a board that is switched on."""
        self._settings = dict(DEFAULTS)
        self._stop()

    def _stop(self) -> None:
        # By the monotonic clock [s]; infinite: not yet.
        self._began: float = math.inf
        self._triggered: float = math.inf
        self._full: float = math.inf
        self._position = 0  # of the trigger

    def _start(self) -> None:
        self._stop()
        self._began = time.monotonic()

    def strike(self, volts: FloatArray, rate: float) -> bool:
        """Let voltages come to the inputs from now on; return whether they trigger.

        Parameters
        ----------
        volts : ndarray of float64, shape (2, n)
            One row for each input [V].
        rate : float
            Of its points [Hz], which must be the board's.
        """
        if self._began == math.inf or self._triggered < math.inf:
            return False
        assert rate == self._get_rate()
        now, steps = time.monotonic(), [[self._get_step(channel)] for channel in range(CHANNELS)]
        counts = np.clip(np.rint(volts / steps), -LARGEST, LARGEST - 1).astype(np.int16)
        written = min(int((now - self._began) * rate), SIZE)
        self._write(np.take(counts, np.arange(written) % QUIET, axis=1))
        trigger = self._find_trigger(counts)
        if trigger is None:
            return False
        delay = int(self._settings["ACQ:TRIG:DLY"])
        end = trigger + max(SIZE // 2 + delay, 0)
        after = np.take(counts, -1 - np.arange(end) % QUIET, axis=1)
        self._position = (self._written + trigger) % SIZE
        self._write(np.hstack([counts, after])[:, :end])
        self._triggered, self._full = now + trigger / rate, now + end / rate
        return True

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
            return self._read(int(header.removeprefix("ACQ:SOUR")[0]) - 1, start, count)
        actions: dict[str, Callable[[], str | None]] = {
            "*IDN?": lambda: self.identity,
            "ACQ:RST": self.reset,
            "ACQ:START": self._start,
            "ACQ:STOP": self._stop,
            "ACQ:TRIG:STAT?": self._tell_state,
            "ACQ:TRIG:FILL?": lambda: str(int(time.monotonic() >= self._full)),
            "ACQ:TPOS?": lambda: str(self._position),
        }
        answer = actions[header]() if header in actions else None
        return None if answer is None else answer.encode()

    def _tell_state(self) -> str:
        is_disabled = self._settings["ACQ:TRIG"] == "DISABLED"
        return "TD" if is_disabled or time.monotonic() >= self._triggered else "WAIT"

    def _get_rate(self) -> float:
        return CLOCK / int(self._settings["ACQ:DEC:FACTOR"])

    def _get_step(self, channel: int) -> float:
        """Return the voltage of one count."""
        return RANGES[self._settings[f"ACQ:SOUR{channel + 1}:GAIN"]] / LARGEST

    def _find_trigger(self, counts: CountArray) -> int | None:
        """Return the point that crosses the level, behind one that is below its hysteresis."""
        if self._settings["ACQ:TRIG"] == "DISABLED":
            return None
        sign = SLOPES[self._settings["ACQ:TRIG"]]
        level, hysteresis = (
            round(float(self._settings[name]) / self._get_step(0))
            for name in ("ACQ:TRIG:LEV", "ACQ:TRIG:HYST")
        )
        height = sign * counts[0].astype(float)
        low = np.flatnonzero(height < sign * level - hysteresis)
        above = np.flatnonzero(height >= sign * level)
        above = above[above > low[0]] if low.size else low
        return int(above[0]) if above.size else None

    def _write(self, counts: CountArray) -> None:
        places = self._written + np.arange(counts.shape[1])
        self._ring[:, places % SIZE] = counts
        self._written += counts.shape[1]

    def _read(self, channel: int, start: int, count: int) -> bytes | None:
        """Return points of a channel, as binary counts; text and volts are not simulated."""
        names = ("ACQ:DATA:FORMAT", "ACQ:DATA:UNITS")
        if [self._settings[name] for name in names] != ["BIN", "RAW"]:
            return None
        places = (start + np.arange(min(count, SIZE))) % SIZE
        data = self._ring[channel, places].astype(">i2").tobytes()
        size = str(len(data))
        return f"#{len(size)}{size}".encode() + data


HOST = "127.0.0.1"
ABORT = struct.pack("ii", 1, 0)  # SO_LINGER: a connection that is closed is gone at once


class _Connection(socketserver.StreamRequestHandler):
    disable_nagle_algorithm = True
    server: "_Server"

    def handle(self) -> None:
        self.server.connections.add(self.connection)
        with contextlib.suppress(OSError):
            for line in self.rfile:
                self.wfile.write(self.server.owner.take(line))


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, owner: "ScpiDigitizer", port: int) -> None:
        self.owner = owner
        self.connections: set[socket.socket] = set()
        super().__init__((HOST, port), _Connection)

    def verify_request(self, request: Any, client_address: Any) -> bool:
        return not self.owner.is_busy


END = b"\r\n"


class ScpiDigitizer:
    """The instrument, with the hammer's sensor on its input 1 and the sample's on input 2.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors, signed [V per m/s^2].

    Attributes
    ----------
    is_busy : bool
        Every connection is closed as soon as it is made.
    spoil : callable
        What becomes of the answer to a command.
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self._sensitivities = (hammer_sensitivity, specimen_sensitivity)
        self.is_busy = False
        self.spoil: Callable[[str, bytes], bytes] = lambda _, answer: answer
        self.board = RedPitaya()
        self._lock = threading.Lock()
        self._port = 0  # any that is free, and the same one ever after
        self._server: _Server | None = None

    @property
    def address(self) -> str:
        """Where it listens: host and port."""
        return f"{HOST}:{self._port}"

    def plug(self) -> None:
        """Be there, always at the same address, with the settings of a new start."""
        with self._lock:
            self.board.reset()
        self._server = _Server(self, self._port)
        self._port = self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()

    def unplug(self) -> None:
        """Let listener and connections vanish at once; nothing happens if they are gone."""
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()
            for connection in server.connections:
                with contextlib.suppress(OSError):
                    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
                    connection.shutdown(socket.SHUT_RDWR)

    def feed(self, hit: VirtualHit) -> bool:
        """Let the hammer strike now; return whether that triggers."""
        channels = (hit.hammer.acceleration, hit.specimen.acceleration)
        volts = np.stack(channels) * np.array(self._sensitivities)[:, np.newaxis]
        with self._lock:
            return self.board.strike(volts, hit.sampling_rate)

    def take(self, line: bytes) -> bytes:
        """Return the answer to a line; empty: it has none."""
        text = line.decode("latin-1").strip()
        with self._lock:
            answer = self.board.answer(text)
        return b"" if answer is None else self.spoil(text, answer + END)
