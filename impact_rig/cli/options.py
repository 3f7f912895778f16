"""Options that several commands share."""

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from impact_rig.configuration.network import find_network_variables
from impact_rig.core.errors import ParameterError
from impact_rig.devices.virtual.choices import Fault, Plant

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


def continuous_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--continuous``."""
    return click.option(
        "--continuous",
        is_flag=True,
        help="Stream both channels all the time, and find the impacts in the stream. [each hit]",
    )(command)


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


def keep_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--keep``."""
    return click.option(
        "--keep",
        type=click.IntRange(0),
        default=0,
        metavar="N",
        help="Average the N most consistent of a sample's hits. [that of the rig file; else all]",
    )(command)


def check_keep(keep: int, impacts: int) -> None:
    """Raise `ParameterError` if more hits are to be kept than struck."""
    if keep > impacts:
        raise ParameterError(
            f"--keep {keep} asks for more hits than --impacts {impacts} gives: strike as many as"
            " are kept, or more"
        )


def json_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--json``."""
    return click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")(
        command
    )


def viewer_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--viewer``."""
    return click.option(
        "--viewer",
        "viewers",
        multiple=True,
        metavar="spawn|web|ADDRESS",
        help="Show it live, too: in a window, on a web page, in the Rerun viewer at"
        " rerun+http://HOST:9876/proxy; repeatable. The file is written all the same.",
    )(command)


def network_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--network``, which lets ROS look beyond this host."""
    return click.option(
        "--network",
        is_flag=True,
        help="Find the rig's nodes on other hosts too; by default ROS stays on this one.",
    )(command)


def set_discovery(*, network: bool) -> None:
    """Choose how far ROS looks; what the environment says goes first."""
    os.environ.update(find_network_variables(os.environ, network=network))
