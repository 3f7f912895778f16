"""``impact-rig replay``: publish a recording again, or estimate from it with a fresh node."""

from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.cli.each_file import show_results
from impact_rig.cli.progress import show_progress
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes.replay_client import ReplayClient
from impact_rig.nodes.replayer import run_replayer
from impact_rig.nodes.replayer_recording import RecordingToReplay
from impact_rig.present.terminal.console import print_warning
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import write_results

PLAYER_ONLY = ("rate", "loop", "namespace", "network")
"""Options of the player alone."""


def play(file: Path, rate: float, loop: int, namespace: str) -> int:
    """Replay a recording into the ROS domain at hand, to its end; return the exit code."""
    RecordingToReplay(file)  # an error comes before a node is up
    parameters = {
        "file": str(file),
        "rate": rate,
        "loop": loop,
        "required_subscribers": "",
        "exit_when_done": True,
    }
    return run_replayer(parameters, namespace)


def estimate_again(file: Path, output: Path | None, *, as_json: bool) -> None:
    """Replay a recording to a fresh estimator, and print the results.

    results.json of the last campaign goes into the folder `output`.

    Raises
    ------
    RigError
        If the recording cannot be replayed, holds no hit, or the results cannot be written.
    """
    path = None if output is None else output / RESULTS_NAME
    if path is not None and path.exists():
        raise FileError(f"{path} exists already: choose another --output")
    recording = RecordingToReplay(file)
    for warning in recording.warnings:
        print_warning(warning)
    with (
        options.use_private_domain(),
        ReplayClient() as client,
        show_progress() as follow,
    ):
        found = list(
            client.estimate(
                recording, lambda done: follow(f"replaying {file}", done, recording.size)
            )
        )
    if not found:
        raise FileError(f"{file} holds no complete hit to estimate from")
    if path is not None:
        _write(path, found[-1])
    show_results(file, found, is_full=False, as_json=as_json)


def _write(path: Path, results: Results) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {path.parent} cannot be made: {error.strerror}") from None
    write_results(path, results)
    click.echo(f"{'results:':10} {path}", err=True)


def run(
    file: Path,
    rate: float,
    loop: int,
    namespace: str,
    network: bool,
    estimate: bool,
    output: Path | None,
    as_json: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if estimate:
        options.refuse_given(PLAYER_ONLY, "is not for --estimate")
        options.set_discovery(network=False)
        estimate_again(file, output, as_json=as_json)
        return
    if output is not None or as_json:
        raise ParameterError("--output and --json are for results: they need --estimate")
    options.set_discovery(network=network)
    raise SystemExit(play(file, rate, loop, namespace))
