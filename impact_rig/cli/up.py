"""``impact-rig up``: start the nodes of a rig."""

import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.cli.running_nodes import RunningNodes
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import (
    RECORDING_NAME,
    SOURCE,
    choose_run_folder,
    list_rig_processes,
    make_run_folder,
    parse_parameters,
)
from impact_rig.configuration.rig_file import RigFile, read_template
from impact_rig.core.errors import RigError
from impact_rig.devices.drivers import VIRTUAL, read_driver_name


def run(
    rig_file: Path | None,
    output: Path | None,
    resume: Path | None,
    network: bool,
    namespace: str,
    only: tuple[str, ...],
    settings: tuple[str, ...],
    template: bool,
    **chosen: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    if template:
        click.echo(read_template(), nl=False)
        return
    rig = options.load_rig(rig_file)
    overrides = parse_parameters(settings)
    source = {**{key: chosen.pop(key) for key in options.SOURCE_KEYS}, **overrides.pop(SOURCE, {})}
    folder = resume or choose_run_folder(output)
    options.set_discovery(network=network)
    processes = list_rig_processes(
        folder.resolve(), rig=rig, source=source, overrides=overrides, only=only, **chosen
    )
    check_free(join_names(namespace, (process.name for process in processes)))
    is_written = any("output" in process.parameters for process in processes)
    if is_written and resume is None:
        make_run_folder(folder)
    is_recorded = any(process.name == "recorder" for process in processes)
    recorded = folder / RECORDING_NAME if is_recorded else None
    nodes = RunningNodes(sys.stdout)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, nodes.stop)
    ready = describe_ready(rig, recorded, namespace=namespace, only=only)
    code = nodes.run(processes, namespace, ready)
    if recorded and recorded.exists():
        click.echo(f"recording: {recorded}")
    if code:
        raise RigError("a node has ended, so the rig has stopped: see above")


def describe_ready(
    rig: RigFile, recording: Path | None, *, namespace: str = "", only: Sequence[str] = ()
) -> str:
    """Return the line that ends the start: which rig, where it records, the next command.

    `recording` is None where nothing is recorded here; `only` names the nodes that this computer
    has started, or is empty for all.
    """
    holder, source = read_driver_name(rig.holder), read_driver_name(rig.source)
    name = "the virtual rig"
    if (holder, source) != (VIRTUAL, VIRTUAL):
        name = f"the rig (hammer: {holder}, accelerometers: {source})"
    who = f"{', '.join(only)} of {name}" if only else name
    where = f"recording to {recording}" if recording else "recording nothing here"
    option = f" --namespace {namespace}" if namespace else ""
    return f"ready: {who}, {where}; in another terminal: impact-rig campaign{option}"
