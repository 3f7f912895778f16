"""What a person names for `impact-rig view`, made into files for Rerun's viewer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from impact_rig.analysis.report_sources import RunSource
    from impact_rig.results.traced_campaign import TracedCampaign

VIEW_SUFFIX = ".rrd"
"""Of Rerun's files."""
AWKWARD = re.compile(r"[^\w.-]+")
"""What file names had better not contain."""


def make_part(path: Path, folder: Path, *, fit: bool) -> Path:
    """Make a view of what a path means.

    What the user should know of it is told on standard error.

    Parameters
    ----------
    path : Path
        A recording, results, the folder of a run, or a view.
    folder : Path
        Where to.
    fit : bool
        Fit the model as well.

    Returns
    -------
    Path
        Of the file; a view is taken as it is.

    Raises
    ------
    FileError
        If there is nothing of that name, or it cannot be read.
    """
    from impact_rig.visualization.destinations.view_file import check_view, write_view

    if path.suffix == VIEW_SUFFIX and not path.is_dir():
        check_view(path)
        return path
    from impact_rig.analysis.report_sources import find_run

    source = find_run(path)
    campaigns, warnings = _read_campaigns(source, fit=fit)
    for warning in warnings:
        click.echo(f"warning: {path}: {warning}", err=True)
    number = sum(1 for _ in folder.iterdir()) + 1
    part = folder / f"{number}-{AWKWARD.sub('_', source.title) or 'view'}{VIEW_SUFFIX}"
    write_view(part, campaigns)
    return part


def _read_campaigns(
    source: RunSource, *, fit: bool
) -> tuple[tuple[TracedCampaign, ...], tuple[str, ...]]:
    """Return the campaigns of a source, and what the user should know."""
    from impact_rig.analysis.recording_traces import trace_recording
    from impact_rig.cli.analysis.analysis_progress import AnalysisProgress
    from impact_rig.reporting.terminal.console import make_console
    from impact_rig.results.results_file import read_results
    from impact_rig.results.traced_campaign import TracedCampaign

    if not source.is_recording:
        alone = TracedCampaign(read_results(source.path), (), ())
        return (alone,), ("results hold no traces: tables and figures alone are shown",)
    with AnalysisProgress(make_console(stderr=True), source.path) as bar:
        traced = trace_recording(source.path, with_models=fit, report=bar.report)
    remarks = [remark for campaign in traced.campaigns for remark in find_remarks(campaign)]
    return traced.campaigns, (*traced.warnings, *remarks)


def find_remarks(campaign: TracedCampaign) -> Iterator[str]:
    """Yield what of a campaign cannot be shown, and why, in words."""
    traces = {item.name: item for item in campaign.samples}
    for sample in campaign.results.samples:
        drawn = traces.get(sample.name)
        reason = "; ".join(sample.notes) or "the reason is not known"
        if drawn is None:
            yield f"{sample.name!r} is shown without mean and model: {reason}"
        elif not drawn.models:
            yield f"{sample.name!r} is shown without model: {reason}"
