"""Profile of Red Pitaya's boards, by their list of SCPI commands.

It follows the section "Acquisition" of the list in Red Pitaya's documentation for OS 2.05 to
2.07, and uses nothing that came after OS 2.00-30, the first with any whole decimation
(``ACQ:DEC:Factor``). Commands are written in capitals and in full, which all of them understand.
The points are fetched as counts of the converter (``RAW``), two bytes each, the higher one first:
the board's own correction of gain and offset, a few percent, is not in them, and belongs to the
calibration of sensor and input together. Points in volts would hold it, but some versions cut
their binary form to whole volts.
"""

from bisect import bisect_left
from dataclasses import dataclass
from typing import ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi.program import (
    FILL_MARGIN,
    ChannelProgram,
    Milestone,
    Program,
    Setting,
)

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
EXAMPLE = """\
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
    """Triggered records from the ring memory of a board; parameters as `Profile`."""

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
        decimation = self._find_decimation(plan.sampling_rate)
        if plan.points > MEMORY:
            raise self._options.make_error(
                "record_duration",
                f"a record of {plan.points} points is too long for the board, which holds"
                f" {MEMORY}: make record_duration shorter or sampling_rate lower",
            )
        hammer = self._make_channel(plan.hammer, plan.points, "edge")
        specimen = self._make_channel(plan.specimen, plan.points) if plan.specimen else None
        channels = [plan.hammer, *([plan.specimen] if plan.specimen else [])]
        if len({channel.name for channel in channels}) < len(channels):
            raise channels[-1].options.make_error(
                "channel", f"hammer and sample are both on channel {plan.hammer.name}"
            )
        source, level = self._find_trigger(plan, hammer.input_range)
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

    def _find_decimation(self, rate: float) -> int:
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

    def _find_trigger(self, plan: AcquisitionPlan, input_range: float) -> tuple[str, float]:
        """Return the trigger source by name, and its level [V]."""
        scale = plan.hammer.find_scale()
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
