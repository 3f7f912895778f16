"""`impact-rig analyze`: recordings and plain traces, without ROS."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from impact_rig.analysis.repeated_files import find_repeated_files
from impact_rig.analysis.settings_changes import SettingsChanges
from impact_rig.analysis.trace_analysis import analyze_traces
from impact_rig.analysis.trace_options import TraceOptions
from impact_rig.cli.analysis.channel_options import add_channel_options
from impact_rig.cli.analysis.recording_report import (
    Form,
    report_batch,
    report_recording,
    report_results,
)
from impact_rig.cli.quantity import Cutoff
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.recording.reading.source import find_recording, is_recording
from impact_rig.reporting.terminal.budget_tables import print_budgets
from impact_rig.reporting.terminal.console import make_console
from impact_rig.reporting.terminal.trace_tables import print_trace_results
from impact_rig.results.results_file import format_json
from impact_rig.results.trace_series import TraceResults, trace_results_to_json

RESULTS_SUFFIX = ".json"
RESULTS_OPTIONS = {"files", "as_json", "budget"}


@click.command(
    "analyze",
    epilog="""
    \b
    Examples:
      impact-rig analyze runs/2025-01-31T12-00-00/session.mcap
      impact-rig analyze session.mcap --json > results.json
      impact-rig analyze results.json          the tables once more
      impact-rig analyze runs/* --json > all.json
      impact-rig analyze --scheduler tcp://cluster:8786 /data/*.mcap
      impact-rig analyze session.mcap --reject 17 --accept "steel small/3.1"
      impact-rig analyze --cutoff off hit_1.npy hit_2.npy hit_3.npy
      impact-rig analyze --columns time,skip,hammer --hammer-unit g hit.csv
      impact-rig analyze --hammer-mass 100g --sample-mass "102.38 g" --control *.csv

    \b
    Plain traces (.lvm, .tdms, .uff, .mat, .csv, .npy and more) hold one hit of one sample each.
    Columns by default: hammer; time, hammer; time, hammer, specimen.
    Many recordings make one table, or one JSON list, in the order given. Exit code: 2 if a file
    could not be used or is named twice, which the others do not suffer from.
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
@add_channel_options
@click.option(
    "--workers",
    type=click.IntRange(1),
    metavar="N",
    help="Processes for many recordings. [one per core; one for a few small ones]",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Use this Dask cluster; its workers must find the recordings under the same paths.",
)
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
    workers: int | None,
    scheduler: str | None,
    **trace_options: Any,
) -> None:
    """Estimate contact time, stiffness and damping from recordings or plain traces.

    A recording (.mcap, or the folder of a run) gives the numbers of the live run, bit by bit, and
    needs no further options; many are analyzed side by side. Plain traces of any laboratory give
    contact times, and with masses stiffness and damping as well. A results.json is shown as it
    is. No ROS is needed.
    """
    form = Form.JSON if as_json else Form.BUDGETS if budget else Form.TABLES
    if any(path.suffix == RESULTS_SUFFIX for path in files):
        _check_results_alone(context, files)
        report_results(files[0], form)
        return
    paths, errors = _find_files(files)
    recordings = [path for path in paths if is_recording(path)]
    traces = [path for path in paths if not is_recording(path)]
    if recordings and traces:
        raise ParameterError(
            f"{recordings[0]} is a recording and {traces[0]} a plain trace: analyze them apart"
        )

    changes = SettingsChanges(cutoff, pulse_factor, double_hit_level, keep)
    if recordings:
        is_batch = len(files) > 1
        _check_recording_options(context)
        if is_batch:
            _check_batch_options(accept, reject, form)
            errors += report_batch(recordings, changes, form, workers, scheduler)
        else:
            report_recording(recordings[0], changes, accept, reject, form)
    elif traces:
        if workers is not None or scheduler is not None:
            raise ParameterError("--workers and --scheduler are for recordings")
        series = TraceOptions(**trace_options).make_series(changes)
        analyzed = analyze_traces(traces, series, accept, reject)
        errors += analyzed.errors
        _print_traces(analyzed.results, form)
    errors = list(dict.fromkeys(errors))  # what is wrong with an option is so for all files
    for error in errors[:-1]:
        click.echo(f"error: {error}", err=True)
    if errors:
        raise RigError(errors[-1])


def _print_traces(results: TraceResults, form: Form) -> None:
    if form is Form.JSON:
        click.echo(format_json(trace_results_to_json(results)), nl=False)
    elif results.hits:
        console = make_console()
        print_trace_results(console, results)
        if form is Form.BUDGETS:
            print_budgets(console, results.samples, results.hammer)


def _find_files(named: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files and recordings that are meant, each once, and what is wrong with others."""
    found: list[Path] = []
    errors: list[str] = []
    for path in named:
        try:
            found.append(find_recording(path) if path.is_dir() else path)
        except FileError as error:
            errors.append(str(error))
        except OSError as error:
            errors.append(f"{path} cannot be read: {error.strerror}")
    repeated = find_repeated_files(found)
    paths = [path for place, path in enumerate(found) if place not in repeated]
    return paths, errors + list(repeated.values())


def _check_results_alone(context: click.Context, files: Sequence[Path]) -> None:
    """Refuse what a results file has no use for: its hits are judged, its numbers estimated."""
    results = next(path for path in files if path.suffix == RESULTS_SUFFIX)
    if len(files) > 1:
        raise ParameterError(f"{results} is a results file: it is shown alone, without others")
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name not in RESULTS_OPTIONS and source is not ParameterSource.DEFAULT:
            raise ParameterError(
                f"{parameter.opts[0]} changes nothing in {results}, a results file: analyze its"
                " recording"
            )


def _check_recording_options(context: click.Context) -> None:
    """Refuse options that a recording has no use for."""
    names = {field.name for field in fields(TraceOptions)}
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if parameter.name in names and source is not ParameterSource.DEFAULT:
            raise ParameterError(
                f"{parameter.opts[0]} is for plain traces: a recording explains itself"
            )


def _check_batch_options(accept: Sequence[str], reject: Sequence[str], form: Form) -> None:
    """Refuse what speaks of one recording's hits, and what one table has no room for."""
    if accept or reject:
        raise ParameterError(
            "--accept and --reject name hits of one recording: analyze recordings one by one"
        )
    if form is Form.BUDGETS:
        raise ParameterError(
            "--budget is for one recording: analyze recordings one by one, or take --json, which"
            " has all budgets"
        )
