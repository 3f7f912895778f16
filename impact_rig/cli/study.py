"""``impact-rig study``: the estimators over the virtual rig, where the truth is known."""

import os
from datetime import datetime
from pathlib import Path

import click

from impact_rig.cli import options

PARTS = ("coverage", "efficiency", "bias", "selection", "speed")
"""As `impact_rig.study.cases.Part` has them; here so that the help needs no numpy."""


@click.command(
    "study",
    epilog="""
    \b
    Parts:
      coverage    how often 95 % intervals cover the truth
      efficiency  error over the Cramér-Rao bound, in white noise
      bias        against noise, bits, sampling rate, damping and pulse shape
      selection   faults found for the right reason, good hits lost
      speed       one identification, beside the same fit around an integrator

    \b
    Examples:
      impact-rig study                         all parts; minutes
      impact-rig study --quick                 all parts, roughly
      impact-rig study coverage speed --json > study.json
      impact-rig study --output studies/mine   goes on where it was stopped

    \b
    Exit code: 0 also where a goal is missed; the table says so.
    """,
)
@click.argument("parts", nargs=-1, metavar="[PART...]", type=click.Choice(PARTS))
@click.option(
    "--campaigns", type=click.IntRange(1), help="Per coverage case; the rest goes with it. [2000]"
)
@click.option("--quick", is_flag=True, help="60 campaigns: a look, no proof.")
@click.option("--jobs", type=click.IntRange(1), help="Processes. [one per core]")
@click.option(
    "--seed", type=click.IntRange(0), default=1, help="The same seed gives the same numbers. [1]"
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for data and figure; that of a stopped study: go on. [studies/<time>]",
)
@options.json_option
def command(
    parts: tuple[str, ...],
    campaigns: int | None,
    quick: bool,
    jobs: int | None,
    seed: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Run the estimators over the virtual rig, where the truth is known.

    Simulates campaigns and tells bias, spread, coverage and efficiency of the paper's method,
    free decay and identification, and whether the goals are reached. Ctrl-C stops it and keeps
    what is done; the same command with the same --output goes on.
    """
    from impact_rig.cli.study_view import StudyProgress, print_study
    from impact_rig.core.errors import ParameterError
    from impact_rig.reporting.terminal.console import make_console
    from impact_rig.results.results_file import format_json
    from impact_rig.study.cases import FULL_CAMPAIGNS, QUICK_CAMPAIGNS, Configuration, Part
    from impact_rig.study.files import results_to_json, write_figure, write_results
    from impact_rig.study.folder import StudyFolder
    from impact_rig.study.results import summarize
    from impact_rig.study.run import run_units

    if quick and campaigns is not None:
        raise ParameterError("--quick and --campaigns exclude each other: give one of them")
    configuration = Configuration(
        parts=tuple(map(Part, parts or PARTS)),
        campaigns=campaigns or (QUICK_CAMPAIGNS if quick else FULL_CAMPAIGNS),
        seed=seed,
    )
    path = output or Path("studies") / datetime.now().astimezone().strftime("%Y-%m-%dT%H-%M-%S")
    with StudyFolder(path, configuration) as folder:
        try:
            with StudyProgress(make_console(stderr=True)) as progress:
                run_units(configuration, folder, jobs or _count_cores(), progress.report)
        except KeyboardInterrupt:
            click.echo(
                f"stopped; what is done is kept: the same command with --output {path} goes on",
                err=True,
            )
            raise
        results = summarize(configuration, folder.finished)
        files = write_results(folder, results)
        try:
            files += write_figure(folder, results)
        except ModuleNotFoundError as error:
            click.echo(f"no figure was drawn: Python finds no module {error.name!r}", err=True)
    if as_json:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        print_study(make_console(), results)
    click.echo(f"in {path}: {', '.join(files)}", err=True)


def _count_cores() -> int:
    """Return the cores that this process may use."""
    return len(os.sched_getaffinity(0))
