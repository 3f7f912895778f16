"""``impact-rig view``: what a recording or results hold, in Rerun, without ROS."""

import contextlib
import itertools
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

import click

from impact_rig.analysis.analyze import analyze
from impact_rig.analysis.sources import find_run
from impact_rig.cli.output import process_each, raise_errors, show_progress
from impact_rig.core.given.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.present.console import print_warning
from impact_rig.present.rerun.delivery import join_views, write_view
from impact_rig.present.rerun.viewers import (
    WebPage,
    find_free_port,
    find_missing_screen,
    import_rerun,
    make_viewer_address,
    open_window,
)
from impact_rig.recordings.new_file import write_new_file
from impact_rig.results.results_file import read_results
from impact_rig.results.traces import TracedCampaign

VIEW_SUFFIX = ".rrd"  # of Rerun's files


def read_campaigns(path: Path, namespace: str | None) -> tuple[TracedCampaign, ...]:
    """Return the campaigns of a recording, results or the folder of a run.

    Warnings go to standard error.

    Raises
    ------
    FileError
        If there is no such file, or it cannot be read.
    """
    source = find_run(path, namespace)
    if source.run is None:
        print_warning(f"{path}: results hold no traces: only tables and figures are shown")
        return (TracedCampaign(read_results(source.results)),)
    with show_progress() as follow:
        traced = analyze(source.run, keep_traces=True, most_traces=sys.maxsize, report=follow)
    for warning in traced.warnings:
        print_warning(f"{path}: {warning}")
    return traced.campaigns


def run(paths: tuple[Path, ...], output: Path | None, web: bool, namespace: str | None) -> None:
    """Run the command; its options are declared in `commands.py`."""
    _check_place(output, web=web)
    # Half a second to load, in which the recording is read.
    threading.Thread(target=_load_rerun, daemon=True).start()
    found, errors = process_each(paths, lambda path: read_campaigns(path, namespace))
    with tempfile.TemporaryDirectory(prefix="impact-rig-view-") as folder:
        files: list[Path] = []
        for campaign in itertools.chain.from_iterable(found):
            files.append(Path(folder, f"{len(files) + 1}{VIEW_SUFFIX}"))
            write_view(files[-1], campaign)
        if files and output is not None:
            with write_new_file(output) as part:
                join_views(part, files)
            click.echo(f"view: {output}", err=True)
        elif files:
            show = _serve if web else _show_window
            show(files)
    raise_errors(errors)


def _check_place(output: Path | None, *, web: bool) -> None:
    """Refuse a place that cannot be used, before anything is read."""
    if output is not None and web:
        raise ParameterError("choose one of --output and --web")
    if output is not None and output.suffix != VIEW_SUFFIX:
        raise FileError(f"--output is {str(output)!r}: it must end in {VIEW_SUFFIX}")
    if output is not None and output.exists():
        raise FileError(f"{output} exists already: name another file with -o")
    if output is None and not web and (missing := find_missing_screen()):
        raise DeviceError(f"{missing} (-o FILE{VIEW_SUFFIX}, --web)")


def _load_rerun() -> None:
    # The first use of it reports the error.
    with contextlib.suppress(RigError):
        import_rerun()


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
