"""Options that several commands share."""

import contextlib
import math
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from impact_rig.configuration.processes import make_network_variables
from impact_rig.configuration.units import parse_quantity
from impact_rig.core.errors import ParameterError
from impact_rig.core.sensors import UNITS
from impact_rig.devices.virtual.choices import Fault, Plant

if TYPE_CHECKING:
    from impact_rig.configuration.rig_file import RigFile


class Parsed(click.ParamType):
    """An option whose value a function parses."""

    name = "text"

    def __init__(self, parse: Callable[[str, str], Any]) -> None:
        self._parse = parse

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Any:
        """Return the parsed text; a default, which is no text, unchanged."""
        if not isinstance(value, str):
            return value
        return self._parse(param.opts[-1] if param else self.name, value)


def make_quantity(unit: str, example: str) -> Parsed:
    """Return an option type: a number in SI units, or a number with its unit."""

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
    from impact_rig.core.setup import check_release_angles

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
    """Join options into one decorator; the help lists them in this order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


FILE = click.Path(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)


def make_output_option(text: str, metavar: str = "FILE", *, required: bool = False) -> Decorator:
    """Return the option that says where a command writes."""
    return click.option("-o", "--output", type=FILE, metavar=metavar, required=required, help=text)


PLANTS = [plant.value for plant in Plant]
FAULTS = ", ".join(fault.value for fault in Fault)
SOURCE_KEYS = ("plant", "seed", "fault_probability")
"""Of the virtual rig's options; they are keys of the rig file's table [source]."""
notes_option = click.option(
    "--notes", default="", metavar="TEXT", help="Words to keep in the recording."
)
nodes_options = _combine(
    click.option(
        "--rig-file", type=FILE, help="Masses, samples and settings, in TOML. [the paper's rig]"
    ),
    click.option(
        "--plant",
        type=click.Choice(PLANTS),
        metavar="PLANT",
        help=f"Physics: {', '.join(PLANTS)}. [published]",
    ),
    click.option("--seed", type=click.IntRange(0), help="The same seed gives the same hits. [1]"),
    click.option(
        "--faults",
        "fault_probability",
        type=click.FloatRange(0.0, 1.0),
        help=f"Probability of each fault, for each hit: {FAULTS}.",
    ),
    click.option(
        "--continuous",
        is_flag=True,
        help="Stream both channels all the time, and find the impacts in the stream. [each hit]",
    ),
    click.option(
        "--record-stream", is_flag=True, help="With --continuous: record all of the stream."
    ),
    notes_option,
    make_output_option("Folder for recording, view and results. [runs/<time>]", "FOLDER"),
    click.option(
        "--viewer",
        "viewers",
        multiple=True,
        metavar="spawn|web|ADDRESS",
        help="Show it live, too: in a window, on a web page, in the Rerun viewer at"
        " rerun+http://HOST:9876/proxy; repeatable.",
    ),
)
"""Of the commands that start the nodes of a rig."""
resume_option = click.option(
    "--resume",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    metavar="RUN",
    help="Go on with the run that this folder holds.",
)

samples_option = click.option(
    "--sample",
    "samples",
    multiple=True,
    metavar="NAME",
    help="Only this sample; repeatable.",
)
campaign_options = _combine(
    samples_option,
    click.option(
        "--impacts", type=click.IntRange(1), default=10, help="Accepted hits per sample. [10]"
    ),
    click.option(
        "--angles",
        type=Parsed(parse_angles),
        default=(),
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
rig_options = _combine(
    click.option("--namespace", default="", help="ROS namespace of the rig. [none]"),
    click.option("--network", is_flag=True, help="Find nodes on other computers, too. [here]"),
)
"""Of the commands that find a rig."""


def load_rig(path: Path | None) -> "RigFile":
    """Read a rig file, by default the paper's, and warn of what its sensors lack."""
    from impact_rig.configuration.rig_file import list_rig_warnings, load_rig_file
    from impact_rig.present.terminal.console import print_warning

    rig = load_rig_file(path)
    for warning in list_rig_warnings(rig.setup):
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


measurement_options = _combine(
    click.option(
        "--channels",
        type=FILE,
        metavar="FILE.toml",
        help="Channels, sensors, masses, settings, as `import --template` prints it.",
    ),
    click.option("--hammer-unit", metavar="UNIT", help=f"{', '.join(UNITS)}. [as in the file]"),
    click.option(
        "--rate",
        type=make_quantity("Hz", "25.6 kHz"),
        metavar="RATE",
        help="Sampling rate. [as in the file]",
    ),
    click.option("--hammer-mass", type=make_quantity("kg", "100 g"), metavar="MASS", help="m1."),
    click.option(
        "--sample-mass",
        type=make_quantity("kg", "102.38 g"),
        metavar="MASS",
        help="Without accelerometer.",
    ),
    click.option(
        "--rig-file",
        type=FILE,
        metavar="FILE.toml",
        help="Masses and settings; --sample is one of its samples.",
    ),
    click.option("--sample", metavar="NAME", help="Which sample was struck."),
    click.option(
        "--cutoff",
        type=CUTOFF,
        metavar="FREQUENCY",
        help="Low-pass, or off. [as recorded; else 50 kHz]",
    ),
    click.option(
        "--record-duration",
        type=make_quantity("s", "2 ms"),
        metavar="TIME",
        help="Of each hit, if a file holds many. [the whole file is one hit]",
    ),
)
"""Options of files of other instruments; see `impact_rig.analysis.measured_files`."""


def drop_missing(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given."""
    return {name: value for name, value in values.items() if value is not None}


def refuse_given(names: Collection[str], reason: str) -> None:
    """Raise `ParameterError` with a reason if the command got one of some options."""
    context = click.get_current_context()
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not ParameterSource.DEFAULT:
            raise ParameterError(f"{parameter.opts[0]} {reason}")
