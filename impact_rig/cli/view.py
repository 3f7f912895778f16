"""``impact-rig view``: what a recording or results hold, in Rerun, without ROS."""

import contextlib
import re
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from impact_rig.analysis.recording_analysis import analyze_recording
from impact_rig.analysis.report_sources import RunSource, find_run
from impact_rig.cli.analyze import AnalysisProgress
from impact_rig.cli.each_file import process_each, raise_errors
from impact_rig.core.errors import DeviceError, FileError, RigError
from impact_rig.present.rerun.addresses import (
    LOOPBACK,
    check_viewer_address,
    choose_port,
    make_viewer_address,
)
from impact_rig.present.rerun.relay import WebPage
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.present.rerun.view_file import (
    check_view,
    join_views,
    send_view,
    write_view,
)
from impact_rig.present.rerun.viewer_program import check_screen, start_viewer
from impact_rig.present.terminal.console import make_console, print_warning
from impact_rig.recordings.new_file import write_new_file
from impact_rig.results.results_file import read_results
from impact_rig.results.traced_campaign import TracedCampaign

VIEW_SUFFIX = ".rrd"
"""Of Rerun's files."""
AWKWARD = re.compile(r"[^\w.-]+")
"""What file names had better not contain."""


def make_parts(path: Path, folder: Path, *, fit: bool) -> list[Path]:
    """Make a view of each campaign that a path means.

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
    list of Path
        Of the files; a view is taken as it is.

    Raises
    ------
    FileError
        If there is nothing of that name, or it cannot be read.
    """
    if path.suffix == VIEW_SUFFIX and not path.is_dir():
        check_view(path)
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
    """Return the campaigns of a source, and what the user should know."""
    if not source.is_recording:
        alone = TracedCampaign(read_results(source.path))
        return (alone,), ("results hold no traces: tables and figures alone are shown",)
    with AnalysisProgress(make_console(stderr=True), source.path) as bar:
        traced = analyze_recording(
            source.path, keep_traces=True, with_models=fit, report=bar.follow
        )
    remarks = [remark for campaign in traced.campaigns for remark in list_remarks(campaign)]
    return traced.campaigns, (*traced.warnings, *remarks)


def list_remarks(campaign: TracedCampaign) -> Iterator[str]:
    """Yield what of a campaign cannot be shown, and why, in words."""
    traces = {item.name: item for item in campaign.samples}
    for sample in campaign.results.samples:
        drawn = traces.get(sample.name)
        reason = "; ".join(sample.notes) or "the reason is not known"
        if drawn is None:
            yield f"{sample.name!r} is shown without mean and model: {reason}"
        elif not drawn.models:
            yield f"{sample.name!r} is shown without model: {reason}"


WATCH_TIME = 1.0
"""How long a window is watched [s], our choice: without a driver for the screen it gives up
sooner."""


@dataclass(frozen=True)
class _Places:
    """Where the view is to go."""

    output: Path | None
    connect: str
    has_page: bool
    has_window: bool


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig view runs/2026-05-04T10-00-00       in a window
      impact-rig view session.mcap -o campaign.rrd   as a file for Rerun
      impact-rig view session.mcap --web             in a browser, until Ctrl-C
      impact-rig view results.json                   tables and figures alone
      impact-rig view runs/* --connect rerun+http://desk:9876/proxy
    """
)
@click.argument(
    "paths", nargs=-1, required=True, metavar="PATH...", type=click.Path(path_type=Path)
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar=f"FILE{VIEW_SUFFIX}",
    help="Write a file for Rerun; none is overwritten.",
)
@click.option(
    "--connect",
    default="",
    metavar="ADDRESS",
    help="Show it in the viewer at rerun+http://HOST:9876/proxy.",
)
@click.option("--web", is_flag=True, help="Serve a page for this host's browsers, until Ctrl-C.")
@click.option("--spawn", is_flag=True, help="Open a window; so it is if nothing else is chosen.")
@click.option("--fit", is_flag=True, help="Fit the model too: 0.1 s for each sample.")
def command(
    paths: tuple[Path, ...], output: Path | None, connect: str, web: bool, spawn: bool, fit: bool
) -> None:
    """See model and measurement in Rerun: every hit, the samples, the campaign, the tables.

    PATH is a recording (.mcap, or the folder of a run or of rosbag2), results (.json), or a view
    that was written before (.rrd). In the viewer each campaign is a recording of its own. No ROS
    is needed.
    """
    places = _Places(output, connect, web, spawn or not (output or connect or web))
    _check(places)
    # Half a second to load, in which the recording is read.
    threading.Thread(target=_load_rerun, daemon=True).start()
    folder = Path(tempfile.mkdtemp(prefix="impact-rig-view-"))
    is_lent = False
    try:
        found, errors = process_each(paths, lambda path: make_parts(path, folder, fit=fit))
        parts = [part for each in found for part in each]
        if parts:
            is_lent, troubles = _show(parts, folder, places)
            errors += troubles
    finally:
        if not is_lent:
            shutil.rmtree(folder, ignore_errors=True)
    raise_errors(errors)


def _check(places: _Places) -> None:
    """Refuse what cannot be, before anything is read."""
    if places.output is not None:
        if places.output.suffix != VIEW_SUFFIX:
            raise FileError(f"--output is {str(places.output)!r}: it must end in {VIEW_SUFFIX}")
        if places.output.exists():
            raise FileError(f"{places.output} exists already: name another file with -o")
    if places.connect:
        check_viewer_address(places.connect)
    if places.has_window and not (places.output or places.connect or places.has_page):
        try:
            check_screen()
        except DeviceError as error:
            raise DeviceError(f"{error} (-o FILE{VIEW_SUFFIX}, --web, --connect)") from None


def _load_rerun() -> None:
    # Who uses it tells what is wrong.
    with contextlib.suppress(RigError):
        import_rerun()


def _show(parts: Sequence[Path], folder: Path, places: _Places) -> tuple[bool, list[str]]:
    """Show views wherever they are wanted.

    Returns
    -------
    tuple
        Whether a window has taken over the folder, and what could not be shown.
    """
    errors: list[str] = []

    def attempt(show: Callable[[], None]) -> bool:
        try:
            show()
        except RigError as error:
            errors.append(str(error))
            return False
        return True

    output = places.output
    if output is not None:
        attempt(lambda: _write(parts, output))
    if places.connect:
        attempt(lambda: _send(parts, places.connect))
    is_lent = places.has_window and attempt(lambda: _open_window(parts, folder))
    if places.has_page:
        attempt(lambda: _serve(parts))
    return is_lent, errors


def _write(parts: Sequence[Path], output: Path) -> None:
    with write_new_file(output) as part:
        join_views(part, parts)
    click.echo(f"view: {output}", err=True)


def _send(parts: Sequence[Path], address: str) -> None:
    for part in parts:
        send_view(part, address)
    click.echo(f"shown by the viewer at {address}", err=True)


def _open_window(parts: Sequence[Path], folder: Path) -> None:
    check_screen()
    command = ["--bind", LOOPBACK, "--port", "auto", *(str(part.resolve()) for part in parts)]
    viewer = start_viewer(command, waste=folder)
    try:
        code = viewer.wait(WATCH_TIME)
    except subprocess.TimeoutExpired:
        return
    if code:
        raise DeviceError(
            f"the viewer has ended at once (exit code {code}): it needs a screen and a graphics"
            f" driver; write the view to a file with -o, or serve it with --web"
        )


def _serve(parts: Sequence[Path]) -> None:
    page_port, port = choose_port(LOOPBACK, 0), choose_port(LOOPBACK, 0)
    errors: list[str] = []
    page = WebPage(
        LOOPBACK,
        page_port,
        make_viewer_address(LOOPBACK, port),
        ["--port", str(port), *map(str, parts)],
        announce=lambda text: click.echo(f"{text}; Ctrl-C ends it", err=True),
        notify=errors.append,
    )
    try:
        page.wait()
    except KeyboardInterrupt:
        # The way to end it.
        page.close()
    for error in errors:
        raise DeviceError(error)
