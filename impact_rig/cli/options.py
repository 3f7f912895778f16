"""Options that several commands share."""

import contextlib
import math
import os
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from impact_rig.cli.rig_options import RIG_OPTIONS
from impact_rig.configuration.processes import make_network_variables
from impact_rig.core.given.errors import ParameterError

if TYPE_CHECKING:
    from impact_rig.configuration.rig_file import RigFile


def parse_angles(_: click.Context, option: click.Parameter, text: str) -> tuple[float, ...]:
    """Return release angles [rad], in degrees between commas; raises `ParameterError`."""
    from impact_rig.core.given.setup import check_release_angles

    if not text:
        return ()
    try:
        angles = tuple(math.radians(float(number)) for number in text.split(","))
    except ValueError:
        raise ParameterError(
            f"{option.opts[0]} is {text}: write numbers of degrees between commas, like 5,10,20"
        ) from None
    check_release_angles(angles)
    return angles


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def _combine(*options: Decorator) -> Decorator:
    """Join options into one decorator; the help lists them in this order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


FILE = click.Path(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)


def make_rig_option(name: str, *parameter: str, **more: Any) -> Decorator:
    """Return an option as `RIG_OPTIONS` has it; `more` are keywords of click."""
    option = RIG_OPTIONS[name]
    kind, choices = type(option.value.default), option.value.choices
    if kind is bool:
        more["is_flag"] = True
    elif choices:
        more["type"] = click.Choice(choices)
    elif kind is not str:
        make_range: Callable[..., Any] = click.IntRange if kind is int else click.FloatRange
        ends = option.value.low, option.value.high
        more["type"] = make_range(*(None if math.isinf(end) else kind(end) for end in ends))
    words = f"--{name.replace('_', '-')}", *parameter
    return click.option(*words, **{"help": option.help, **more})


def make_quantity_option(
    name: str, unit: str, example: str, text: str, default: float | None = None
) -> Decorator:
    """Return an option that takes a number with its unit, or off, for 0."""

    def parse(_: click.Context, __: click.Parameter, value: str | None) -> float | None:
        if value is None or value == "off":
            return default if value is None else 0.0
        if unit == "dimensionless" and (number := read_number(value)) is not None:
            return number
        from impact_rig.configuration.units import parse_quantity

        return parse_quantity(name, value, unit, example)

    return click.option(name, callback=parse, metavar=f'"{example}"', help=text)


def read_number(text: str) -> float | None:
    """Return the number that a text is; None: it is none."""
    try:
        return float(text)
    except ValueError:
        return None


def make_list_option(name: str, metavar: str, text: str, parameter: str = "") -> Decorator:
    """Return an option that may be given several times."""
    names = [name, parameter] if parameter else [name]
    return click.option(*names, multiple=True, metavar=metavar, help=f"{text}; repeatable.")


def make_output_option(text: str, metavar: str = "FILE", *, required: bool = False) -> Decorator:
    """Return the option that says where a command writes."""
    return click.option("-o", "--output", type=FILE, metavar=metavar, required=required, help=text)


SOURCE_KEYS = ("plant", "seed", "fault_probability")
"""Options of the virtual rig; they are keys of the rig file's table [source]."""
notes_option = click.option(
    "--notes", default="", metavar="TEXT", help="Words to keep in the recording."
)
nodes_options = _combine(
    make_rig_option("rig_file", type=FILE),
    make_rig_option("plant", metavar="PLANT"),
    make_rig_option("seed"),
    make_rig_option("faults", "fault_probability"),
    make_rig_option("continuous"),
    click.option(
        "--record-stream", is_flag=True, help="With --continuous: record all of the stream."
    ),
    notes_option,
    make_output_option(RIG_OPTIONS["output"].help, "FOLDER"),
    make_rig_option("page"),
    make_list_option("--viewer", "spawn|web|ADDRESS", RIG_OPTIONS["viewer"].text, "viewers"),
)
"""Options of the commands that start the nodes of a rig."""
resume_option = make_rig_option(
    "resume", type=click.Path(path_type=Path, file_okay=False, exists=True), metavar="RUN"
)

samples_option = make_list_option("--sample", "NAME", "Only this sample", "samples")
campaign_options = _combine(
    samples_option,
    click.option(
        "--impacts", type=click.IntRange(1), default=10, help="Accepted hits per sample. [10]"
    ),
    click.option(
        "--angles",
        default="",
        callback=parse_angles,
        metavar="DEGREES,...",
        help="Strike every sample from each of these release angles. [as in the rig file]",
    ),
)

files_argument = click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
results_options = _combine(
    click.option(
        "--full", "is_full", is_flag=True, help="Print every table and remark. [one screen]"
    ),
    json_option,
)
rig_options = _combine(make_rig_option("namespace", default=""), make_rig_option("network"))
"""Options of the commands that find a rig."""
recorded_rig_option = click.option(
    "--namespace",
    metavar="NAME",
    help="Which rig, where a recording holds several. [the only one]",
)


def load_rig(path: Path | None) -> "RigFile":
    """Read a rig file, by default the paper's, refuse what cannot work, warn of the unwise."""
    from impact_rig.configuration.rig_checks import require_rig
    from impact_rig.configuration.rig_file import load_rig_file
    from impact_rig.present.console import print_warning

    rig = load_rig_file(path)
    for warning in require_rig(rig):
        print_warning(warning)
    return rig


def set_discovery(*, network: bool) -> None:
    """Choose the discovery range of ROS; the environment goes first."""
    os.environ.update(make_network_variables(os.environ, network=network))


@contextlib.contextmanager
def use_private_domain() -> Iterator[None]:
    """Use a free ROS domain during the block, unless the environment names one.

    A demonstration must never reach the hammer of a rig that is up on the same network.
    """
    from impact_rig.nodes.discovery import use_own_domain

    with contextlib.nullcontext() if "ROS_DOMAIN_ID" in os.environ else use_own_domain():
        yield


measurement_options = _combine(
    click.option("--show", "is_shown", is_flag=True, help="Draw the traces that are taken."),
    click.option(
        "--channels",
        type=FILE,
        metavar="FILE.toml",
        help="Channels, sensors, masses, settings, as `import --template` prints it.",
    ),
    click.option(
        "--hammer-channel", metavar="NAME", help="Or its number. [by names and units in the file]"
    ),
    click.option("--sample-channel", metavar="NAME", help="As above."),
    click.option("--hammer-unit", metavar="UNIT", help="As m/s^2, g, N, lbf, V. [as in the file]"),
    make_quantity_option("--rate", "Hz", "25.6 kHz", "Sampling rate. [as in the file]"),
    make_quantity_option("--hammer-mass", "kg", "100 g", "m1."),
    make_quantity_option("--sample-mass", "kg", "102.38 g", "Without accelerometer."),
    click.option(
        "--rig-file",
        type=FILE,
        metavar="FILE.toml",
        help="Masses and settings; --sample is one of its samples.",
    ),
    click.option("--sample", metavar="NAME", help="Which sample was struck."),
    make_quantity_option(
        "--cutoff", "Hz", "50 kHz", "Low-pass, or off. [as recorded; else 50 kHz]"
    ),
    make_quantity_option(
        "--record-duration",
        "s",
        "2 ms",
        "Of each hit, if a file holds many. [the whole file is one hit]",
    ),
)
"""Options of files of other instruments: the fields of `MeasurementOptions`."""


def refuse_given(names: Collection[str], reason: str) -> None:
    """Raise `ParameterError` with a reason if the command got one of some options."""
    context = click.get_current_context()
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not ParameterSource.DEFAULT:
            raise ParameterError(f"{parameter.opts[0]} {reason}")
