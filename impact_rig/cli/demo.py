"""``impact-rig demo``: a whole campaign on the virtual rig, in separate processes."""

import contextlib
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.cli.campaign import CampaignView, report_outcome, run_campaign
from impact_rig.cli.running_nodes import RunningNodes
from impact_rig.configuration import run as run_folder
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import (
    LOG_NAME,
    PAGE,
    RECORDING_NAME,
    VIEW_NAME,
    NodeProcess,
    choose_run_folder,
    list_rig_processes,
)
from impact_rig.configuration.rig_file import RigFile
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import RigError
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.speed_exponents import estimate_speed_exponents
from impact_rig.devices.drivers import VIRTUAL, read_driver_name
from impact_rig.devices.virtual.drivers import read_virtual_rig
from impact_rig.devices.virtual.rig import make_nominal_physics
from impact_rig.nodes.campaign_client import CampaignClient, CampaignGoal
from impact_rig.present.terminal.console import make_console, print_table
from impact_rig.results.campaign import Results
from impact_rig.results.tables import tabulate_speed_exponents, tabulate_true_contacts

LOOK_PERIOD = 0.05
"""Time between two looks at the log [s]."""
SHOWN_LOG_LINES = 15
"""Last lines of the log that are shown when the rig ends unexpectedly."""


class RunningRig:
    """The nodes of a rig, which a thread of this process runs, and the log of what they print."""

    def __init__(self, thread: threading.Thread, log: Path) -> None:
        self._thread = thread
        self._log = log

    def check(self) -> None:
        """Raise `RigError`, with the end of the log, if the rig has ended."""
        if self._thread.is_alive():
            return
        lines = self._log.read_text("utf-8", errors="replace").splitlines()[-SHOWN_LOG_LINES:]
        raise RigError("\n".join([f"the rig has ended; the end of {self._log}:", *lines]))

    def wait_for_line(self, part: str, timeout: float) -> str:
        """Wait for a text in the log; return it with the rest of its line.

        After `timeout` [s] return where to look for it.
        """
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            self.check()
            _, found, rest = self._log.read_text("utf-8", errors="replace").partition(part)
            line, ended, _ = rest.partition("\n")
            if found and ended:
                return part + line
            time.sleep(LOOK_PERIOD)
        return f"{part}: see {self._log}"


@contextlib.contextmanager
def run_rig(processes: Sequence[NodeProcess], log: Path) -> Iterator[RunningRig]:
    """Run the nodes of a rig during the block; they also end if this process is killed."""
    check_free(join_names("", (process.name for process in processes)))
    with log.open("w", encoding="utf-8") as output:
        nodes = RunningNodes(output)
        thread = threading.Thread(target=nodes.run, args=(processes,), daemon=True)
        try:
            thread.start()
            yield RunningRig(thread, log)
        finally:
            previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
            nodes.stop()
            thread.join()
            signal.signal(signal.SIGINT, previous)


START_TIMEOUT = 90.0
"""Time limit for the processes to start [s]: they take seconds on two cores, more on a busy host.
"""
SETTINGS = {"hammer": {"swing_time": 0.02}, "accelerometer": {"trigger_timeout": 0.1}}
"""A simulation is faster: a tenth of the paper's swing, and a short wait for missed triggers."""
ATTEMPTS = 50
"""Rejected hits in a row before the demo gives up [-]: with every fault at 10 % about half the
hits are bad."""
SUBSCRIBERS = 3
"""Estimator, recorder and visualizer listen before the first hit, so that the view has all."""
VIEW_TIMEOUT = 10.0
"""Time limit for the visualizer to start [s]: without its library it never does, and the campaign
goes on."""

PAGE_NOTICE = "the view is at"
"""What the visualizer says of its web page."""


def run(
    rig_file: Path | None,
    plant: str | None,
    seed: int | None,
    faults: float | None,
    continuous: bool,
    output: Path | None,
    record_stream: bool,
    notes: str,
    viewer: tuple[str, ...],
    samples: tuple[str, ...],
    impacts: int,
    angles: tuple[float, ...],
    keep: int,
    is_full: bool,
    as_json: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    options.check_keep(keep, impacts)
    rig = options.load_rig(rig_file)
    _check_virtual(rig)
    run_folder.check_samples(rig, samples)
    if angles:
        rig.setup.at_angles(angles)
    folder = choose_run_folder(output)
    processes = list_rig_processes(
        folder.resolve(),
        rig_file=str(rig_file.resolve()) if rig_file else "",
        source=run_folder.make_virtual_source(plant=plant, seed=seed, faults=faults),
        swing=rig.hammer,
        continuous=continuous,
        record_stream=record_stream,
        notes=notes,
        viewers=viewer,
        overrides=SETTINGS,
    )
    run_folder.make_run_folder(folder)
    options.set_discovery(network=False)
    try:
        with (
            options.use_private_domain(),
            run_rig(processes, folder / LOG_NAME) as running,
            CampaignClient(check=running.check) as client,
            CampaignView() as view,
        ):
            client.wait_for_rig(START_TIMEOUT)
            # In a running stream the accelerometers wait until their hit is found.
            client.wait_for_listeners(SUBSCRIBERS + continuous, VIEW_TIMEOUT)
            if PAGE in viewer:
                click.echo(running.wait_for_line(PAGE_NOTICE, VIEW_TIMEOUT), err=True)
            goal = CampaignGoal(
                samples=samples, impacts=impacts, attempts_per_impact=ATTEMPTS,
                keep_hits=keep, release_angles=angles,
            )  # fmt: skip
            outcome = run_campaign(client, goal, view)
    except KeyboardInterrupt:
        recorded = folder / RECORDING_NAME
        if recorded.exists():
            click.echo(f"stopped; the recording so far: {recorded}", err=True)
        raise
    report_outcome(outcome, folder, is_full=is_full, as_json=as_json)
    if is_full and not as_json:
        _print_truth(rig, plant, outcome.results)
    if not (folder / VIEW_NAME).exists():
        click.echo(f"no view was written: see {folder / LOG_NAME}", err=True)


def _print_truth(rig: RigFile, plant: str | None, results: Results) -> None:
    """Print law and paper's method beside the truth where the plant has a contact law."""
    given = run_folder.make_virtual_source(plant=plant, seed=None, faults=None)
    settings = read_virtual_rig(TomlTable({**rig.source, **given}, "[source]"))
    truths = {
        sample.name: physics.contact.describe()
        for sample in results.samples
        if (physics := make_nominal_physics(results.setup, sample.name, settings)).contact
        is not None
    }
    if not truths:
        return
    true_samples = [
        replace(sample, contact_law=truths[sample.name], contact_time=UNKNOWN)
        for sample in results.samples
    ]
    exponents = estimate_speed_exponents(results.setup, true_samples)
    for table in (
        tabulate_true_contacts(results.samples, truths),
        *tabulate_speed_exponents(exponents, "Contact over impact speed, the truth"),
    ):
        print_table(make_console(), table)


def _check_virtual(rig: RigFile) -> None:
    """Raise `ParameterError` if a rig file names a device: a demonstration reaches no hammer."""
    for table in (rig.source, rig.holder):
        if read_driver_name(table) != VIRTUAL:
            raise table.make_error(
                "driver",
                f"the demo strikes the virtual rig only, and {table.place} names the driver"
                f" {read_driver_name(table)!r}: use `impact-rig up` and `impact-rig campaign`",
            )
