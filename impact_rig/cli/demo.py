"""``impact-rig demo``: a whole campaign on the virtual rig, in separate processes."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.cli.campaign import CampaignView, report_outcome, run_campaign
from impact_rig.configuration import run as run_folder
from impact_rig.configuration.processes import (
    LOG_NAME,
    PAGE,
    RECORDING_NAME,
    VIEW_NAME,
    list_rig_processes,
)
from impact_rig.configuration.rig_file import RigFile, load_rig_file
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import RigError
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.speed_exponents import estimate_speed_exponents
from impact_rig.devices.drivers import VIRTUAL, read_driver_name
from impact_rig.devices.virtual.drivers import read_virtual_rig
from impact_rig.devices.virtual.rig import make_nominal_physics
from impact_rig.nodes.client import CampaignClient, CampaignGoal
from impact_rig.present.terminal.console import make_console, print_result
from impact_rig.results.campaign import Results
from impact_rig.results.tables import tabulate_speed_exponents, tabulate_true_contacts

STOP_TIMEOUT = 15.0
"""Time limit for the nodes to close their files and end [s]."""
LOOK_PERIOD = 0.05
"""Time between two looks at the log [s]."""
SHOWN_LOG_LINES = 15
"""Last lines of the log that are shown when the rig ends unexpectedly."""


class RunningRig:
    """The process `impact-rig up`, which holds the nodes, and the log of what they print."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path) -> None:
        self._process = process
        self._log = log

    def check(self) -> None:
        """Raise `RigError`, with the end of the log, if the rig has ended."""
        if self._process.poll() is None:
            return
        try:
            text = self._log.read_text("utf-8", errors="replace")
        except OSError as error:
            raise RigError(f"the rig has ended; {self._log}: {error.strerror}") from None
        lines = text.splitlines()[-SHOWN_LOG_LINES:]
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
def run_rig(folder: Path, arguments: Sequence[str]) -> Iterator[RunningRig]:
    """Start `impact-rig up` for the run of a folder; stop it at the end of the block."""
    log = folder / LOG_NAME
    # In a new session, so that Ctrl-C reaches this process alone, which then stops the rig. Its
    # standard input ends with this process, also when that is killed.
    process = subprocess.Popen(
        [
            sys.executable, "-P", "-m", "impact_rig.cli.main", "up", "--output",
            str(folder), "--stop-with-input", "--log-file", str(log), *arguments,
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        yield RunningRig(process, log)
    finally:
        previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
        process.terminate()
        try:
            process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        signal.signal(signal.SIGINT, previous)


START_TIMEOUT = 90.0
"""Time limit for the processes to start [s]: they take seconds on two cores, more on a busy host.
"""
SETTINGS = ("hammer.swing_time=0.02", "accelerometer.trigger_timeout=0.1")
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
    output: Path | None,
    samples: tuple[str, ...],
    impacts: int,
    angles: tuple[float, ...],
    keep: int,
    is_full: bool,
    as_json: bool,
    **rig_options: Any,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    options.check_keep(keep, impacts)
    rig = load_rig_file(rig_file)
    _check_virtual(rig)
    run_folder.check_samples(rig, samples)
    if angles:
        rig.setup.at_angles(angles)
    continuous, viewers = rig_options["continuous"], rig_options["viewer"]
    list_rig_processes(
        "",
        continuous=continuous,
        record_stream=rig_options["record_stream"],
        viewers=viewers,
    )
    folder = run_folder.make_run_folder(output)
    options.set_discovery(network=False)
    arguments = _make_arguments(rig_file=rig_file, set=SETTINGS, **rig_options)
    try:
        with (
            options.use_private_domain(),
            run_rig(folder, arguments) as running,
            CampaignClient(check=running.check) as client,
            CampaignView() as view,
        ):
            client.wait_for_rig(START_TIMEOUT)
            # In a running stream the accelerometers wait until their hit is found.
            client.wait_for_listeners(SUBSCRIBERS + continuous, VIEW_TIMEOUT)
            if PAGE in viewers:
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
    if outcome.results is not None and is_full and not as_json:
        _print_truth(rig, rig_options["plant"], outcome.results)
    if not (folder / VIEW_NAME).exists():
        click.echo(f"no view was written: see {folder / LOG_NAME}", err=True)


def _make_arguments(**given: Any) -> list[str]:
    """Return options as the words of a command line."""
    words = []
    for name, value in given.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif isinstance(value, tuple):
            words += [word for item in value for word in (flag, item)]
        elif value is not None and value is not False and value != "":
            words += [flag, str(value)]
    return words


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
        print_result(make_console(), table)


def _check_virtual(rig: RigFile) -> None:
    """Raise `ParameterError` if a rig file names a device: a demonstration reaches no hammer."""
    for table in (rig.source, rig.holder):
        if read_driver_name(table) != VIRTUAL:
            raise table.make_error(
                "driver",
                f"the demo strikes the virtual rig only, and {table.place} names the driver"
                f" {read_driver_name(table)!r}: use `impact-rig up` and `impact-rig campaign`",
            )
