"""``impact-rig replay``: publish a recording again, or estimate from it with fresh nodes."""

from pathlib import Path
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.core.errors import ParameterError

FREE = "max"
"""The rate that means: as fast as the subscribers take it."""
FASTEST = 1000.0
"""Times the original speed [-]: the limit of the node's parameter."""
PLAYER_ONLY = {
    "loop": "--loop",
    "all_topics": "--all-topics",
    "step": "--step",
    "wait_for": "--wait-for",
    "clock": "--clock",
}
"""Options that a fresh estimator has no use for."""


class Rate(click.ParamType):
    """A speed: a number, or the word for as fast as possible."""

    name = "rate"

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Return the speed, part of the original's; 0: as fast as the subscribers take it."""
        if value == FREE:
            return 0.0
        try:
            rate = float(value)
        except ValueError:
            rate = 0.0
        if not 0.0 < rate <= FASTEST:
            self.fail(
                f"{value!r}: it must be a number above 0, up to {FASTEST:g}, or {FREE}", param, ctx
            )
        return rate


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
    type=Rate(),
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
        from impact_rig.cli.rigs.replay_estimation import estimate_again

        options.set_discovery(network=False)
        estimate_again(parameters, output, as_json=as_json)
        return
    from impact_rig.cli.rigs.replay_view import play

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
    for name, option in PLAYER_ONLY.items():
        if context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
            raise ParameterError(f"{option} is for those who listen: it goes without --estimate")
