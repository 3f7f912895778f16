"""What `impact-rig analyze` shows of recordings and results: one in full, many side by side."""

from collections.abc import Sequence
from enum import Enum, auto
from pathlib import Path

import click
from rich.console import Console

from impact_rig.analysis.batch import analyze_batch
from impact_rig.analysis.batch_task import BatchTask
from impact_rig.analysis.recording_analysis import AnalyzedRecording, analyze_recording
from impact_rig.analysis.settings_changes import SettingsChanges
from impact_rig.cli.analysis.analysis_progress import AnalysisProgress
from impact_rig.cli.analysis.batch_view import BatchProgress
from impact_rig.reporting.terminal.batch_tables import BatchCampaign, print_batch
from impact_rig.reporting.terminal.budget_tables import print_budgets
from impact_rig.reporting.terminal.campaign_tables import print_results
from impact_rig.reporting.terminal.console import make_console, print_warning
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import format_json, read_results, results_to_json


class Form(Enum):
    """What is printed."""

    TABLES = auto()
    BUDGETS = auto()
    JSON = auto()


def report_recording(
    path: Path,
    changes: SettingsChanges,
    accept: Sequence[str],
    reject: Sequence[str],
    form: Form,
) -> None:
    """Analyze one recording and print all that it says.

    Raises as `analyze_recording`.
    """
    with AnalysisProgress(make_console(stderr=True), path) as bar:
        recording = analyze_recording(path, changes, accept, reject, bar.report)
    _print_warnings(recording)
    several = len(recording.campaigns) > 1
    if form is Form.JSON:
        contents = [results_to_json(results) for results in recording.campaigns]
        click.echo(format_json(contents if several else contents[0]), nl=False)
        return
    console = make_console()
    for number, results in enumerate(recording.campaigns, start=1):
        if several:
            console.print(f"{path}, campaign {number}\n", style="bold underline")
        _print(console, results, form)


def report_results(path: Path, form: Form) -> None:
    """Print what a results file says; raises as `read_results`."""
    results = read_results(path)
    if form is Form.JSON:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        _print(make_console(), results, form)


def _print(console: Console, results: Results, form: Form) -> None:
    if form is Form.BUDGETS:
        print_budgets(console, results.samples, results.hammer)
    print_results(console, results)


def report_batch(
    paths: Sequence[Path],
    changes: SettingsChanges,
    form: Form,
    workers: int | None,
    scheduler: str | None,
) -> list[str]:
    """Analyze many recordings and print them in one table, or as one JSON list.

    Parameters
    ----------
    paths : sequence of Path
        Of the recordings, none of them twice.
    changes : SettingsChanges
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
    tasks = [BatchTask(path.absolute() if scheduler else path, changes) for path in paths]
    with BatchProgress(make_console(stderr=True), len(tasks)) as progress:
        outcomes = analyze_batch(tasks, workers, scheduler, progress.report, _remark)
    campaigns: list[BatchCampaign] = []
    for path, outcome in zip(paths, outcomes, strict=True):
        if outcome.recording is None:
            continue
        _print_warnings(outcome.recording)
        campaigns += [
            BatchCampaign(path, number, results)
            for number, results in enumerate(outcome.recording.campaigns, start=1)
        ]
    if form is Form.JSON:
        click.echo(format_json([_make_entry(campaign) for campaign in campaigns]), nl=False)
    elif campaigns:
        print_batch(make_console(), campaigns)
    errors = [outcome.error for outcome in outcomes if outcome.recording is None]
    if errors and scheduler:
        click.echo("remark: all workers must find the recordings under the same paths", err=True)
    return errors


def _remark(text: str) -> None:
    click.echo(text, err=True)


def _make_entry(campaign: BatchCampaign) -> dict[str, object]:
    return {
        "recording": str(campaign.recording),
        "campaign": campaign.number,
        "results": results_to_json(campaign.results),
    }


def _print_warnings(recording: AnalyzedRecording) -> None:
    for warning in recording.warnings:
        print_warning(warning)
