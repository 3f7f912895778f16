"""`impact-rig analyze`: recordings and plain traces, without ROS."""

from collections.abc import Sequence
from enum import Enum, auto
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from impact_rig.cli.quantity import Cutoff, Quantity
from impact_rig.cli.recording_analysis import AnalyzedCampaign, analyze_recording
from impact_rig.cli.settings_changes import SettingsChanges
from impact_rig.cli.trace_analysis import analyze_traces
from impact_rig.cli.trace_options import TraceOptions
from impact_rig.core.errors import ParameterError, RigError
from impact_rig.reporting.budget_tables import print_budgets
from impact_rig.reporting.results_file import format_json, results_to_json
from impact_rig.reporting.tables import print_results
from impact_rig.reporting.terminal import make_console
from impact_rig.reporting.trace_results import print_trace_results, trace_results_to_json

MCAP_SUFFIX = ".mcap"
RECORDING_NAME = "session.mcap"


class Form(Enum):
    """What is printed."""

    TABLES = auto()
    BUDGETS = auto()
    JSON = auto()


TRACE_ONLY = {
    "columns": "--columns",
    "rate": "--rate",
    "hammer_unit": "--hammer-unit",
    "sample_unit": "--sample-unit",
    "sample": "--sample",
    "rig_file": "--rig-file",
    "hammer_mass": "--hammer-mass",
    "sample_mass": "--sample-mass",
    "accelerometer_mass": "--accelerometer-mass",
    "hammer_stiffness": "--hammer-stiffness",
    "control": "--control",
}
"""Options that mean nothing for a recording, which explains itself."""


@click.command(
    "analyze",
    epilog="""
    \b
    Examples:
      impact-rig analyze runs/2025-01-31T12-00-00/session.mcap
      impact-rig analyze session.mcap --json > results.json
      impact-rig analyze session.mcap --reject 17 --accept "steel small/3.1"
      impact-rig analyze --cutoff off hit_1.npy hit_2.npy hit_3.npy
      impact-rig analyze --columns time,skip,hammer --hammer-unit g hit.csv
      impact-rig analyze --hammer-mass 100g --sample-mass "102.38 g" --control *.csv

    \b
    Plain traces (.npy, .csv, .txt) hold one hit of one sample each. Columns by default: hammer;
    time, hammer; time, hammer, specimen. Exit code: 2 if a file could not be used, which the
    others do not suffer from.
    """,
)
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
@click.option("--budget", is_flag=True, help="Print where each uncertainty comes from, too.")
@click.option(
    "--cutoff",
    type=Cutoff(),
    metavar="FREQUENCY",
    help="Low-pass, or off. [that of recording or rig file; else 50 kHz]",
)
@click.option(
    "--pulse-factor", type=float, metavar="F", help="τp = F w50: 2 versed-sine, 1.5 half-sine. [2]"
)
@click.option(
    "--double-hit-level",
    type=float,
    metavar="LEVEL",
    help="Second pulse that makes a double hit, part of the first. [0.05]",
)
@click.option(
    "--keep",
    type=click.IntRange(0),
    metavar="N",
    help="Average the N most consistent hits of a sample; 0: all. [that of the recording; else 0]",
)
@click.option(
    "--accept",
    multiple=True,
    metavar="HIT",
    help="Take a hit into the mean whatever its verdict: by record number, SAMPLE/IMPACT or"
    " SAMPLE/IMPACT.ATTEMPT; a plain trace by its file. May be repeated.",
)
@click.option(
    "--reject", multiple=True, metavar="HIT", help="Leave a hit out of the mean, named likewise."
)
@click.option("--columns", metavar="ROLE,...", help="Of time, hammer, specimen, skip.")
@click.option(
    "--rate", type=Quantity("Hz", "25.6 kHz"), metavar="RATE", help="Where there is no time."
)
@click.option(
    "--hammer-unit",
    type=click.Choice(["m/s^2", "g", "N"]),
    default="m/s^2",
    help="Of the hammer's column. [m/s^2]",
)
@click.option(
    "--sample-unit",
    type=click.Choice(["m/s^2", "g"]),
    default="m/s^2",
    help="Of the sample's column. [m/s^2]",
)
@click.option("--sample", metavar="NAME", help="Which sample was struck.")
@click.option(
    "--rig-file",
    "--setup",
    "rig_file",
    type=click.Path(path_type=Path),
    help="TOML file with masses and settings; --sample is one of its samples.",
)
@click.option("--hammer-mass", type=Quantity("kg", "100 g"), metavar="MASS", help="m1.")
@click.option(
    "--sample-mass", type=Quantity("kg", "102.38 g"), metavar="MASS", help="Without accelerometer."
)
@click.option(
    "--accelerometer-mass",
    type=Quantity("kg", "3 g"),
    metavar="MASS",
    help="Carried by the sample. [0]",
)
@click.option(
    "--hammer-stiffness",
    type=Quantity("N/m", "22.5 MN/m"),
    metavar="K",
    help="k1, from an earlier control experiment.",
)
@click.option("--control", is_flag=True, help="Hammer and sample are alike: k1 = k2 = 2 k_eq.")
@click.pass_context
def command(
    context: click.Context,
    /,
    files: tuple[Path, ...],
    as_json: bool,
    budget: bool,
    cutoff: float | None,
    pulse_factor: float | None,
    double_hit_level: float | None,
    keep: int | None,
    accept: tuple[str, ...],
    reject: tuple[str, ...],
    **trace_options: Any,
) -> None:
    """Estimate contact time, stiffness and damping from recordings or plain traces.

    A recording (.mcap, or the folder of a run) gives the numbers of the live run, bit by bit, and
    needs no further options. Plain traces of any laboratory give contact times, and with masses
    stiffness and damping as well. No ROS is needed.
    """
    recordings = [_find_recording(path) for path in files if _is_recording(path)]
    traces = [path for path in files if not _is_recording(path)]
    if recordings and traces:
        raise ParameterError(
            f"{recordings[0]} is a recording and {traces[0]} a plain trace: analyze them apart"
        )

    form = Form.JSON if as_json else Form.BUDGETS if budget else Form.TABLES
    changes = SettingsChanges(cutoff, pulse_factor, double_hit_level, keep)
    if recordings:
        _check_recording_options(context, [*accept, *reject] if len(recordings) > 1 else [])
        errors = _report_recordings(recordings, changes, accept, reject, form)
    else:
        task = TraceOptions(**trace_options, accept=accept, reject=reject).make_task(changes)
        analyzed = analyze_traces(traces, task)
        errors = list(analyzed.errors)
        if as_json:
            click.echo(format_json(trace_results_to_json(analyzed.results)), nl=False)
        elif analyzed.results.hits:
            console = make_console()
            print_trace_results(console, analyzed.results)
            if form is Form.BUDGETS:
                print_budgets(console, analyzed.results.samples, analyzed.results.hammer)
    for error in errors[:-1]:
        click.echo(f"error: {error}", err=True)
    if errors:
        raise RigError(errors[-1])


def _check_recording_options(context: click.Context, ambiguous: Sequence[str]) -> None:
    """Refuse options that a recording has no use for, and hits that may be any recording's."""
    for name, option in TRACE_ONLY.items():
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise ParameterError(f"{option} is for plain traces: a recording explains itself")
    if ambiguous:
        raise ParameterError(
            "--accept and --reject name hits of one recording: analyze recordings one by one"
        )


def _is_recording(path: Path) -> bool:
    return path.suffix.lower() == MCAP_SUFFIX or path.is_dir()


def _find_recording(path: Path) -> Path:
    return path / RECORDING_NAME if path.is_dir() else path


def _report_recordings(
    paths: Sequence[Path],
    changes: SettingsChanges,
    accept: Sequence[str],
    reject: Sequence[str],
    form: Form,
) -> list[str]:
    console = make_console()
    errors: list[str] = []
    found: list[AnalyzedCampaign] = []
    for path in paths:
        try:
            recording = analyze_recording(path, changes, accept, reject)
        except RigError as error:
            errors.append(str(error))
            continue
        for warning in recording.warnings:
            click.echo(f"warning: {warning}", err=True)
        found += recording.campaigns
        if form is Form.JSON:
            continue
        for number, campaign in enumerate(recording.campaigns, start=1):
            if len(recording.campaigns) > 1:
                console.print(f"{path}, campaign {number}\n", style="bold underline")
            elif len(paths) > 1:
                console.print(f"{path}\n", style="bold underline")
            if form is Form.BUDGETS:
                print_budgets(console, campaign.results.samples, campaign.results.hammer)
            print_results(console, campaign.results, campaign.setup.samples)
    if form is Form.JSON and found:
        contents = [results_to_json(campaign.results) for campaign in found]
        single = len(paths) == 1 and len(contents) == 1
        click.echo(format_json(contents[0] if single else contents), nl=False)
    return errors
