"""Options that several commands share."""

import contextlib
import functools
import math
import os
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from impact_rig.configuration.processes import RecordingPlan, make_network_variables
from impact_rig.configuration.units import parse_quantity, parse_reading, parse_sensitivity
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.calibration import TIME_UNITS, UNITS
from impact_rig.core.setup.samples import check_release_angles
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.recordings.writer import COMPRESSIONS


class Parsed(click.ParamType):
    """What a function makes of an option's name and text; it raises `ParameterError`.

    Parameters
    ----------
    parse : callable
        Gets both.
    """

    name = "text"

    def __init__(self, parse: Callable[[str, str], Any]) -> None:
        self._parse = parse

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Return what the text means; a default, which is none, as it is."""
        if not isinstance(value, str):
            return value
        return self._parse(param.opts[-1] if param else self.name, value)


def make_quantity(unit: str, example: str) -> Parsed:
    """Return what takes a number in SI units, or a text with number and unit.

    Parameters
    ----------
    unit : str
        SI unit, in pint's notation.
    example : str
        A good value, for the message.
    """

    def parse(name: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            return parse_quantity(name, text, unit, example)

    return Parsed(parse)


FREQUENCY = make_quantity("Hz", "50 kHz")
CUTOFF = Parsed(lambda _, text: 0.0 if text == "off" else FREQUENCY.convert(text, None, None))
"""A frequency [Hz], or ``off``, which is 0."""


def parse_angles(name: str, text: str) -> tuple[float, ...]:
    """Return release angles [rad], in degrees between commas; raises `ParameterError`."""
    try:
        angles = tuple(math.radians(float(number)) for number in text.split(","))
    except ValueError:
        raise ParameterError(
            f"{name} is {text}: write numbers of degrees between commas, like 5,10,20"
        ) from None
    check_release_angles(angles)
    return angles


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def _combine(*options: Decorator) -> Decorator:
    """Return what gives a command several options, in the order of the help."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


PLANTS = [plant.value for plant in Plant]
FAULTS = ", ".join(fault.value for fault in Fault)


rig_file_option = click.option(
    "--rig-file",
    type=click.Path(path_type=Path),
    help="TOML file with masses, samples and settings; without it, the paper's rig.",
)


virtual_rig_options = _combine(
    click.option(
        "--plant",
        type=click.Choice(PLANTS),
        help="Physics: the paper's tables, the model (driven, as printed), or a contact law"
        " between free bodies. [published]",
    ),
    click.option("--seed", type=click.IntRange(0), help="The same seed gives the same hits. [1]"),
    click.option(
        "--faults",
        type=click.FloatRange(0.0, 1.0),
        help=f"Probability of each fault, for each hit: {FAULTS}.",
    ),
)


continuous_option = click.option(
    "--continuous",
    is_flag=True,
    help="Stream both channels all the time, and find the impacts in the stream. [each hit]",
)


output_option = click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for recording, view and results. [runs/<time>]",
)


def samples_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--samples NAME ...``: one option, as many names as follow it."""

    @functools.wraps(command)
    def joined(*, samples: tuple[str, ...], more: tuple[str, ...], **values: Any) -> Any:
        if more and not samples:
            raise click.UsageError(f"unexpected {more[0]!r}: write --samples before the names")
        return command(samples=samples + more, **values)

    # An option takes one value; further names reach the command as arguments.
    with_more = click.argument("more", nargs=-1, metavar="")(joined)
    return click.option(
        "--samples",
        multiple=True,
        metavar="NAME...",
        help="Strike these samples only, in this order. [the whole set]",
    )(with_more)


impacts_option = click.option(
    "--impacts", type=click.IntRange(1), default=10, help="Accepted hits per sample. [10]"
)


keep_option = click.option(
    "--keep",
    type=click.IntRange(0),
    default=0,
    metavar="N",
    help="Average the N most consistent of a sample's hits. [that of the rig file; else all]",
)


angles_option = click.option(
    "--angles",
    type=Parsed(parse_angles),
    default=(),
    metavar="DEGREES,...",
    help="Strike every sample from each of these release angles. [those of the rig file, or its"
    " one]",
)


def check_keep(keep: int, impacts: int) -> None:
    """Raise `ParameterError` if more hits are to be kept than struck."""
    if keep > impacts:
        raise ParameterError(
            f"--keep {keep} asks for more hits than --impacts {impacts} gives: strike as many as"
            " are kept, or more"
        )


namespace_option = click.option("--namespace", default="", help="ROS namespace of the rig. [none]")
files_argument = click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


viewer_option = click.option(
    "--viewer",
    "viewers",
    multiple=True,
    metavar="spawn|web|ADDRESS",
    help="Show it live, too: in a window, on a web page, in the Rerun viewer at"
    " rerun+http://HOST:9876/proxy; repeatable. The file is written all the same.",
)


network_option = click.option(
    "--network",
    is_flag=True,
    help="Find the rig's nodes on other hosts too; by default ROS stays on this one.",
)


def set_discovery(*, network: bool) -> None:
    """Choose how far ROS looks; what the environment says goes first."""
    os.environ.update(make_network_variables(os.environ, network=network))


@contextlib.contextmanager
def use_private_domain() -> Iterator[None]:
    """Take an unused ROS domain for the length of the block, unless the environment names one.

    A demonstration must never reach the hammer of a rig that is up on the same network.
    """
    if "ROS_DOMAIN_ID" in os.environ:
        yield
        return
    from impact_rig.nodes.discovery import reserve_domain

    with reserve_domain() as number:
        os.environ["ROS_DOMAIN_ID"] = str(number)
        try:
            yield
        finally:
            del os.environ["ROS_DOMAIN_ID"]


_UNITS = ", ".join(UNITS)
_Options = dict[str, tuple[Any, str, str]]
"""Type, placeholder and help of options, by their names."""
_SENSOR_OPTIONS: _Options = {
    "unit": (str, "UNIT", f"{_UNITS}. [as the file states it]"),
    "sensitivity": (
        Parsed(parse_sensitivity),
        "VALUE",
        'For a channel in V: "10 mV/g", of a force hammer "2.25 mV/N".',
    ),
    "full_scale": (
        Parsed(parse_reading),
        "VALUE",
        'Largest the channel can show: "500 g". [not known]',
    ),
    "resonance": (
        make_quantity("Hz", "70 kHz"),
        "FREQUENCY",
        "Of the mounted sensor; the models are sent through it. [not known]",
    ),
    "resonance_damping": (float, "RATIO", "Of that resonance, over critical. [0.02]"),
    "low_corner": (
        make_quantity("Hz", "0.5 Hz"),
        "FREQUENCY",
        "-3 dB of sensor and amplifier at the low end. [not known]",
    ),
}
"""Of each body."""
_FILE = click.Path(path_type=Path)
_TRACE_OPTIONS: _Options = {
    "channels": (
        _FILE,
        "FILE.toml",
        "File that holds all of the following; `import --template` prints one.",
    ),
    "hammer": (str, "CHANNEL", "Name or number of the hammer's channel. [the first one]"),
    "specimen": (
        str,
        "CHANNEL",
        "Of the sample's. [the second one; none if --hammer is given]",
    ),
    "columns": (str, "ROLE,...", "Or the role of every column: time, hammer, specimen or skip."),
    "rate": (
        make_quantity("Hz", "25.6 kHz"),
        "RATE",
        "For files that state no sampling rate; goes before a column of times.",
    ),
    "time_unit": (
        str,
        "UNIT",
        f"Of times: {', '.join(TIME_UNITS)}. [as the file states it; s if it can be]",
    ),
    **{f"hammer_{key}": option for key, option in _SENSOR_OPTIONS.items()},
    **{
        f"sample_{key}": (kind, metavar, "Likewise.")
        for key, (kind, metavar, _) in _SENSOR_OPTIONS.items()
    },
    "sample": (str, "NAME", "Which sample was struck."),
    "rig_file": (_FILE, "FILE.toml", "Masses and settings; --sample is one of its samples."),
    "hammer_mass": (make_quantity("kg", "100 g"), "MASS", "m1."),
    "sample_mass": (make_quantity("kg", "102.38 g"), "MASS", "Without accelerometer."),
    "accelerometer_mass": (make_quantity("kg", "3 g"), "MASS", "Carried by the sample. [0]"),
    "hammer_stiffness": (
        make_quantity("N/m", "22.5 MN/m"),
        "K",
        "k1, from an earlier control experiment.",
    ),
    "control": (bool, "", "Hammer and sample are alike: k1 = k2 = 2 k_eq."),
    "pre_trigger": (
        make_quantity("s", "200 us"),
        "TIME",
        "Kept before each impact. [the whole file is the record]",
    ),
    "record_duration": (
        make_quantity("s", "2 ms"),
        "TIME",
        "A record of many impacts is cut into such. [the whole file is the record]",
    ),
}
"""What is said of measured files, see `impact_rig.analysis.measured_files`."""
_SETTING_OPTIONS: _Options = {
    "cutoff": (
        CUTOFF,
        "FREQUENCY",
        "Low-pass, or off. [as recorded or in the rig file; else 50 kHz, off at low rates]",
    ),
    "pulse_factor": (float, "F", "τp = F w50: 2 versed-sine, 1.5 half-sine. [2]"),
    "exponent": (
        float,
        "N",
        "n of the contact law F = k δⁿ (1 + a δ'): 1 linear spring, 1.5 Hertz. [fitted]",
    ),
    "double_hit_level": (
        float,
        "LEVEL",
        "Second pulse that makes a double hit, part of the first. [0.02]",
    ),
    "double_hit_window": (
        make_quantity("s", "1 ms"),
        "TIME",
        "Distance of two pulses up to which the second makes a double hit. [any]",
    ),
    "polarity": (
        click.Choice(["fixed", "auto"]),
        "fixed|auto",
        "Hits of the other sign than those before: rejected, or turned. [fixed]",
    ),
    "keep": (
        click.IntRange(0),
        "N",
        "Average the N most consistent hits of a sample; 0: all. [as recorded; else 0]",
    ),
}
_SETTINGS = {
    "cutoff": "cutoff_frequency",
    "exponent": "contact_exponent",
    "polarity": "turns_polarity",
    "keep": "keep_hits",
}
"""Fields of `AnalysisSettings` whose options have other names."""


def refuse_given(context: click.Context, names: Collection[str], reason: str) -> None:
    """Raise `ParameterError` with a reason if one of some options was given."""
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not ParameterSource.DEFAULT:
            raise ParameterError(f"{parameter.opts[0]} {reason}")


def make_flag(name: str) -> str:
    """Return an option as it is written on the command line."""
    return f"--{name.replace('_', '-')}"


def measurement_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add what is said of measured files and of settings, as two mappings of what is given."""
    options = _SETTING_OPTIONS | _TRACE_OPTIONS

    @functools.wraps(command)
    def joined(**values: Any) -> Any:
        found = {name: values.pop(name) for name in options}
        given = {name: value for name, value in found.items() if value is not None}
        if "polarity" in given:
            given["polarity"] = given["polarity"] == "auto"
        traces = {name: given[name] for name in _TRACE_OPTIONS if name in given}
        settings = {_SETTINGS.get(name, name): given[name] for name in given.keys() - traces}
        return command(traces=traces, settings=settings, **values)

    for name, (kind, metavar, words) in reversed(options.items()):
        is_flag = kind is bool
        joined = click.option(
            make_flag(name),
            type=kind,
            is_flag=is_flag,
            default=None,
            metavar=None if is_flag else metavar,
            help=words,
        )(joined)
    return joined


def recording_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add options that make one `RecordingPlan`, `recording`."""

    @functools.wraps(command)
    def joined(
        *, bag: bool, compression: str | None, notes: str, record_stream: bool, **values: Any
    ) -> Any:
        plan = RecordingPlan(bag, compression or "", notes, record_stream)
        return command(recording=plan, **values)

    for option in (
        click.option(
            "--record-stream",
            is_flag=True,
            help="With --continuous: record the whole stream, 20 MB a second before compression,"
            " not only the impacts in it.",
        ),
        click.option(
            "--notes", default="", metavar="TEXT", help="What the recording should say of itself."
        ),
        click.option(
            "--compression",
            type=click.Choice(COMPRESSIONS),
            help="Of the recording. [zstd]",
        ),
        click.option(
            "--bag/--no-bag",
            default=False,
            help="Record into a folder as rosbag2 writes it, not into one file. [no]",
        ),
    ):
        joined = option(joined)
    return joined


def list_recording_arguments(recording: RecordingPlan) -> list[str]:
    """Return a plan as the words of a command line."""
    arguments = ["--bag"] if recording.bag else []
    arguments += ["--record-stream"] if recording.stream else []
    for name, value in (("--compression", recording.compression), ("--notes", recording.notes)):
        if value:
            arguments += [name, value]
    return arguments
