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

from impact_rig.configuration.processes import (
    RECORDING_NAME,
    REPORT_NAME,
    RecordingPlan,
    make_network_variables,
)
from impact_rig.configuration.units import parse_quantity
from impact_rig.core.errors import ParameterError
from impact_rig.core.sensors import UNITS
from impact_rig.core.setup import check_release_angles
from impact_rig.devices.virtual.choices import Fault, Plant


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
    help="Masses, samples and settings, in TOML. [the paper's rig]",
)


virtual_rig_options = _combine(
    click.option(
        "--plant",
        type=click.Choice(PLANTS),
        metavar="PLANT",
        help=f"Physics: {', '.join(PLANTS)}. [published]",
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
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for recording, view and results. [runs/<time>]",
)


resume_option = click.option(
    "--resume",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    metavar="RUN",
    help="Go on with a run: the folder that it is recorded in.",
)


def samples_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--samples NAME ...``: as many names as follow it, with blanks or commas between."""

    @functools.wraps(command)
    def joined(*, samples: tuple[str, ...], more: tuple[str, ...], **values: Any) -> Any:
        if more and not samples:
            raise click.UsageError(f"unexpected {more[0]!r}: write --samples before the names")
        names = ",".join(samples + more).split(",")
        return command(samples=tuple(name.strip() for name in names if name.strip()), **values)

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
full_option = click.option(
    "--full", "is_full", is_flag=True, help="Print every table and remark. [one screen]"
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


viewer_option = click.option(
    "--viewer",
    "viewers",
    multiple=True,
    metavar="spawn|web|ADDRESS",
    help="Show it live, too: in a window, on a web page, in the Rerun viewer at"
    " rerun+http://HOST:9876/proxy; repeatable.",
)


network_option = click.option(
    "--network",
    is_flag=True,
    help="Find the rig's nodes on other hosts too. [on this one]",
)


def print_places(**places: Path | None) -> None:
    """Print on standard error where files are, by what they are, and how to make a report."""
    for name, path in places.items():
        if path is not None:
            click.echo(f"{name + ':':10} {shorten_path(path)}", err=True)
    source = places.get("recording") or places.get("results")
    if source is not None:
        report = source.parent / REPORT_NAME
        run = source.parent if source.name == RECORDING_NAME else source
        command = f"impact-rig report {shorten_path(run)}"
        click.echo(f"report:    {shorten_path(report) if report.exists() else command}", err=True)


def shorten_path(path: Path) -> Path:
    """Return a path from the working folder, where it lies below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


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


_FILE = click.Path(path_type=Path)
_MEASUREMENT_OPTIONS: dict[str, tuple[click.ParamType, str, str]] = {
    "channels": (
        _FILE,
        "FILE.toml",
        "Channels, sensors, masses, settings, as `import --template` prints it.",
    ),
    "hammer_unit": (click.STRING, "UNIT", f"{', '.join(UNITS)}. [as the file states it]"),
    "rate": (make_quantity("Hz", "25.6 kHz"), "RATE", "Sampling rate. [as the file states it]"),
    "hammer_mass": (make_quantity("kg", "100 g"), "MASS", "m1."),
    "sample_mass": (make_quantity("kg", "102.38 g"), "MASS", "Without accelerometer."),
    "rig_file": (_FILE, "FILE.toml", "Masses and settings; --sample is one of its samples."),
    "sample": (click.STRING, "NAME", "Which sample was struck."),
    "cutoff": (CUTOFF, "FREQUENCY", "Low-pass, or off. [as recorded; else 50 kHz]"),
    "record_duration": (
        make_quantity("s", "2 ms"),
        "TIME",
        "Of each hit, if a file holds many. [the whole file is one hit]",
    ),
}
"""Type, placeholder and help; see `impact_rig.analysis.measured_files`."""


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
    """Add the options of measured files; the command gets those given as `measured`, a mapping."""

    @functools.wraps(command)
    def joined(**values: Any) -> Any:
        found = {name: values.pop(name) for name in _MEASUREMENT_OPTIONS}
        given = {name: value for name, value in found.items() if value is not None}
        return command(measured=given, **values)

    for name, (kind, metavar, words) in reversed(_MEASUREMENT_OPTIONS.items()):
        joined = click.option(make_flag(name), type=kind, metavar=metavar, help=words)(joined)
    return joined


def recording_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add options that make one `RecordingPlan`, `recording`."""

    @functools.wraps(command)
    def joined(*, notes: str, record_stream: bool, **values: Any) -> Any:
        return command(recording=RecordingPlan(notes, record_stream), **values)

    for option in (
        click.option(
            "--record-stream",
            is_flag=True,
            help="With --continuous: record all of the stream.",
        ),
        click.option(
            "--notes", default="", metavar="TEXT", help="What the recording should say of itself."
        ),
    ):
        joined = option(joined)
    return joined


def list_recording_arguments(recording: RecordingPlan) -> list[str]:
    """Return a plan as the words of a command line."""
    arguments = ["--record-stream"] if recording.stream else []
    return [*arguments, "--notes", recording.notes] if recording.notes else arguments
