"""Profile of any digitizer that speaks SCPI: its commands stand in the rig file.

What is in braces in a command is filled in: ``{sampling_rate}`` [Hz], ``{points}`` and
``{pre_trigger_points}`` of a record, ``{duration}`` and ``{pre_trigger}`` [s], ``{level}`` of the
trigger [V, signed as the hammer's sensitivity], ``{hammer}`` and ``{specimen}``, their channels;
in `fetch`, too, ``{channel}``. The first point that is fetched must be the first of the record.
"""

import math
import re
from typing import ClassVar

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi.program import (
    ASCII,
    FILL_MARGIN,
    ChannelProgram,
    Milestone,
    Program,
    Setting,
)

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
EXAMPLE = """\
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
    """Whatever the rig file says; parameters as `Profile`."""

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
            "level": f"{plan.trigger_level / plan.hammer.find_scale():.6g}",
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
