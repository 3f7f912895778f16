"""``impact-rig bench``: measure what is claimed, on this machine."""

import sys

import click

from impact_rig.cli import options

PARTS = ("model", "hit", "write", "read", "batch", "fuzz", "stream", "kill")
"""As `impact_rig.bench.run.PARTS` has them; here so that the help needs none of them."""
EXIT_MISSED = 1
"""Everything was measured, and a goal is missed."""


@click.command(
    "bench",
    epilog="""
    \b
    Parts:
      model   the model, beside an integrator and an exponential
      hit     a hit from blocks to verdict, beside the low-pass alone
      read    reading a recording, beside mcap.reader doing nothing
      write   writing one, beside mcap.writer
      batch   many recordings on two Dask workers, beside one
      fuzz    damaged recordings: no hang, no crash, memory bounded
      stream  continuous recording at 2.5 MS/s per channel, two channels
      kill    kill -9 in the middle of campaigns: no published verdict is lost

    \b
    Examples:
      impact-rig bench                  everything: a quarter of an hour
      impact-rig bench read batch
      impact-rig bench stream --seconds 600
      impact-rig bench --json > bench.json

    \b
    Exit code: 0 if all goals are reached, 1 if one is missed, 2 if something could not be
    measured. Other work on the machine falsifies the figures.
    """,
)
@click.argument("parts", nargs=-1, metavar="[PART...]", type=click.Choice(PARTS))
@click.option("--list", "only_list", is_flag=True, help="Say what the parts are, and end.")
@click.option(
    "--seconds",
    type=click.FloatRange(1.0),
    metavar="S",
    default=60.0,
    help="Of continuous recording; 20 MB of disk for each. [60]",
)
@click.option(
    "--kills", type=click.IntRange(1), metavar="N", default=50, help="In part kill. [50]"
)
@click.option(
    "--mutations",
    type=click.IntRange(1),
    metavar="N",
    default=2000,
    help="Damaged recordings in part fuzz. [2000]",
)
@click.option("--seed", type=click.IntRange(0), default=1, help="Of what is drawn at random. [1]")
@options.json_option
def command(
    parts: tuple[str, ...],
    only_list: bool,
    seconds: float,
    kills: int,
    mutations: int,
    seed: int,
    as_json: bool,
) -> None:
    """Measure what is claimed, on this machine.

    Each figure stands beside its peer or its limit, measured in the same run: median and spread
    of several measurements, what is asked, and whether it is reached.
    """
    from impact_rig.bench.part import Extent
    from impact_rig.bench.run import load_part, run_parts
    from impact_rig.cli.bench_view import BenchProgress, print_bench, results_to_json
    from impact_rig.core.errors import RigError
    from impact_rig.reporting.terminal.console import make_console
    from impact_rig.results.results_file import format_json

    names = list(dict.fromkeys(parts or PARTS))
    if only_list:
        for name in names:
            click.echo(f"{name:8}{load_part(name).title}")
        return
    extent = Extent(seconds=seconds, kills=kills, mutations=mutations, seed=seed)
    with BenchProgress(make_console(stderr=True)) as progress:
        results = run_parts(names, extent, progress.report)
    if as_json:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        print_bench(make_console(), results)
    for error in results.errors[:-1]:
        click.echo(f"error: {error}", err=True)
    if results.errors:
        raise RigError(results.errors[-1])
    if results.missed:
        sys.exit(EXIT_MISSED)
