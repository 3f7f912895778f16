"""Estimates of a recording by a fresh estimator, through ROS, as in the live run."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from impact_rig.cli.rigs.replay_view import ReplayView
from impact_rig.cli.rigs.running_rig import use_private_domain
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.errors import FileError
from impact_rig.nodes.replaying.replay_host import ReplayHost
from impact_rig.nodes.replaying.replay_recording import RecordingToReplay
from impact_rig.reporting.terminal.campaign_tables import print_results
from impact_rig.reporting.terminal.console import make_console
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import format_json, results_to_json, write_results


def estimate_again(parameters: Mapping[str, Any], output: Path | None, *, as_json: bool) -> None:
    """Replay a recording to a fresh estimator, and print what that finds.

    Parameters
    ----------
    parameters : mapping
        Of the replayer.
    output : Path or None
        Folder for results.json, of the last campaign as the live run left it; None: not written.
    as_json : bool
        Print JSON in place of tables: of one campaign, or a list if there are several.

    Raises
    ------
    RigError
        If the recording cannot be replayed, holds no hit, or the results cannot be written.
    """
    path = None if output is None else output / RESULTS_NAME
    if path is not None and path.exists():
        raise FileError(f"{path} exists already: choose another --output")
    found = _replay(parameters)
    if not found:
        raise FileError(
            f"{parameters['file']} holds no hit to estimate from: no block of what is replayed"
            " completes a record"
        )
    if path is not None:
        _write(path, found[-1])
    if as_json:
        contents = [results_to_json(results) for results in found]
        click.echo(format_json(contents[0] if len(contents) == 1 else contents), nl=False)
        return
    console = make_console()
    for number, results in enumerate(found, start=1):
        if len(found) > 1:
            console.print(f"{parameters['file']}, campaign {number}\n", style="bold underline")
        print_results(console, results)


def _replay(parameters: Mapping[str, Any]) -> list[Results]:
    """Return the results of each campaign with hits."""
    found = []
    # Of its own namespace too: the domain may be given, and a rig be up in it.
    name = f"replay_{os.getpid()}"
    with (
        use_private_domain(),
        ReplayHost(parameters, name, with_estimator=True) as host,
        ReplayView(make_console(stderr=True)) as view,
    ):
        recording = host.open()
        for warning in recording.warnings:
            click.echo(f"warning: {warning}", err=True)

        def follow() -> bool:
            view.follow(host.replayer)
            return True

        for start, end in _find_parts(recording, parameters["start"], parameters["end"]):
            host.choose_part(start, end)
            host.play(follow)
            results = host.fetch_results()
            if results.hits:
                found.append(results)
    return found


def _find_parts(
    recording: RecordingToReplay, start: float, end: float
) -> list[tuple[float, float]]:
    """Return from when to when the campaigns are replayed [s]; an end of 0: the recording's.

    One by one, since a set-up begins the estimates afresh.
    """
    recording.make_plan(start, end)
    return [
        (max(first, start), min(last or end, end or last))
        for first, last in recording.find_campaigns()
        if (not last or last > start) and (not end or first < end)
    ]


def _write(path: Path, results: Results) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {path.parent} cannot be made: {error.strerror}") from None
    write_results(path, results)
    click.echo(f"{'results:':10} {path}", err=True)
