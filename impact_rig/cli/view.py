"""``impact-rig view``: what a recording or results hold, in Rerun, without ROS."""

import contextlib
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from impact_rig.analysis.analyze import analyze
from impact_rig.analysis.sources import find_run
from impact_rig.cli.output import process_each, raise_errors, show_progress
from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.present.rerun.delivery import join_views, send_view, write_view
from impact_rig.present.rerun.viewers import (
    WebPage,
    check_viewer_address,
    find_free_port,
    find_missing_screen,
    import_rerun,
    make_viewer_address,
    open_window,
)
from impact_rig.present.terminal.console import print_warning
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.reader import read_recording
from impact_rig.results.results_file import read_results
from impact_rig.results.traces import TracedCampaign

VIEW_SUFFIX = ".rrd"  # of Rerun's files


def read_campaigns(path: Path, *, fit: bool) -> tuple[TracedCampaign, ...]:
    """Return the campaigns of a recording, results or the folder of a run.

    Warnings go to standard error.

    Raises
    ------
    FileError
        If there is no such file, or it cannot be read.
    """
    source = find_run(path)
    if not source.is_recording:
        print_warning(f"{path}: results hold no traces: only tables and figures are shown")
        return (TracedCampaign(read_results(source.path)),)
    with show_progress() as follow:
        traced = analyze(
            read_recording(source.named), keep_traces=True, with_models=fit, report=follow
        )
    remarks = [remark for campaign in traced.campaigns for remark in list_remarks(campaign)]
    for warning in (*traced.warnings, *remarks):
        print_warning(f"{path}: {warning}")
    return traced.campaigns


def list_remarks(campaign: TracedCampaign) -> Iterator[str]:
    """Yield for each sample which part cannot be shown, and why."""
    traces = {item.name: item for item in campaign.samples}
    for sample in campaign.results.samples:
        drawn = traces.get(sample.name)
        reason = "; ".join(sample.notes) or "the reason is not known"
        if drawn is None:
            yield f"{sample.name!r} is shown without mean and model: {reason}"
        elif not drawn.models:
            yield f"{sample.name!r} is shown without model: {reason}"


def run(paths: tuple[Path, ...], output: Path | None, connect: str, web: bool, fit: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""
    _check_place(output, connect, web=web)
    # Half a second to load, in which the recording is read.
    threading.Thread(target=_load_rerun, daemon=True).start()
    found, errors = process_each(paths, lambda path: read_campaigns(path, fit=fit))
    campaigns = [campaign for each in found for campaign in each]
    if campaigns and connect:
        for campaign in campaigns:
            send_view(campaign, connect)
        click.echo(f"shown by the viewer at {connect}", err=True)
    elif campaigns:
        with tempfile.TemporaryDirectory(prefix="impact-rig-view-") as folder:
            files = [
                Path(folder, f"{number}{VIEW_SUFFIX}") for number in range(1, len(campaigns) + 1)
            ]
            for file, campaign in zip(files, campaigns, strict=True):
                write_view(file, campaign)
            if output is not None:
                _write(files, output)
            elif web:
                _serve(files)
            else:
                _show_window(files)
    raise_errors(errors)


def _check_place(output: Path | None, connect: str, *, web: bool) -> None:
    """Refuse a place that cannot be used, before anything is read."""
    if sum(map(bool, (output, connect, web))) > 1:
        raise ParameterError("choose one of --output, --connect and --web")
    if output is not None and output.suffix != VIEW_SUFFIX:
        raise FileError(f"--output is {str(output)!r}: it must end in {VIEW_SUFFIX}")
    if output is not None and output.exists():
        raise FileError(f"{output} exists already: name another file with -o")
    if connect:
        check_viewer_address(connect)
    elif output is None and not web and (missing := find_missing_screen()):
        raise DeviceError(f"{missing} (-o FILE{VIEW_SUFFIX}, --web, --connect)")


def _load_rerun() -> None:
    # The first use of it reports the error.
    with contextlib.suppress(RigError):
        import_rerun()


def _write(files: Sequence[Path], output: Path) -> None:
    with write_new_file(output) as part:
        join_views(part, files)
    click.echo(f"view: {output}", err=True)


def _show_window(files: Sequence[Path]) -> None:
    window = open_window(*map(str, files))
    try:
        code = window.wait()
    except KeyboardInterrupt:
        window.terminate()
        raise
    if code:
        raise DeviceError(
            f"the viewer has ended with exit code {code}: it needs a screen and a graphics"
            f" driver; write the view to a file with -o, or serve it with --web"
        )


def _serve(files: Sequence[Path]) -> None:
    port = find_free_port()
    page = WebPage(make_viewer_address(port), ["--port", str(port), *map(str, files)])
    click.echo(f"the view is at {page.address}; Ctrl-C ends it", err=True)
    # Ctrl-C is the way to end it.
    with contextlib.suppress(KeyboardInterrupt):
        page.wait()
        raise DeviceError("the web page has ended")
    page.close()
