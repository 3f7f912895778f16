"""``impact-rig replay``: publish a recording again, or estimate from it with fresh nodes."""

import contextlib
import os
import select
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import TextColumn

from impact_rig.cli import options
from impact_rig.cli.each_file import print_json
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.replayer_host import ReplayHost
from impact_rig.nodes.replayer_recording import RecordingToReplay
from impact_rig.present.terminal.console import make_console, print_warning
from impact_rig.present.terminal.results import print_results
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import results_to_json, write_results

DISCOVERY_TIME = 1.0
"""How long those who listen already may take to be found [s], our choice: on one host it is
tenths."""
DRAWING_PERIOD = 0.1
"""How often the progress is drawn anew [s]."""
STANDARD_INPUT = 0
QUIT = "q"


class ReplayView(ProgressBar):
    """Follows a replay on standard error; use it in a ``with`` statement.

    Parameters
    ----------
    console : Console
        Where to draw, if it is a terminal.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(console, "opening", TextColumn("{task.fields[place]}"), place="")
        self._drawn = 0.0

    def follow(self, replayer: ReplayerNode) -> None:
        """Show how far the replay is."""
        if time.monotonic() - self._drawn < DRAWING_PERIOD:
            return
        self._drawn = time.monotonic()
        state, rate = replayer.describe_state(), replayer.get_value("rate")
        speed = f"{rate:g} x" if rate else "as fast as possible"
        record = f"record {state['record']}, " if state["record"] else ""
        self.update(
            description=f"{state['message']}, {speed}",
            total=state["duration"] or None,
            completed=state["position"],
            place=f"{record}{state['position']:.1f} of {state['duration']:.1f} s",
        )


def play(parameters: Mapping[str, Any], namespace: str, *, by_steps: bool) -> None:
    """Replay a recording into the ROS domain at hand.

    Parameters
    ----------
    parameters : mapping
        Of the replayer.
    namespace : str
        To replay in.
    by_steps : bool
        Whether a person asks for one hit after the other.

    Raises
    ------
    RigError
        If the recording cannot be replayed, or is damaged.
    """
    with (
        ReplayHost(parameters, namespace) as host,
        ReplayView(make_console(stderr=True)) as view,
    ):
        for warning in host.open().warnings:
            print_warning(warning)
        host.spin(DISCOVERY_TIME)
        if parameters["required_subscribers"]:
            click.echo(f"waiting for {parameters['required_subscribers']}", err=True)
        asker = _Asker(host.replayer) if by_steps else None

        def follow() -> bool:
            view.follow(host.replayer)
            return asker is None or asker.look()

        host.play(follow)
    click.echo(f"{host.replayer.describe_state()['messages']} messages replayed", err=True)


class _Asker:
    """Makes a step for each line that comes in."""

    def __init__(self, replayer: ReplayerNode) -> None:
        self._replayer = replayer
        self._is_asked = False

    def look(self) -> bool:
        """Make a step if one is asked for; return whether to go on."""
        state = self._replayer.describe_state()
        if not self._replayer.is_paused:
            return True
        if not self._is_asked:
            self._is_asked = True
            if state["record"]:
                click.echo(f"record {state['record']} replayed", err=True)
            click.echo("Enter: the next hit; q: end", err=True)
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return True
        # Not through sys.stdin: what it keeps back, select does not see.
        line = os.read(STANDARD_INPUT, 1024).decode(errors="replace")
        if not line or line.strip().lower() == QUIT:
            return False
        self._is_asked = False
        self._replayer.step()
        return True


def estimate_again(parameters: Mapping[str, Any], output: Path | None, *, as_json: bool) -> None:
    """Replay a recording to a fresh estimator, and print what that finds.

    Parameters
    ----------
    parameters : mapping
        Of the replayer.
    output : Path or None
        Folder for results.json, of the last campaign as the live run left it; None: not written.
    as_json : bool
        Print JSON in place of tables: of one campaign, or a list if there are several.

    Raises
    ------
    RigError
        If the recording cannot be replayed, holds no hit, or the results cannot be written.
    """
    path = None if output is None else output / RESULTS_NAME
    if path is not None and path.exists():
        raise FileError(f"{path} exists already: choose another --output")
    found = _replay(parameters)
    if not found:
        raise FileError(
            f"{parameters['file']} holds no hit to estimate from: no block of what is replayed"
            " completes a record"
        )
    if path is not None:
        _write(path, found[-1])
    if as_json:
        print_json(list(map(results_to_json, found)), is_list=len(found) > 1)
        return
    console = make_console()
    for number, results in enumerate(found, start=1):
        if len(found) > 1:
            console.print(f"{parameters['file']}, campaign {number}\n", style="bold underline")
        print_results(console, results)


def _replay(parameters: Mapping[str, Any]) -> list[Results]:
    """Return the results of each campaign with hits."""
    found = []
    # Of its own namespace too: the domain may be given, and a rig be up in it.
    name = f"replay_{os.getpid()}"
    with (
        options.use_private_domain(),
        ReplayHost(parameters, name, with_estimator=True) as host,
        ReplayView(make_console(stderr=True)) as view,
    ):
        recording = host.open()
        for warning in recording.warnings:
            print_warning(warning)

        def follow() -> bool:
            view.follow(host.replayer)
            return True

        for start, end in _list_parts(recording, parameters["start"], parameters["end"]):
            host.choose_part(start, end)
            host.play(follow)
            results = host.fetch_results()
            if results.hits:
                found.append(results)
    return found


def _list_parts(
    recording: RecordingToReplay, start: float, end: float
) -> list[tuple[float, float]]:
    """Return from when to when the campaigns are replayed [s]; an end of 0: the recording's.

    One by one, since a set-up begins the estimates afresh.
    """
    recording.make_plan(start, end)
    return [
        (max(first, start), min(last or end, end or last))
        for first, last in recording.read_campaign_times()
        if (not last or last > start) and (not end or first < end)
    ]


def _write(path: Path, results: Results) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {path.parent} cannot be made: {error.strerror}") from None
    write_results(path, results)
    click.echo(f"{'results:':10} {path}", err=True)


FREE = "max"
"""The rate that means: as fast as the subscribers take it."""
FASTEST = 1000.0
"""Times the original speed [-]: the limit of the node's parameter."""
PLAYER_ONLY = ("loop", "all_topics", "step", "wait_for", "clock")
"""Options that a fresh estimator has no use for."""


def parse_rate(name: str, text: str) -> float:
    """Return the speed, part of the original's; 0: as fast as the subscribers take it."""
    if text == FREE:
        return 0.0
    with contextlib.suppress(ValueError):
        if 0.0 < float(text) <= FASTEST:
            return float(text)
    raise ParameterError(
        f"{name} is {text}: it must be a number above 0, up to {FASTEST:g}, or {FREE}"
    )


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig replay runs/2026-05-04T10-00-00        as it happened
      impact-rig replay session.mcap --rate 5 --loop 0  five times as fast, for ever
      impact-rig replay session.mcap --step             hit by hit: Enter
      impact-rig replay session.mcap --samples "steel small" --hits 17
      impact-rig replay session.mcap --start 60 --end 90 --clock 100
      impact-rig replay session.mcap --estimate         the tables, by a fresh estimator
      impact-rig replay session.mcap --estimate --json > results.json
    """
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--rate",
    type=options.Parsed(parse_rate),
    help="Part of the original speed, or max: as fast as the subscribers take it."
    " [1; with --estimate max]",
)
@click.option(
    "--start", type=click.FloatRange(0.0, 1e9), default=0.0, help="From here [s] of it. [0]"
)
@click.option(
    "--end", type=click.FloatRange(0.0, 1e9), default=0.0, help="Up to here [s] of it. [its end]"
)
@click.option("--loop", type=click.IntRange(0), default=1, help="How often; 0: for ever. [1]")
@click.option(
    "--samples", multiple=True, metavar="NAME", help="Only this sample's hits. May be repeated."
)
@click.option(
    "--hits",
    multiple=True,
    metavar="HIT",
    help="Only this hit, beside --samples: by record number, SAMPLE/IMPACT or"
    " SAMPLE/IMPACT.ATTEMPT. May be repeated.",
)
@click.option(
    "--clock",
    type=click.FloatRange(0.0, 10_000.0),
    default=0.0,
    metavar="HZ",
    help="Publish /clock so often, and with each message, for use_sim_time. [not at all]",
)
@click.option("--step", is_flag=True, help="Hit by hit: Enter gives the next one, q ends.")
@click.option(
    "--all-topics",
    is_flag=True,
    help="Also what was found and said, not only what an estimator works from.",
)
@click.option("--namespace", default="", help="ROS namespace to replay in. [none]")
@click.option(
    "--recorded-namespace", default="", help="Of the rig, if several are recorded. [found]"
)
@options.network_option
@click.option(
    "--wait-for", default="", metavar="NODES", help="Begin when these listen, by commas. [nobody]"
)
@click.option("--estimate", is_flag=True, help="Estimate with a fresh estimator, and print.")
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for results.json; with --estimate. [not written]",
)
@options.json_option
@click.pass_context
def command(
    context: click.Context,
    /,
    file: Path,
    rate: float | None,
    start: float,
    end: float,
    loop: int,
    samples: tuple[str, ...],
    hits: tuple[str, ...],
    clock: float,
    step: bool,
    all_topics: bool,
    namespace: str,
    recorded_namespace: str,
    network: bool,
    wait_for: str,
    estimate: bool,
    output: Path | None,
    as_json: bool,
) -> None:
    """Publish a recording again: a file, a folder as rosbag2 writes it, or that of a run.

    Set-up, blocks and releases go to who listens, an estimator or a visualizer for example, at
    the original speed, byte for byte. With --estimate a fresh estimator of its own listens, which
    gives the numbers of the live run, and of `impact-rig analyze`, bit by bit.
    """
    _check_options(context, estimate=estimate, output=output, as_json=as_json)
    parameters = {
        "autostart": False,
        "file": str(file),
        "rate": (0.0 if estimate else 1.0) if rate is None else rate,
        "topics": "all" if all_topics else "inputs",
        "samples": list(samples) or [""],
        "hits": list(hits) or [""],
        "start": start,
        "end": end,
        "loop": loop,
        "start_paused": step,
        "publish_clock": clock,
        "required_subscribers": "estimator" if estimate else wait_for,
        "recorded_namespace": recorded_namespace,
    }
    if estimate:
        options.set_discovery(network=False)
        estimate_again(parameters, output, as_json=as_json)
        return

    options.set_discovery(network=network)
    play(parameters, namespace, by_steps=step)


def _check_options(
    context: click.Context, *, estimate: bool, output: Path | None, as_json: bool
) -> None:
    """Refuse options that do not go together."""
    if not estimate:
        if output is not None or as_json:
            raise ParameterError("--output and --json are for results: they need --estimate")
        return
    options.refuse_given(
        context, PLAYER_ONLY, "is for those who listen: it goes without --estimate"
    )
