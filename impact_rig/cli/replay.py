"""``impact-rig replay``: publish a recording again, or estimate from it with a fresh node."""

from pathlib import Path

from impact_rig.cli import options
from impact_rig.cli.output import show_progress, show_results
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes.replay_client import ReplayClient
from impact_rig.nodes.replayer import RecordingToReplay, run_replayer
from impact_rig.present.console import print_warning

PLAYER_ONLY = ("rate", "loop", "namespace", "network")  # options of the player alone


def run(
    file: Path,
    rate: float,
    loop: int,
    namespace: str,
    network: bool,
    estimate: bool,
    as_json: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if estimate:
        options.refuse_given(PLAYER_ONLY, "is not for --estimate")
    elif as_json:
        raise ParameterError("--json prints results: it needs --estimate")
    recording = RecordingToReplay(file)  # an error comes before a node is up
    options.set_discovery(network=network)
    if estimate:
        _estimate(file, recording, as_json=as_json)
        return
    parameters = {
        "file": str(file),
        "rate": rate,
        "loop": loop,
        "required_subscribers": "",
        "exit_when_done": True,
    }
    raise SystemExit(run_replayer(parameters, namespace))


def _estimate(file: Path, recording: RecordingToReplay, *, as_json: bool) -> None:
    """Replay a recording to a fresh estimator, and print the results."""
    for warning in recording.warnings:
        print_warning(warning)
    with (
        options.use_private_domain(),
        ReplayClient() as client,
        show_progress() as follow,
    ):
        found = list(
            client.estimate(
                recording, lambda done: follow(f"replaying {file}", done, recording.duration)
            )
        )
    if not found:
        raise FileError(f"{file} holds no complete hit to estimate from")
    show_results(file, found, is_full=False, as_json=as_json)
