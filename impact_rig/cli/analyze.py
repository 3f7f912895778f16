"""`impact-rig analyze`: recordings and plain traces, without ROS."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from impact_rig.analysis.analyze import Analysis, analyze
from impact_rig.analysis.batch import analyze_batch
from impact_rig.analysis.measured_files import (
    MeasuredFiles,
    make_recorded_settings,
    make_series,
)
from impact_rig.analysis.repeated_files import find_repeated_files
from impact_rig.cli import options
from impact_rig.cli.each_file import print_json, raise_errors
from impact_rig.cli.progress import show_progress
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.present.terminal.console import make_console, print_warning
from impact_rig.present.terminal.results import print_batch, print_full, print_screen
from impact_rig.recordings.formats.registry import READABLE
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.source import find_recordings, is_recording
from impact_rig.results.batch import BatchCampaign
from impact_rig.results.results_file import format_json, read_results, results_to_json


def report_recording(
    path: Path,
    settings: Mapping[str, Any],
    accept: Sequence[str],
    reject: Sequence[str],
    *,
    is_full: bool,
    as_json: bool,
) -> None:
    """Analyze one recording and print the results.

    Raises as `read_recording` and `analyze`.
    """
    with show_progress() as follow:
        recording = analyze(read_recording(path), settings, accept, reject, report=follow)
    _report_analysis(path, recording, is_full=is_full, as_json=as_json)
    if not as_json:
        options.print_places(recording=path)


def report_files(
    paths: Sequence[Path],
    measured: Mapping[str, Any],
    accept: Sequence[str],
    reject: Sequence[str],
    *,
    is_full: bool,
    as_json: bool,
) -> list[str]:
    """Analyze plain files and print the results; return the errors.

    Raises as `analyze` and `make_series`.
    """
    files = MeasuredFiles(paths, make_series(measured))
    if not files.hits:
        return files.errors
    analysis = analyze(files, accept=accept, reject=reject)
    (campaign,) = analysis.campaigns
    warnings = (*analysis.warnings, *files.advise(campaign.results))
    analysis = replace(analysis, warnings=warnings)
    _report_analysis(paths[0], analysis, is_full=is_full, as_json=as_json)
    if not any(hit.accepted for hit in campaign.results.hits):
        return [*files.errors, "no hit was accepted: the contact time is not determined"]
    return files.errors


def _report_analysis(path: Path, analysis: Analysis, *, is_full: bool, as_json: bool) -> None:
    several = len(analysis.campaigns) > 1
    if as_json:
        _print_warnings(analysis)
        contents = [results_to_json(campaign.results) for campaign in analysis.campaigns]
        print_json(contents, is_list=several)
        return
    console = make_console()
    show = print_full if is_full else print_screen
    for number, campaign in enumerate(analysis.campaigns, start=1):
        if several:
            console.print(f"{path}, campaign {number}\n", style="bold underline")
        show(console, campaign.results, analysis.warnings)


def report_results(path: Path, *, is_full: bool, as_json: bool) -> None:
    """Print a results file; raises as `read_results`."""
    results = read_results(path)
    if as_json:
        click.echo(format_json(results_to_json(results)), nl=False)
    else:
        show = print_full if is_full else print_screen
        show(make_console(), results)


def report_batch(
    paths: Sequence[Path],
    settings: Mapping[str, Any],
    workers: int | None,
    scheduler: str | None,
    *,
    as_json: bool,
) -> list[str]:
    """Analyze many recordings and print them in one table, or as one JSON list.

    Returns the errors of recordings that could not be analyzed.

    Raises
    ------
    RigError
        If the Dask cluster cannot be used.
    """
    # The workers of a cluster have other working folders.
    named = [path.absolute() if scheduler else path for path in paths]
    done = itertools.count(1)
    with show_progress() as follow:
        outcomes = analyze_batch(
            named,
            settings,
            workers,
            scheduler,
            lambda _: follow("analyzing recordings", next(done), len(named)),
        )
    campaigns: list[BatchCampaign] = []
    for path, outcome in zip(paths, outcomes, strict=True):
        if outcome.recording is None:
            continue
        _print_warnings(outcome.recording)
        campaigns += [
            BatchCampaign(path, number, campaign.results)
            for number, campaign in enumerate(outcome.recording.campaigns, start=1)
        ]
    if as_json:
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


def _print_warnings(analysis: Analysis) -> None:
    for warning in analysis.warnings:
        print_warning(warning)


RESULTS_SUFFIX = ".json"
RESULTS_OPTIONS = {"files", "is_full", "as_json"}


def run(
    files: tuple[Path, ...],
    is_full: bool,
    as_json: bool,
    accept: tuple[str, ...],
    reject: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    **measured: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    measured = options.drop_missing(measured)
    if any(path.suffix == RESULTS_SUFFIX for path in files):
        _check_results_alone(files)
        report_results(files[0], is_full=is_full, as_json=as_json)
        return
    paths, errors = _find_files(files)
    recordings = [path for path in paths if is_recording(path)]
    others = [path for path in paths if not is_recording(path)]
    if recordings and others:
        raise ParameterError(
            f"{recordings[0]} is a recording and {others[0]} a plain trace: analyze them apart"
        )
    if recordings:
        settings = make_recorded_settings(measured)
        if len(files) > 1:
            _check_batch_options(accept, reject)
            errors += report_batch(recordings, settings, workers, scheduler, as_json=as_json)
        else:
            report_recording(
                recordings[0], settings, accept, reject, is_full=is_full, as_json=as_json
            )
    elif others:
        if workers is not None or scheduler is not None:
            raise ParameterError("--workers and --scheduler are for recordings")
        errors += report_files(others, measured, accept, reject, is_full=is_full, as_json=as_json)
    errors = list(dict.fromkeys(errors))  # an error of an option comes with each file
    raise_errors(errors)


def _find_files(named: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files and recordings to analyze, each once, and the errors of others."""
    found: list[Path] = []
    errors: list[str] = []
    for path in named:
        try:
            parts = find_recordings(path) if path.is_dir() else [path]
            # A resumed run is one recording in several files.
            found.append(parts[0] if len(parts) == 1 else path)
        except FileError as error:
            kinds = sorted({file.suffix for file in path.iterdir()} & {*READABLE})
            named_so = [f"; name other files one by one, like {path}/*{kind}" for kind in kinds]
            errors.append("".join([str(error), *named_so[:1]]))
        except OSError as error:
            errors.append(f"{path} cannot be read: {error.strerror}")
    repeated = find_repeated_files(found)
    paths = [path for place, path in enumerate(found) if place not in repeated]
    return paths, errors + list(repeated.values())


def _check_results_alone(files: Sequence[Path]) -> None:
    """Refuse options for hits: those of a results file are judged already."""
    results = next(path for path in files if path.suffix == RESULTS_SUFFIX)
    if len(files) > 1:
        raise ParameterError(f"{results} is a results file: it is shown alone, without others")
    command = click.get_current_context().command
    options.refuse_given(
        {parameter.name or "" for parameter in command.params} - RESULTS_OPTIONS,
        f"does not change {results}, a results file: analyze its recording",
    )


def _check_batch_options(accept: Sequence[str], reject: Sequence[str]) -> None:
    """Refuse to overrule verdicts of many recordings: a hit's name would mean several hits."""
    if accept or reject:
        raise ParameterError(
            "--accept and --reject name hits of one recording: analyze recordings one by one"
        )
