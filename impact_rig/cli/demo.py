"""``impact-rig demo``: a whole campaign on the virtual rig, in separate processes."""

import contextlib
import math
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.cli.start import load_module
from impact_rig.cli.up import PAGE_NODE, RunningNodes, check_computer, show_page
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import (
    LOG_NAME,
    RECORDING_NAME,
    VIEW_NAME,
    NodeProcess,
    choose_run_folder,
    list_rig_processes,
    make_run_folder,
)
from impact_rig.configuration.rig_file import RigFile
from impact_rig.core.given.errors import RigError
from impact_rig.devices.drivers import VIRTUAL, read_driver_name

SHOWN_LOG_LINES = 15  # the last ones, when the rig ends unexpectedly
START_TIMEOUT = 90.0  # [s] in which the processes start: seconds, more on a busy computer
# A hundredth of the swing by the paper, and a short wait for missed triggers.
SETTINGS: dict[str, dict[str, Any]] = {
    "hammer": {"swing_time": 0.002},
    "accelerometer": {"trigger_timeout": 0.1},
}
ATTEMPTS = 50  # rejected hits in a row that end the demo: with --faults 0.1 half the hits are bad
SUBSCRIBERS = 3  # estimator, recorder and visualizer: the view has all hits
VIEW_TIMEOUT = 10.0  # [s] for the visualizer, which does not start without its library


@contextlib.contextmanager
def run_rig(processes: Sequence[NodeProcess], log: Path) -> Iterator[Callable[[], None]]:
    """Run the nodes of a rig during the block; they also end if this process is killed.

    Yields a function that raises `RigError`, with the end of the log, once the rig has ended.
    """
    check_free(join_names("", (process.name for process in processes)))
    with log.open("w", encoding="utf-8") as output, ThreadPoolExecutor(1) as thread:
        nodes = RunningNodes(output, on_page=_show_page)

        def check() -> None:
            if running.done():
                running.result()  # raises why they did not start
            # A campaign that ends with them knows no cause.
            if nodes.is_ending or running.done():
                lines = log.read_text("utf-8", errors="replace").splitlines()[-SHOWN_LOG_LINES:]
                raise RigError("\n".join([f"the rig has ended; the end of {log}:", *lines]))

        running = thread.submit(nodes.run, processes)
        try:
            yield check
        finally:
            previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
            nodes.stop()
            wait([running])
            signal.signal(signal.SIGINT, previous)


def _show_page(node: str, address: str) -> None:
    """Say where a page is, and open the rig's own where there is a screen."""
    show_page(node, address, err=True)
    if node == PAGE_NODE and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        click.launch(address)


def run(
    rig_file: Path | None,
    output: Path | None,
    samples: tuple[str, ...],
    impacts: int,
    angles: tuple[float, ...],
    is_full: bool,
    as_json: bool,
    **chosen: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    rig = options.load_rig(rig_file)
    _check_virtual(rig)
    for name in samples:
        rig.setup.samples.find(name)
    if angles:
        rig.setup.at_angles(angles)
    check_computer()
    folder = choose_run_folder(output)
    source = {key: chosen.pop(key) for key in options.SOURCE_KEYS}
    overrides: dict[str, dict[str, Any]] = dict(SETTINGS)
    if chosen["page"]:
        overrides[PAGE_NODE] = {"port": 0}
    processes = list_rig_processes(
        folder.resolve(), rig=rig, source=source, overrides=overrides, **chosen
    )
    make_run_folder(folder)
    options.set_discovery(network=False)
    try:
        with options.use_private_domain(), run_rig(processes, folder / LOG_NAME) as check:
            # What talks to the nodes is loaded while they load what they need.
            campaign = load_module("impact_rig.cli.campaign")
            with campaign.CampaignClient(check=check) as client, campaign.CampaignView() as view:
                client.wait_for_rig(START_TIMEOUT)
                # In a running stream the accelerometers wait until their hit is found.
                client.wait_for_listeners(SUBSCRIBERS + chosen["continuous"], VIEW_TIMEOUT)
                goal = campaign.CampaignGoal(
                    samples=samples, impacts=impacts, attempts_per_impact=ATTEMPTS,
                    release_angles=angles,
                )  # fmt: skip
                # Who looks at the page can end a pause.
                is_attended = bool(chosen["page"])
                outcome = campaign.run_campaign(client, goal, view, is_attended=is_attended)
                if is_attended:
                    view.stay("the campaign is done; the page stays until Ctrl-C")
                    with contextlib.suppress(KeyboardInterrupt):
                        client.spin_until(lambda: check() is not None, math.inf)
    except KeyboardInterrupt:
        recorded = folder / RECORDING_NAME
        if recorded.exists():
            click.echo(f"stopped; the recording so far: {recorded}", err=True)
        raise
    campaign.report_outcome(outcome, folder, is_full=is_full, as_json=as_json)
    if not (folder / VIEW_NAME).exists():
        click.echo(f"no view was written: see {folder / LOG_NAME}", err=True)


def _check_virtual(rig: RigFile) -> None:
    """Raise `ParameterError` if a rig file names a device: a demonstration reaches no hammer."""
    for table in (rig.source, rig.holder):
        if read_driver_name(table) != VIRTUAL:
            raise table.make_error(
                "driver",
                f"the demo strikes the virtual rig only, and {table.place} names the driver"
                f" {read_driver_name(table)!r}: use `impact-rig up` and `impact-rig campaign`",
            )
