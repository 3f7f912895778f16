"""``impact-rig view``: what a recording or results hold, in Rerun, without ROS."""

import contextlib
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from impact_rig.cli.recordings.each_file import process_each, raise_errors
from impact_rig.cli.recordings.view_parts import VIEW_SUFFIX, make_part
from impact_rig.core.errors import DeviceError, FileError, RigError

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
        parts, errors = process_each(paths, lambda path: make_part(path, folder, fit=fit))
        if parts:
            is_lent, troubles = _show(parts, folder, places)
            errors += troubles
    finally:
        if not is_lent:
            shutil.rmtree(folder, ignore_errors=True)
    raise_errors(errors)


def _check(places: _Places) -> None:
    """Refuse what cannot be, before anything is read."""
    from impact_rig.visualization.destinations.addresses import check_viewer_address
    from impact_rig.visualization.destinations.program import check_screen

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
    from impact_rig.visualization.rerun_sdk import import_rerun

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
    from impact_rig.recording.writing.new_file import write_new_file
    from impact_rig.visualization.destinations.view_file import join_views

    with write_new_file(output) as part:
        join_views(part, parts)
    click.echo(f"view: {output}", err=True)


def _send(parts: Sequence[Path], address: str) -> None:
    from impact_rig.visualization.destinations.view_file import send_view

    for part in parts:
        send_view(part, address)
    click.echo(f"shown by the viewer at {address}", err=True)


def _open_window(parts: Sequence[Path], folder: Path) -> None:
    from impact_rig.visualization.destinations.addresses import LOOPBACK
    from impact_rig.visualization.destinations.program import check_screen, start_viewer

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
    from impact_rig.visualization.destinations.addresses import (
        LOOPBACK,
        find_port,
        make_viewer_address,
    )
    from impact_rig.visualization.destinations.web_page import WebPage

    page_port, port = find_port(LOOPBACK, 0), find_port(LOOPBACK, 0)
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
