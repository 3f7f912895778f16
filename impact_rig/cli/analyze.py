"""`impact-rig analyze`: recordings and plain traces, without ROS."""

from collections.abc import Mapping, Sequence
from enum import Enum, auto
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import MofNCompleteColumn, TextColumn

from impact_rig.analysis.batch import BatchTask, analyze_batch
from impact_rig.analysis.measured_files import make_series
from impact_rig.analysis.recording_analysis import (
    AnalyzedRecording,
    analyze_recording,
)
from impact_rig.analysis.repeated_files import find_repeated_files
from impact_rig.analysis.trace_analysis import analyze_traces
from impact_rig.cli import options
from impact_rig.cli.each_file import print_json, raise_errors
from impact_rig.cli.progress_bar import PATIENCE, ProgressBar, TimeLeft
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.present.terminal.console import make_console, print_warning
from impact_rig.present.terminal.results import print_batch, print_budgets, print_results
from impact_rig.recordings.formats.registry import READABLE
from impact_rig.recordings.source import find_recording, is_recording
from impact_rig.results.batch import BatchCampaign
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import format_json, read_results, results_to_json
from impact_rig.results.trace_series import FileResults, trace_results_to_json
from impact_rig.results.traced_campaign import TracedCampaign

MEGABYTE = 1e6


class AnalysisProgress(ProgressBar):
    """Follows the analysis of one recording; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal nothing is shown.
    path : Path
        Of the recording.
    """

    def __init__(self, console: Console, path: Path) -> None:
        self._path = path
        self._what = ""
        super().__init__(
            console,
            str(path),
            TextColumn("{task.fields[figures]}"),
            TimeLeft(),
            patience=PATIENCE,
            figures="",
        )

    def follow(self, what: str, done: int, total: int) -> None:
        """Take what is done, ``reading`` [byte] or ``estimating`` [samples], and how far it is."""
        if what != self._what or not done:
            self._what = what
            self.restart(f"{what} {self._path}" if what == "reading" else what, total)
        if what == "reading":
            figures = f"{done / MEGABYTE:.0f} of {total / MEGABYTE:.0f} MB"
        else:
            figures = f"{done} of {total} samples"
        self.update(completed=done, figures=figures)


class BatchProgress(ProgressBar):
    """Follows a batch on standard error; a context manager.

    Parameters
    ----------
    console : Console
        Where to; without a terminal, a line for each recording instead of a bar.
    total : int
        Recordings.
    """

    def __init__(self, console: Console, total: int) -> None:
        self._total = total
        self._done = 0
        super().__init__(console, "recordings", MofNCompleteColumn(), TimeLeft(), total=total)

    def take(self, path: Path) -> None:
        """Take a finished recording."""
        self._done += 1
        self.update(completed=self._done)
        if not self.is_drawn:
            self.console.print(f"{self._done} of {self._total}: {path}", soft_wrap=True)


class Form(Enum):
    """What is printed."""

    TABLES = auto()
    BUDGETS = auto()
    JSON = auto()


def report_recording(
    path: Path,
    settings: Mapping[str, Any],
    accept: Sequence[str],
    reject: Sequence[str],
    form: Form,
) -> None:
    """Analyze one recording and print all that it says.

    Raises as `analyze_recording`.
    """
    with AnalysisProgress(make_console(stderr=True), path) as bar:
        recording = analyze_recording(path, settings, accept, reject, report=bar.follow)
    _print_warnings(recording)
    several = len(recording.campaigns) > 1
    if form is Form.JSON:
        contents = [results_to_json(campaign.results) for campaign in recording.campaigns]
        print_json(contents, is_list=several)
        return
    console = make_console()
    for number, campaign in enumerate(recording.campaigns, start=1):
        if several:
            console.print(f"{path}, campaign {number}\n", style="bold underline")
        _print(console, campaign.results, form, campaign.files)


def report_results(path: Path, form: Form) -> None:
    """Print what a results file says; raises as `read_results`."""
    results = read_results(path)
    if form is Form.JSON:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        _print(make_console(), results, form)


def _print(
    console: Console, results: Results, form: Form, files: Sequence[FileResults] = ()
) -> None:
    if form is Form.BUDGETS:
        print_budgets(console, results.samples, results.hammer)
    print_results(console, results, files)


def report_batch(
    paths: Sequence[Path],
    settings: Mapping[str, Any],
    form: Form,
    workers: int | None,
    scheduler: str | None,
) -> list[str]:
    """Analyze many recordings and print them in one table, or as one JSON list.

    Parameters
    ----------
    paths : sequence of Path
        Of the recordings, none of them twice.
    settings : mapping
        Settings to use in place of the recorded ones.
    form : Form
        Tables or JSON.
    workers : int or None
        Processes; None: what is fastest.
    scheduler : str or None
        Address of a Dask cluster to use instead.

    Returns
    -------
    list of str
        What is wrong with the recordings that could not be analyzed.

    Raises
    ------
    RigError
        If the cluster cannot be used.
    """
    # A cluster's workers stand in folders of their own.
    tasks = [BatchTask(path.absolute() if scheduler else path, settings) for path in paths]
    with BatchProgress(make_console(stderr=True), len(tasks)) as progress:
        outcomes = analyze_batch(tasks, workers, scheduler, progress.take, progress.console.print)
    campaigns: list[BatchCampaign] = []
    for path, outcome in zip(paths, outcomes, strict=True):
        if outcome.recording is None:
            continue
        _print_warnings(outcome.recording)
        campaigns += [
            BatchCampaign(path, number, campaign.results)
            for number, campaign in enumerate(outcome.recording.campaigns, start=1)
        ]
    if form is Form.JSON:
        entries = [
            {
                "recording": str(campaign.recording),
                "campaign": campaign.number,
                "results": results_to_json(campaign.results),
            }
            for campaign in campaigns
        ]
        click.echo(format_json(entries), nl=False)
    elif campaigns:
        print_batch(make_console(), campaigns)
    errors = [outcome.error for outcome in outcomes if outcome.recording is None]
    if errors and scheduler:
        click.echo("remark: all workers must find the recordings under the same paths", err=True)
    return errors


def _print_warnings(recording: AnalyzedRecording) -> None:
    for warning in recording.warnings:
        print_warning(warning)


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
@options.files_argument
@options.json_option
@click.option("--budget", is_flag=True, help="Print where each uncertainty comes from, too.")
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
@options.measurement_options
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
    accept: tuple[str, ...],
    reject: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    traces: Mapping[str, Any],
    settings: Mapping[str, Any],
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
    others = [path for path in paths if not is_recording(path)]
    if recordings and others:
        raise ParameterError(
            f"{recordings[0]} is a recording and {others[0]} a plain trace: analyze them apart"
        )
    if recordings:
        for name in traces:
            raise ParameterError(
                f"{options.make_flag(name)} is for plain traces: a recording explains itself"
            )
        if len(files) > 1:
            _check_batch_options(accept, reject, form)
            errors += report_batch(recordings, settings, form, workers, scheduler)
        else:
            report_recording(recordings[0], settings, accept, reject, form)
    elif others:
        if workers is not None or scheduler is not None:
            raise ParameterError("--workers and --scheduler are for recordings")
        analyzed = analyze_traces(others, make_series(traces, settings), accept, reject)
        errors += analyzed.errors
        for remark in analyzed.remarks:
            print_warning(remark)
        _print_traces(analyzed.campaign, form)
    errors = list(dict.fromkeys(errors))  # what is wrong with an option is so for all files
    raise_errors(errors)


def _print_traces(campaign: TracedCampaign, form: Form) -> None:
    if form is Form.JSON:
        content = trace_results_to_json(campaign.results, campaign.files)
        click.echo(format_json(content), nl=False)
    elif campaign.files:
        _print(make_console(), campaign.results, form, campaign.files)


def _find_files(named: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files and recordings that are meant, each once, and what is wrong with others."""
    found: list[Path] = []
    errors: list[str] = []
    for path in named:
        try:
            found.append(find_recording(path) if path.is_dir() else path)
        except FileError as error:
            kinds = sorted({file.suffix for file in path.iterdir()} & {*READABLE})
            named_so = [f"; of others name those that are meant: {path}/*{kind}" for kind in kinds]
            errors.append("".join([str(error), *named_so[:1]]))
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
    options.refuse_given(
        context,
        {parameter.name or "" for parameter in context.command.params} - RESULTS_OPTIONS,
        f"changes nothing in {results}, a results file: analyze its recording",
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
