"""The commands that an instrument understands: those of a rig file, or those of a Red Pitaya."""

import math
import re
from bisect import bisect_left
from dataclasses import dataclass
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel

SAME = 1e-3
"""How far a number that an instrument tells may be from what it was told, relative [-], our
choice: they round."""
FILL_MARGIN = 1e-3
"""How much longer than the pre-trigger an instrument samples before it may trigger [s], our
choice."""
ASCII = "ascii"
"""Format of points as text: numbers with commas, in braces or not."""


@dataclass(frozen=True)
class Setting:
    """A command, and how to see that it was obeyed.

    Attributes
    ----------
    command : str
        It has no answer.
    query, answer : str
        What is asked afterwards, and what must come; empty: nothing is asked.
    """

    command: str
    query: str = ""
    answer: str = ""

    def is_obeyed(self, answer: str) -> bool:
        """Return whether an answer is the wanted one, as a number or as a text."""
        try:
            number, wanted = float(answer), float(self.answer)
        except ValueError:
            return answer.upper() == self.answer.upper()
        return abs(number - wanted) <= SAME * abs(wanted)


@dataclass(frozen=True)
class Milestone:
    """Something that an armed instrument comes to, and that must be asked for.

    Attributes
    ----------
    query : str
        Asked until the answer comes.
    answer : str
        That it has come.
    waiting : str
        The answer before; empty: any other.
    """

    query: str
    answer: str
    waiting: str = ""


@dataclass(frozen=True)
class ChannelProgram:
    """How the points of one channel are fetched, and what they mean.

    Attributes
    ----------
    commands : tuple of str
        Said before.
    query : str
        Its answer is the points; ``{start}`` in it: where the record begins in the memory.
    points_format : str
        `ASCII`, or numpy's name of the type of a number in a block of bytes.
    step : float
        Voltage of one count [V].
    zero : float
        Count at no voltage.
    input_range : float
        Largest voltage of the input, either sign [V].
    rails : tuple of float
        Counts at which the input is overloaded, these and all beyond.
    """

    commands: tuple[str, ...]
    query: str
    points_format: str
    step: float
    zero: float
    input_range: float
    rails: tuple[float, float]


@dataclass(frozen=True)
class Program:
    """All that is said to an instrument.

    Attributes
    ----------
    sampling_rate : float
        That it really does [Hz].
    settings : tuple of Setting
        When it is configured.
    start : tuple of str
        Said at each arming, before what stands before the trigger can be sampled.
    fill_time : float
        That this takes [s].
    arm : tuple of str
        Said then: from here on a trigger counts.
    milestones : tuple of Milestone
        In their order: the first is the trigger, after the last the record is complete.
    position : str
        Query for the place of the trigger in the memory; empty: its points begin with the record.
    memory : int
        Points of each channel.
    stop : tuple of str
        Said to disarm it.
    hammer : ChannelProgram
        Inside the hammer.
    specimen : ChannelProgram or None
        On the sample; None: not measured.
    """

    sampling_rate: float
    settings: tuple[Setting, ...]
    start: tuple[str, ...]
    fill_time: float
    arm: tuple[str, ...]
    milestones: tuple[Milestone, ...]
    position: str
    memory: int
    stop: tuple[str, ...]
    hammer: ChannelProgram
    specimen: ChannelProgram | None


FORMATS = {
    "int8": ("i1", -(2.0**7), 2.0**7 - 1.0),
    "uint8": ("u1", 0.0, 2.0**8 - 1.0),
    "int16": ("i2", -(2.0**15), 2.0**15 - 1.0),
    "uint16": ("u2", 0.0, 2.0**16 - 1.0),
    "int32": ("i4", -(2.0**31), 2.0**31 - 1.0),
    "float32": ("f4", -math.inf, math.inf),
    ASCII: ("", -math.inf, math.inf),
}
"""Of points: numbers in a block of bytes, or as text with commas. numpy's name of their type, the
least and the largest."""
IN_VOLTS = ("float32", ASCII)
"""Formats of points that are volts unless a scale is given."""
BYTE_ORDERS = {"big": ">", "little": "<"}
GENERIC_EXAMPLE = """\
[source]
driver = "scpi"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"
address = "192.168.1.21:5025"
profile = "generic"
identity = "SDS1104"            # what its answer to *IDN? must contain; left out: anything
setup = ["*RST", "ACQ:RATE {sampling_rate}", "TRIG:LEV {level}"]  # when it is configured
start = ["RUN"]                 # at each arming; then the pre-trigger is waited
arm = ["SINGLE"]                # then: from here on a trigger counts
state = "TRIG:STAT?"            # asked until it answers `complete`
complete = "STOP"
fetch = ["WAV:SOUR C{channel}", "WAV:DATA?"]  # for each channel; the last one is the query
disarm = ["ABORT"]
format = "int16"                # int8, uint8, int16, uint16, int32, float32 or ascii
byte_order = "big"              # or "little"
# In braces: {sampling_rate}, {points}, {pre_trigger_points}, {duration}, {pre_trigger}, {level},
# {hammer}, {specimen}, and in fetch {channel}.

[source.hammer]
channel = 1
sensitivity = "5 mV/g"
range = "1 V"                   # largest voltage of the input, either sign
scale = "30.5 uV"               # voltage of one count; of float32 and ascii 1 V if left out
zero = 0                        # count at no voltage
"""
_BRACES = re.compile(r"\{(\w*)\}")


class Generic:
    """An instrument that does whatever the rig file says.

    Parameters
    ----------
    options : TomlTable
        [source] of the rig file.

    Attributes
    ----------
    KEYS : tuple of str
        Its own keys of that table.
    IDENTITY : str
        What its answer to ``*IDN?`` contains; empty: anything.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "setup", "start", "arm", "state", "complete", "fetch", "disarm", "format", "byte_order",
    )  # fmt: skip
    IDENTITY: ClassVar[str] = ""

    def __init__(self, options: TomlTable) -> None:
        self._options = options
        self._setup = _take_commands(options, "setup")
        self._start = _take_commands(options, "start")
        self._arm = _take_commands(options, "arm", least=1)
        self._fetch = _take_commands(options, "fetch", least=1)
        self._disarm = _take_commands(options, "disarm")
        self._state = options.take_text("state", REQUIRED, "TRIG:STAT?")
        if not self._state.isprintable():
            raise options.refuse("state", "one line")
        self._complete = options.take_text("complete", REQUIRED, "STOP")
        self._format = options.take_choice("format", tuple(FORMATS), "int16")
        self._order = BYTE_ORDERS[options.take_choice("byte_order", tuple(BYTE_ORDERS), "big")]

    def make_program(self, plan: AcquisitionPlan) -> Program:
        """Return what to say.

        Raises
        ------
        ParameterError
            If a command has something else in braces, or a channel lacks what it needs.
        """
        values = {
            "sampling_rate": f"{plan.sampling_rate:.12g}",
            "points": str(plan.points),
            "pre_trigger_points": str(plan.pre_trigger_points),
            "duration": f"{plan.record_duration:.9g}",
            "pre_trigger": f"{plan.pre_trigger:.9g}",
            "level": f"{plan.trigger_level / plan.hammer.compute_scale():.6g}",
            "hammer": plan.hammer.name,
        }
        if plan.specimen is not None:
            values["specimen"] = plan.specimen.name
        specimen = self._make_channel(plan.specimen, values) if plan.specimen else None
        return Program(
            sampling_rate=plan.sampling_rate,
            settings=tuple(Setting(line) for line in self._fill("setup", self._setup, values)),
            start=self._fill("start", self._start, values),
            fill_time=plan.pre_trigger + FILL_MARGIN,
            arm=self._fill("arm", self._arm, values),
            milestones=(Milestone(self._state, self._complete),),
            position="",
            memory=plan.points,
            stop=self._fill("disarm", self._disarm, values),
            hammer=self._make_channel(plan.hammer, values),
            specimen=specimen,
        )

    def _make_channel(self, channel: SourceChannel, values: dict[str, str]) -> ChannelProgram:
        options = channel.options
        options.check_keys("range", "scale", "zero")
        if not channel.name:
            raise options.make_error("channel", f"{options.place} lacks channel: give it")
        input_range = options.take_quantity("range", "V", "1 V", REQUIRED, low=1e-6, high=1e3)
        default = 1.0 if self._format in IN_VOLTS else REQUIRED
        step = options.take_quantity("scale", "V", "30.5 uV", default, low=1e-12, high=1e3)
        zero = options.take_number("zero", -(2.0**31), 2.0**31, 0.0)
        *commands, query = self._fill("fetch", self._fetch, values | {"channel": channel.name})
        kind, low, high = FORMATS[self._format]
        return ChannelProgram(
            commands=tuple(commands),
            query=query,
            points_format=ASCII if self._format == ASCII else self._order + kind,
            step=step,
            zero=zero,
            input_range=input_range,
            # A converter has one count less above zero than below.
            rails=(
                max(low, zero - input_range / step),
                min(high, zero + input_range / step - (self._format not in IN_VOLTS)),
            ),
        )

    def _fill(
        self, key: str, commands: tuple[str, ...], values: dict[str, str]
    ) -> tuple[str, ...]:
        """Return commands with what is in braces replaced."""

        def replace(match: re.Match[str]) -> str:
            if match[1] not in values:
                known = ", ".join(f"{{{name}}}" for name in values)
                raise self._options.make_error(
                    key, f"{key} of [source] has {match[0]}, which means nothing here: use {known}"
                )
            return values[match[1]]

        return tuple(_BRACES.sub(replace, command) for command in commands)


def _take_commands(options: TomlTable, key: str, least: int = 0) -> tuple[str, ...]:
    """Return a list of commands; a single one may stand without brackets."""
    value = options.get(key, [])
    commands = [value] if isinstance(value, str) else value
    if (
        not isinstance(commands, list)
        or not all(isinstance(command, str) and command.isprintable() for command in commands)
        or len(commands) < least
    ):
        if key not in options:
            raise options.make_error(key, f'{options.place} lacks {key}: give it, as ["..."]')
        raise options.refuse(key, 'a list of commands, as ["..."]')
    return tuple(commands)


MEMORY = 16_384
"""Points of each channel, a ring."""
ZERO_DELAY = MEMORY // 2
"""Points after the trigger at a trigger delay of zero."""
DECIMATIONS = (1, 2, 4, 8, *range(16, 65_537))
"""What the clock can be divided by."""
RATE_TOLERANCE = 1e-6
"""How far the rate of a decimation may be from what was asked, relative [-], our choice."""
GAINS = {1.0: "LV", 20.0: "HV"}
"""Name of the gain by the largest voltage [V]."""
EDGES = {"rising": ("PE", 1.0), "falling": ("NE", -1.0)}
"""Their names in commands, and the sign of the voltage."""
HYSTERESIS = 5e-3
"""Of the trigger [V], the board's own; less below twice this level."""


@dataclass(frozen=True)
class Board:
    """One of Red Pitaya's boards.

    Attributes
    ----------
    clock : float
        Of its converters [Hz].
    bits : int
        Of a count.
    channels : int
        Inputs.
    has_coupling : bool
        Whether the coupling can be chosen; else it is DC.
    """

    clock: float
    bits: int
    channels: int = 2
    has_coupling: bool = False


BOARDS = {
    "125-14": Board(125e6, 14),
    "125-10": Board(125e6, 10),
    "125-14 4-Input": Board(125e6, 14, channels=4),
    "250-12": Board(250e6, 12, has_coupling=True),
}
"""By the name that is printed on them."""
RED_PITAYA_EXAMPLE = """\
[source]
driver = "scpi"
sampling_rate = "2.5 MHz"       # 125 MHz divided by 1, 2, 4, 8 or any whole number from 16 on
trigger_level = "5 g"
address = "192.168.1.20:5000"   # without a port: 5000
profile = "red_pitaya"
board = "125-14"                # as printed on it: 125-14, 125-10, 125-14 4-Input, 250-12
# identity = "REDPITAYA"        # what its answer to *IDN? must contain
# timeout = "2 s"               # how long an answer may take

[source.hammer]
channel = 1
sensitivity = "5 mV/g"
range = "1 V"                   # "20 V": with the jumpers of the input set so
# coupling = "DC"               # or "AC", on the board 250-12
# edge = "falling"              # of the voltage; without it, that of a positive acceleration

[source.specimen]
channel = 2
sensitivity = "5 mV/g"
"""


class RedPitaya:
    """Triggered records from the ring memory of a board; parameters as `Generic`."""

    KEYS: ClassVar[tuple[str, ...]] = ("board",)
    IDENTITY: ClassVar[str] = "REDPITAYA"

    def __init__(self, options: TomlTable) -> None:
        self._options = options
        self._board = BOARDS[options.take_choice("board", tuple(BOARDS), "125-14")]

    def make_program(self, plan: AcquisitionPlan) -> Program:
        """Return what to say.

        Raises
        ------
        ParameterError
            If rate, duration, channel, range, coupling or level are not possible.
        """
        decimation = self._choose_decimation(plan.sampling_rate)
        if plan.points > MEMORY:
            raise self._options.make_error(
                "record_duration",
                f"a record of {plan.points} points is too long for the board, which holds"
                f" {MEMORY}: make record_duration shorter or sampling_rate lower",
            )
        hammer = self._make_channel(plan.hammer, plan.points, "edge")
        specimen = self._make_channel(plan.specimen, plan.points) if plan.specimen else None
        channels = plan.channels
        if len({channel.name for channel in channels}) < len(channels):
            raise channels[-1].options.make_error(
                "channel", f"hammer and sample are both on channel {plan.hammer.name}"
            )
        source, level = self._make_trigger(plan, hammer.input_range)
        return Program(
            sampling_rate=self._board.clock / decimation,
            settings=(
                Setting("ACQ:RST"),
                Setting(f"ACQ:DEC:FACTOR {decimation}", "ACQ:DEC:FACTOR?", str(decimation)),
                Setting("ACQ:AVG ON"),
                *(setting for channel in channels for setting in self._list_settings(channel)),
                Setting("ACQ:DATA:FORMAT BIN"),
                Setting("ACQ:DATA:UNITS RAW", "ACQ:DATA:UNITS?", "RAW"),
                Setting(f"ACQ:TRIG:LEV {level:.6g}"),
                Setting(f"ACQ:TRIG:HYST {min(HYSTERESIS, abs(level) / 2):.6g}"),
                _make_delay(plan.points - plan.pre_trigger_points - ZERO_DELAY),
            ),
            start=("ACQ:TRIG DISABLED", "ACQ:START"),
            fill_time=plan.pre_trigger + FILL_MARGIN,
            arm=(f"ACQ:TRIG {source}",),
            milestones=(
                Milestone("ACQ:TRIG:STAT?", "TD", "WAIT"),
                Milestone("ACQ:TRIG:FILL?", "1", "0"),
            ),
            position="ACQ:TPOS?",
            memory=MEMORY,
            stop=("ACQ:TRIG DISABLED", "ACQ:STOP"),
            hammer=hammer,
            specimen=specimen,
        )

    def _choose_decimation(self, rate: float) -> int:
        """Return by what the clock is divided."""
        clock = self._board.clock
        place = min(bisect_left(DECIMATIONS, clock / rate), len(DECIMATIONS) - 1)
        near = DECIMATIONS[max(place - 1, 0) : place + 1]
        best = min(near, key=lambda decimation: abs(clock / decimation - rate))
        if abs(clock / best - rate) <= RATE_TOLERANCE * rate:
            return best
        possible = " or ".join(f"{clock / decimation:.9g} Hz" for decimation in near)
        raise self._options.make_error(
            "sampling_rate",
            f"sampling_rate is {rate:.9g} Hz, which the board cannot do: near it are {possible}",
        )

    def _make_channel(
        self, channel: SourceChannel, points: int, *more_keys: str
    ) -> ChannelProgram:
        options = channel.options
        options.check_keys("range", "coupling", *more_keys)
        names = [str(number + 1) for number in range(self._board.channels)]
        if channel.name not in names:
            raise options.make_error(
                "channel",
                f"channel of {options.place} is {channel.name or 'missing'}: it must be one of"
                f" {', '.join(names)}",
            )
        if "coupling" in options and not self._board.has_coupling:
            raise options.refuse("coupling", "left out: the inputs of this board are DC coupled")
        largest = 2 ** (self._board.bits - 1)
        input_range = _take_range(options)
        return ChannelProgram(
            commands=(),
            query=f"ACQ:SOUR{channel.name}:DATA:START:N? {{start}},{points}",
            points_format=">i2",
            step=input_range / largest,
            zero=0.0,
            input_range=input_range,
            rails=(-largest, largest - 1),
        )

    def _list_settings(self, channel: SourceChannel) -> list[Setting]:
        """Return what is set for one channel."""
        name = f"ACQ:SOUR{channel.name}"
        gain = GAINS[_take_range(channel.options)]
        settings = [Setting(f"{name}:GAIN {gain}", f"{name}:GAIN?", gain)]
        if self._board.has_coupling:
            coupling = channel.options.take_choice("coupling", ("DC", "AC"), "DC")
            settings.append(Setting(f"{name}:COUP {coupling}", f"{name}:COUP?", coupling))
        return settings

    def _make_trigger(self, plan: AcquisitionPlan, input_range: float) -> tuple[str, float]:
        """Return the trigger source by name, and its level [V]."""
        scale = plan.hammer.compute_scale()
        usual = "rising" if scale > 0 else "falling"
        edge, sign = EDGES[plan.hammer.options.take_choice("edge", tuple(EDGES), usual)]
        level = plan.trigger_level / abs(scale)
        if level >= input_range:
            raise self._options.make_error(
                "trigger_level",
                f"trigger_level is {plan.trigger_level:g} m/s^2, which is {level:.3g} V at the"
                f" input: it must be below its range of {input_range:g} V",
            )
        return f"CH{plan.hammer.name}_{edge}", sign * level


def _take_range(options: TomlTable) -> float:
    """Return the largest voltage of an input [V]."""
    value = options.take_quantity("range", "V", "1 V", min(GAINS))
    if value not in GAINS:
        raise options.refuse("range", " or ".join(f'"{volts:g} V"' for volts in GAINS))
    return value


def _make_delay(delay: int) -> Setting:
    return Setting(f"ACQ:TRIG:DLY {delay}", "ACQ:TRIG:DLY?", str(delay))
