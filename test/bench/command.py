"""``impact-rig bench``: measure what is claimed, on this machine."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import click

from bench import PARTS
from impact_rig.cli import options

EXIT_MISSED = 1
"""Everything was measured, and a goal is missed."""
EXIT_SIGNALLED = 128
"""Ended by a signal, whose number is added, as shells have it."""


@click.command(
    "bench",
    epilog="""
    \b
    Parts, in the order in which they are run:
      start    start of the command line and of each node
      model    the model, beside an integrator and an exponential
      identification  its fit to both traces, beside the same around an integrator
      hit      a hit from blocks to verdict, beside the low-pass alone
      series   10 000 hits on one sample: what the last ones cost
      write    writing a recording, beside mcap.writer
      demo     the paper's campaign, from the command to the tables
      latency  from the release command to verdict and estimate
      read     reading a recording, beside mcap.reader doing nothing
      view     logging into Rerun, beside bare calls; view and report
      stream   the running stream at 2.5 MS/s per channel, and faster
      memory   by how much each node grows with a hit
      batch    many recordings on two Dask workers, beside one
      fuzz     damaged recordings: no hang, no crash, memory bounded
      kill     kill -9 in campaigns: no published verdict is lost
      faults   a fault in each campaign: no hit lost or double

    \b
    Examples:
      impact-rig bench                  everything: five minutes
      impact-rig bench --full           50 kills, 2000 damaged recordings ...
      impact-rig bench model hit
      impact-rig bench series --hits 100000
      impact-rig bench --json > bench.json
      impact-rig bench --against bench.json

    \b
    Exit code: 0 if all goals are reached, 1 if one is missed, 2 if something could not be
    measured. Other work on the machine falsifies the figures.
    """,
)
@click.argument("parts", nargs=-1, metavar="[PART...]", type=click.Choice(list(PARTS)))
@click.option(
    "--list",
    "only_list",
    is_flag=True,
    help="Say what the parts are and how long each takes, and end.",
)
@click.option(
    "--full",
    is_flag=True,
    help="As much as every goal asks for: 50 kills and 2000 damaged recordings, too, and 60 s of"
    " stream, 5 campaigns in part demo. Takes a quarter of an hour.",
)
@click.option(
    "--seconds",
    type=click.FloatRange(1.0),
    metavar="S",
    help="Of the fastest stream in part stream; 200 MB of disk for each. [15]",
)
@click.option(
    "--hits", type=click.IntRange(1), metavar="N", help="In part series; memory: 0.3 N. [10000]"
)
@click.option("--kills", type=click.IntRange(1), metavar="N", help="In parts kill and faults. [2]")
@click.option(
    "--mutations",
    type=click.IntRange(1),
    metavar="N",
    help="Damaged recordings in part fuzz. [60]",
)
@click.option(
    "--seed", type=click.IntRange(0), metavar="N", help="Of what is drawn at random. [1]"
)
@click.option(
    "--against",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Compare with what --json has printed before.",
)
@options.json_option
def command(
    parts: tuple[str, ...],
    only_list: bool,
    full: bool,
    against: Path | None,
    as_json: bool,
    **numbers: Any,
) -> None:
    """Measure what is claimed, on this machine.

    Each figure stands beside its peer or its limit, measured in the same run: median and spread
    of several measurements, what is asked, and whether it is reached.
    """
    from bench.measure import FULL, Extent, describe_machine, load_part, run_parts
    from bench.results import BenchProgress, print_end, print_part, read_bench, results_to_json
    from impact_rig.core.errors import RigError
    from impact_rig.present.terminal.console import make_console, print_warning
    from impact_rig.results.results_file import format_json

    names = list(dict.fromkeys(parts or PARTS))
    if only_list:
        for name in names:
            part = load_part(name)
            click.echo(f"{name:8} {part.seconds:4.0f} s  {part.title}")
        return
    given = {name: value for name, value in numbers.items() if value is not None}
    extent = replace(FULL if full else Extent(), **given)
    earlier = read_bench(against) if against else None
    if earlier and (difference := earlier.find_difference(describe_machine())):
        print_warning(difference)
    with _end_when_told(), BenchProgress(make_console(stderr=True)) as progress:
        results = run_parts(
            names,
            extent,
            progress.follow,
            lambda part: None if as_json else print_part(make_console(), part, earlier),
        )
    if as_json:
        click.echo(format_json(results_to_json(results, earlier)), nl=False)
    else:
        print_end(make_console(), results, earlier)
    for error in results.errors[:-1]:
        click.echo(f"error: {error}", err=True)
    if results.errors:
        raise RigError(results.errors[-1])
    if results.missed:
        sys.exit(EXIT_MISSED)


@contextlib.contextmanager
def _end_when_told() -> Iterator[None]:
    """Let SIGTERM end the bench as Ctrl-C does: with every process that it has started."""

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(EXIT_SIGNALLED + number)

    previous = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)
