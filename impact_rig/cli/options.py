"""Options that several commands share, and what they mean together."""

import functools
import json
import os
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from impact_rig.configuration.processes import (
    RECORDING_NAME,
    RESULTS_NAME,
    VIEW_NAME,
    list_rig_processes,
    make_run_folder_name,
)
from impact_rig.configuration.rig_file import RigFile, read_rig_file
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.paper import PAPER_SETUP
from impact_rig.devices.virtual.faults import Fault
from impact_rig.devices.virtual.plants import Plant

PLANTS = [plant.value for plant in Plant]
FAULTS = ", ".join(fault.value for fault in Fault)


def rig_file_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--rig-file``."""
    return click.option(
        "--rig-file",
        type=click.Path(path_type=Path),
        help="TOML file with masses, samples and settings; without it, the paper's rig.",
    )(command)


def virtual_rig_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of the virtual rig: ``--plant``, ``--seed``, ``--faults``."""
    for option in (
        click.option(
            "--faults",
            type=click.FloatRange(0.0, 1.0),
            help=f"Probability of each fault, for each hit: {FAULTS}.",
        ),
        click.option(
            "--seed", type=click.IntRange(0), help="The same seed gives the same hits. [1]"
        ),
        click.option(
            "--plant",
            type=click.Choice(PLANTS),
            help="Physics: the paper's tables, or the model (driven, as printed). [published]",
        ),
    ):
        command = option(command)
    return command


def output_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--output``."""
    return click.option(
        "--output",
        type=click.Path(path_type=Path, file_okay=False),
        help="Folder for recording, view and results. [runs/<time>]",
    )(command)


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


def impacts_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--impacts``."""
    return click.option(
        "--impacts", type=click.IntRange(1), default=10, help="Accepted hits per sample. [10]"
    )(command)


def json_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--json``."""
    return click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")(
        command
    )


def network_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--network``, which lets ROS look beyond this host."""
    return click.option(
        "--network",
        is_flag=True,
        help="Find the rig's nodes on other hosts too; by default ROS stays on this one.",
    )(command)


def set_discovery(*, network: bool) -> None:
    """Choose how far ROS looks; what the environment says goes first."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET" if network else "LOCALHOST")


def load_rig_file(path: Path | None) -> RigFile:
    """Read the rig file; without one, the paper's rig."""
    return RigFile(setup=PAPER_SETUP) if path is None else read_rig_file(path)


def merge_virtual(
    rig_file: RigFile, *, plant: str | None, seed: int | None, faults: float | None
) -> dict[str, Any]:
    """Return the virtual rig's parameters: the file's, overruled by the command line's."""
    given = {"plant": plant, "seed": seed, "fault_probability": faults}
    return {
        **rig_file.virtual,
        **{name: value for name, value in given.items() if value is not None},
    }


def parse_settings(settings: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Read ``NODE.PARAMETER=VALUE`` texts into parameters by node.

    Raises
    ------
    ParameterError
        If a text has another form, or the rig has no such node.
    """
    nodes = [process.name for process in list_rig_processes("")]
    parsed: dict[str, dict[str, Any]] = {}
    for text in settings:
        place, equals, value = text.partition("=")
        node, dot, parameter = place.partition(".")
        if not (equals and dot and parameter):
            raise ParameterError(
                f"--set {text!r}: write NODE.PARAMETER=VALUE, for example hammer.swing_time=0.3"
            )
        if node not in nodes:
            raise ParameterError(f"--set {text!r}: the rig has no node {node!r}, it has {nodes}")
        try:
            parsed.setdefault(node, {})[parameter] = json.loads(value)
        except json.JSONDecodeError:
            parsed.setdefault(node, {})[parameter] = value
    return parsed


def check_samples(rig_file: RigFile, names: tuple[str, ...]) -> None:
    """Require known samples; raises `ParameterError`."""
    for name in names:
        rig_file.setup.samples.find(name)
        if names.count(name) > 1:
            raise ParameterError(f"sample {name!r} is asked for twice: once is enough")


def make_run_folder(output: Path | None) -> Path:
    """Make the folder of a run, and refuse one that already holds a run.

    Raises
    ------
    FileError
        If the folder holds a run, or cannot be made or written.
    """
    folder = output or Path(make_run_folder_name(datetime.now().astimezone()))
    for name in (RECORDING_NAME, VIEW_NAME, RESULTS_NAME):
        if (folder / name).exists():
            raise FileError(
                f"the folder {folder} already holds a run ({name}): choose another --output"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made: {error.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise FileError(f"the folder {folder} cannot be written: choose another --output")
    return folder
