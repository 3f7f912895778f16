"""`impact-rig analyze`: recordings and plain traces, without ROS."""

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from impact_rig.analysis.analyze import ByHand, Settings, analyze
from impact_rig.analysis.batch import analyze_batch
from impact_rig.analysis.measured_files import MeasuredFiles, make_recorded_settings, make_series
from impact_rig.analysis.sources import RESULTS_SUFFIX, find_repeated_files
from impact_rig.cli import options
from impact_rig.cli.output import (
    print_json,
    print_places,
    print_taken,
    raise_errors,
    show_progress,
    show_results,
)
from impact_rig.configuration.rig_file import read_today
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.files.formats.arrays import is_list
from impact_rig.files.import_file import MeasurementOptions
from impact_rig.present.console import make_console, print_table, print_warning
from impact_rig.present.report.page import render_page
from impact_rig.present.screen import print_batch
from impact_rig.present.trend_page import make_trend_page
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.run import Run, find_runs
from impact_rig.recordings.source import find_bag, is_recording
from impact_rig.results.batch import BatchCampaign
from impact_rig.results.results_file import read_results, results_to_json
from impact_rig.results.trend import gather_trend, tabulate_trend
from impact_rig.results.wire import to_json


def analyze_runs(
    runs: Sequence[Run], settings: Settings, workers: int | None, scheduler: str | None
) -> tuple[list[BatchCampaign], list[str]]:
    """Analyze many runs; return their campaigns, and the errors of those that cannot be.

    Raises
    ------
    RigError
        If the Dask cluster cannot be used.
    """
    done = itertools.count(1)
    with show_progress() as follow:
        outcomes = analyze_batch(
            runs,
            settings,
            workers,
            scheduler,
            lambda: follow("analyzing recordings", next(done), len(runs)),
        )
    campaigns: list[BatchCampaign] = []
    errors: list[str] = []
    for run, outcome in zip(runs, outcomes, strict=True):
        if isinstance(outcome, RigError):
            errors.append(str(outcome))
            continue
        for warning in outcome.warnings:
            print_warning(warning)
        campaigns += [
            BatchCampaign(run.name, number, campaign.results, campaign.began)
            for number, campaign in enumerate(outcome.campaigns, start=1)
        ]
    return campaigns, errors


def report_batch(campaigns: Sequence[BatchCampaign], *, as_json: bool) -> None:
    """Print campaigns in one table, or as one JSON list."""
    if as_json:
        found = [(str(it.recording), it.number, results_to_json(it.results)) for it in campaigns]
        names = "recording", "campaign", "results"
        print_json([dict(zip(names, item, strict=True)) for item in found])
    elif campaigns:
        print_batch(make_console(), campaigns)


def report_trend(
    campaigns: Sequence[BatchCampaign], *, as_json: bool, errors: Sequence[str], page: Path | None
) -> None:
    """Print the control samples of campaigns, and write them to a page.

    Raises
    ------
    RigError
        If there is none, with the errors of runs that could not be read.
    """
    points, left_out = gather_trend(campaigns)
    for told in left_out:
        print_warning(f"left out of the trend: {told}")
    if not points:
        none = "no run has an accepted hit on its control sample: there is no trend"
        raise_errors([*errors, none])
    if as_json:
        print_json([to_json(point) for point in points])
    else:
        for table in tabulate_trend(points):
            print_table(make_console(), table)
    if page is not None:
        with write_new_file(page) as part:
            newest = max(campaigns, key=lambda campaign: campaign.began).results.setup
            document = make_trend_page(points, (*left_out, *errors), newest, read_today())
            part.write_text(render_page(document), encoding="utf-8")


def run(
    files: tuple[Path, ...],
    is_full: bool,
    as_json: bool,
    is_shown: bool,
    accept: tuple[str, ...],
    reject: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    trend: bool,
    output: Path | None,
    namespace: str | None,
    **given: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    show = partial(show_results, is_full=is_full, as_json=as_json)
    results = [path for path in files if path.suffix == RESULTS_SUFFIX and not is_list(path)]
    if results:
        unused = {"accept", "reject", "workers", "scheduler", "is_shown", *given}
        _show_again(results[0], files, unused, show)
        return
    measured = MeasurementOptions(**given)
    runs, others, errors = _sort_files(files, namespace, is_elsewhere=bool(scheduler))
    if runs and others:
        raise ParameterError(
            f"{runs[0].path} is a recording and {others[0]} a plain trace: analyze them apart"
        )
    if runs and is_shown:
        raise ParameterError("--show is for plain traces: impact-rig view shows a recording")
    if others:
        if trend or workers is not None or scheduler is not None:
            raise ParameterError("--workers, --scheduler and --trend are for recordings")
        traces = MeasuredFiles(others, make_series(measured))
        print_taken(traces, is_shown=is_shown, is_aside=as_json)
        errors += _report_traces(traces, accept, reject, show)
    elif len(runs) == 1 and not (trend or len(files) > 1):
        _report_run(runs[0], make_recorded_settings(measured), accept, reject, show, as_json)
    elif runs:
        if accept or reject:
            raise ParameterError(
                "--accept and --reject name hits of one recording: analyze recordings one by one"
            )
        settings = make_recorded_settings(measured)
        campaigns, failed = analyze_runs(runs, settings, workers, scheduler)
        errors += failed
        if trend or output:
            report_trend(campaigns, as_json=as_json, errors=errors, page=output)
        else:
            report_batch(campaigns, as_json=as_json)
    raise_errors(list(dict.fromkeys(errors)))  # an error of an option comes with each file


def _sort_files(
    files: Sequence[Path], namespace: str | None, *, is_elsewhere: bool
) -> tuple[list[Run], list[Path], list[str]]:
    """Return recordings, plain files, and the errors of those that are neither, or come twice."""
    found = [find_bag(path) for path in files]
    recorded = [path for path in found if _is_folder(path) or is_recording(path)]
    plain = [path for path in found if path not in recorded]
    # The workers of a cluster have other working folders.
    named = [path.absolute() if is_elsewhere else path for path in recorded]
    runs, errors = find_runs(named, namespace)
    repeated = find_repeated_files([*(run.files[0] for run in runs), *plain])
    return (
        [run for place, run in enumerate(runs) if place not in repeated],
        [path for place, path in enumerate(plain, len(runs)) if place not in repeated],
        [*errors, *repeated.values()],
    )


def _show_again(
    path: Path, files: Sequence[Path], unused: set[str], show: Callable[..., None]
) -> None:
    """Print a results file once more."""
    told = f"does not change {path}, a results file: analyze its recording"
    options.refuse_given(unused, told)
    if len(files) > 1:
        raise ParameterError(f"{path} is a results file: it must be the only file")
    show(path, [read_results(path)])


def _report_run(
    run: Run,
    settings: Settings,
    accept: Sequence[str],
    reject: Sequence[str],
    show: Callable[..., None],
    as_json: bool,
) -> None:
    """Analyze one recording and print its campaigns."""
    with show_progress() as follow:
        analysis = analyze(run, settings, ByHand(accept, reject), report=follow)
    show(run.name, [campaign.results for campaign in analysis.campaigns], analysis.warnings)
    if not as_json:
        print_places(recording=run.name)


def _report_traces(
    files: MeasuredFiles, accept: Sequence[str], reject: Sequence[str], show: Callable[..., None]
) -> list[str]:
    """Analyze plain files and print the results; return the errors."""
    if not files.hits:
        return files.errors
    analysis = analyze(files, by_hand=ByHand(accept, reject))
    (results,) = [campaign.results for campaign in analysis.campaigns]
    advice = files.advise(analysis.reasons)
    show(files.hits[0].path, [results], (*analysis.warnings, *advice))
    if not any(hit.accepted for hit in results.hits):
        return [*files.errors, "no hit was accepted: the contact time is not determined"]
    return files.errors


def _is_folder(path: Path) -> bool:
    """Return whether a path is a folder, or cannot be looked at: its reader says why."""
    try:
        return path.is_dir()
    except OSError:
        return True
