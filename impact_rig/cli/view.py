"""``impact-rig view``: what a recording or results hold, in Rerun, without ROS."""

import contextlib
import re
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import click

from impact_rig.analysis.analyze import analyze
from impact_rig.analysis.report_sources import RunSource, find_run
from impact_rig.cli.each_file import process_each, raise_errors
from impact_rig.cli.progress import show_progress
from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.present.rerun.delivery import find_recording, join_views, send_view, write_view
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
from impact_rig.results.run import TracedCampaign

VIEW_SUFFIX = ".rrd"
"""Of Rerun's files."""
AWKWARD = re.compile(r"[^\w.-]+")
"""Characters that are replaced in file names."""


def make_parts(path: Path, folder: Path, *, fit: bool) -> list[Path]:
    """Make a view of each campaign of a recording, results or the folder of a run.

    The files go into `folder`; a view is returned unchanged. Warnings go to standard error.

    Raises
    ------
    FileError
        If there is no such file, or it cannot be read.
    """
    if path.suffix == VIEW_SUFFIX and not path.is_dir():
        find_recording(path)
        return [path]

    source = find_run(path)
    campaigns, warnings = _read_campaigns(source, fit=fit)
    for warning in warnings:
        print_warning(f"{path}: {warning}")
    title = AWKWARD.sub("_", source.title) or "view"
    first = sum(1 for _ in folder.iterdir()) + 1
    parts = []
    for number, campaign in enumerate(campaigns, start=first):
        parts.append(folder / f"{number}-{title}{VIEW_SUFFIX}")
        write_view(parts[-1], campaign)
    return parts


def _read_campaigns(
    source: RunSource, *, fit: bool
) -> tuple[tuple[TracedCampaign, ...], tuple[str, ...]]:
    """Return the campaigns of a source, and warnings."""
    if not source.is_recording:
        alone = TracedCampaign(read_results(source.path))
        return (alone,), ("results hold no traces: only tables and figures are shown",)
    with show_progress() as follow:
        traced = analyze(
            read_recording(source.named), keep_traces=True, with_models=fit, report=follow
        )
    remarks = [remark for campaign in traced.campaigns for remark in list_remarks(campaign)]
    return traced.campaigns, (*traced.warnings, *remarks)


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
    if sum(map(bool, (output, connect, web))) > 1:
        raise ParameterError("choose one of --output, --connect and --web")
    show = _choose_place(output, connect, web=web)
    # Half a second to load, in which the recording is read.
    threading.Thread(target=_load_rerun, daemon=True).start()
    with tempfile.TemporaryDirectory(prefix="impact-rig-view-") as folder:
        found, errors = process_each(paths, lambda path: make_parts(path, Path(folder), fit=fit))
        parts = [part for each in found for part in each]
        if parts:
            show(parts)
    raise_errors(errors)


def _choose_place(
    output: Path | None, connect: str, *, web: bool
) -> Callable[[Sequence[Path]], None]:
    """Return the function that shows views; refuse a place that cannot be used at once."""
    if output is not None:
        if output.suffix != VIEW_SUFFIX:
            raise FileError(f"--output is {str(output)!r}: it must end in {VIEW_SUFFIX}")
        if output.exists():
            raise FileError(f"{output} exists already: name another file with -o")
        return lambda parts: _write(parts, output)
    if connect:
        check_viewer_address(connect)
        return lambda parts: _send(parts, connect)
    if web:
        return _serve
    if missing := find_missing_screen():
        raise DeviceError(f"{missing} (-o FILE{VIEW_SUFFIX}, --web, --connect)")
    return _show_window


def _load_rerun() -> None:
    # The first use of it reports the error.
    with contextlib.suppress(RigError):
        import_rerun()


def _write(parts: Sequence[Path], output: Path) -> None:
    with write_new_file(output) as part:
        join_views(part, parts)
    click.echo(f"view: {output}", err=True)


def _send(parts: Sequence[Path], address: str) -> None:
    for part in parts:
        send_view(part, address)
    click.echo(f"shown by the viewer at {address}", err=True)


def _show_window(parts: Sequence[Path]) -> None:
    window = open_window(*map(str, parts))
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


def _serve(parts: Sequence[Path]) -> None:
    port = find_free_port()
    page = WebPage(make_viewer_address(port), ["--port", str(port), *map(str, parts)])
    click.echo(f"the view is at {page.address}; Ctrl-C ends it", err=True)
    # Ctrl-C is the way to end it.
    with contextlib.suppress(KeyboardInterrupt):
        page.wait()
        raise DeviceError("the web page has ended")
    page.close()
