"""What a Red Pitaya does with SCPI commands, and with the voltages at its inputs.

Written from its list of commands (Acquisition, OS 2.05 to 2.07), apart from the driver that talks
to it: what the two understand differently shows as a wrong record.
"""

import re
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.devices.peers.ring_memory import SIZE, RingMemory

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
        count = max(int(volts.shape[1] * self._find_rate() / rate), 1)
        places = np.arange(count) * rate
        nearest = np.minimum(np.rint(places / self._find_rate()).astype(int), volts.shape[1] - 1)
        steps = np.array([[self._find_step(channel)] for channel in range(CHANNELS)])
        counts = np.clip(np.rint(volts[:, nearest] / steps), -LARGEST, LARGEST - 1)
        self._memory.lay(counts.astype(np.int16))
        if self._trigger is None:
            return None
        channel, sign = self._trigger
        step = self._find_step(channel)
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

    def _find_rate(self) -> float:
        return CLOCK / self._decimation

    def _find_step(self, channel: int) -> float:
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
        self._memory.start(self._find_rate(), max(SIZE // 2 + self._delay, 0))

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
        return str(self._memory.find_write_position())

    @_command("ACQ:TPOS?")
    def _tell_trigger_position(self, _: Arguments) -> str:
        return str(self._memory.find_trigger_position())

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
        return self._write(channel, self._memory.find_write_position() - count, count)

    def _write(self, channel: int, start: int, count: int) -> bytes:
        """Return points of a channel as they are asked for."""
        counts = self._memory.read(channel, start, count)
        values = counts if self._is_raw else counts * self._find_step(channel)
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
