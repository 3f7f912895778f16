"""``impact-rig replay``: publish a recording again, or estimate from it with a fresh node."""

from pathlib import Path

from impact_rig.cli import options
from impact_rig.cli.output import show_progress, show_results
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.nodes.replay_client import ReplayClient
from impact_rig.nodes.replayer import RunToReplay, run_replayer
from impact_rig.present.console import print_warning
from impact_rig.recordings.run import Run

PLAYER_ONLY = ("rate", "loop", "network")  # options of the player alone


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
    run = Run(file)
    # Of one rig, the namespace says where it is replayed; of several also which.
    chosen = namespace if namespace and (estimate or len(run.namespaces) > 1) else ""
    run = Run(file, chosen or None)
    options.set_discovery(network=network)
    if estimate:
        _estimate(run, as_json=as_json)
        return
    RunToReplay(run)  # an error comes before a node is up
    parameters = {
        "file": str(file),
        "rig_namespace": chosen,
        "rate": rate,
        "loop": loop,
        "required_subscribers": "",
        "exit_when_done": True,
    }
    raise SystemExit(run_replayer(parameters, namespace))


def _estimate(run: Run, *, as_json: bool) -> None:
    """Feed the hits of a run to a fresh estimator, and print the results."""
    with options.use_private_domain(), ReplayClient() as client, show_progress() as follow:
        stage = f"replaying {run.path}"
        found = list(client.estimate(run, lambda done: follow(stage, done, run.size)))
    if not found:
        raise FileError(f"{run.path} holds no complete hit to estimate from")
    for warning in run.warnings:
        print_warning(warning)
    show_results(run.path, found, is_full=False, as_json=as_json)
