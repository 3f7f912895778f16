"""`impact-rig doctor`: what is installed, what is broken, how to repair it."""

import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from importlib import metadata, util
from pathlib import Path

from rich.text import Text

from impact_rig.cli.libraries import LIBRARIES, Library
from impact_rig.cli.output import print_json
from impact_rig.core.errors import DeviceError
from impact_rig.devices.drivers import HOLDERS, SOURCES, find_drivers
from impact_rig.nodes.discovery import LEAST_SHARED_MEMORY, SHARED_MEMORY, reserve_domain
from impact_rig.present.terminal.console import ALARM, GOOD, WARNING, make_console, print_facts
from impact_rig.results.numbers import format_count


class Status(Enum):
    """How good a finding is; with a fault the rig cannot work."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's report."""

    name: str
    text: str
    status: Status = Status.OK
    advice: str = ""  # empty without a fault


DISTRIBUTION = "jazzy"
PROBE_TIMEOUT = 20.0  # [s], for two processes to find each other
ROS_VARIABLES = ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "RMW_IMPLEMENTATION")
EXIT_FAULT = 1
STYLES = {Status.OK: GOOD, Status.WARNING: WARNING, Status.FAULT: ALARM}


def check_library(library: Library) -> Finding:
    """Find a library and its version."""
    if util.find_spec(library.module) is None:
        status = Status.FAULT if library.is_needed else Status.WARNING
        return Finding(library.name, "missing", status, library.advice)
    try:
        return Finding(library.name, metadata.version(library.name))
    except metadata.PackageNotFoundError:
        return Finding(library.name, "installed")


def check_ros() -> list[Finding]:
    """Return which ROS 2 is sourced, and its variables in the environment."""
    distribution = os.environ.get("ROS_DISTRO", "")
    found = Finding("ROS 2", distribution or "from PyPI")
    if distribution not in ("", DISTRIBUTION):
        advice = f"source ROS 2 {DISTRIBUTION}, or none: then it comes from PyPI"
        found = Finding("ROS 2", distribution, Status.FAULT, advice)
    return [found, *(Finding(name, os.environ.get(name, "unset")) for name in ROS_VARIABLES)]


def check_conversation() -> Finding:
    """Exchange a message between two processes of this computer, in an unused domain."""
    name = "two processes"
    if util.find_spec("rclpy") is None:
        return Finding(name, "not tried: there is no rclpy", Status.FAULT, "install ROS 2 first")
    token = uuid.uuid4().hex
    with reserve_domain() as number:
        environment = {
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            **os.environ,
            "ROS_DOMAIN_ID": str(number),
        }
        talker = _start_probe("talk", token, environment)
        listener = _start_probe("listen", token, environment)
        try:
            output, errors = listener.communicate(timeout=PROBE_TIMEOUT)
        except subprocess.TimeoutExpired:
            text = f"no message arrived within {PROBE_TIMEOUT:g} s"
            advice = "look for a firewall on the loopback interface, and at the variables of ROS 2"
            return Finding(name, text, Status.FAULT, advice)
        finally:
            for process in (listener, talker):
                process.kill()
                process.communicate()
    if listener.returncode:
        reason = (errors.strip() or f"exit code {listener.returncode}").splitlines()[-1]
        return Finding(name, reason, Status.FAULT, "repair the faults above first")
    return Finding(name, f"exchange messages by {output.strip()}")


def _start_probe(program: str, token: str, environment: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "impact_rig.nodes.probe", program, token],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def check_drivers() -> list[Finding]:
    """List the drivers of devices that are installed."""
    try:
        return [
            Finding(title, ", ".join(find_drivers(group)))
            for title, group in (("sources", SOURCES), ("holders", HOLDERS))
        ]
    except DeviceError as error:
        return [Finding("drivers", str(error), Status.FAULT)]


def check_disk(folder: Path) -> Finding:
    """Check whether a campaign can be recorded in a folder."""
    if not os.access(folder, os.W_OK):
        advice = "change into a folder that you can write, or give --output"
        return Finding("disk", f"{folder} cannot be written", Status.FAULT, advice)
    return Finding("disk", f"{shutil.disk_usage(folder).free / 1e9:.1f} GB free in {folder}")


def check_shared_memory(folder: Path = SHARED_MEMORY) -> Finding:
    """Check the shared memory that every node uses."""
    name = "shared memory"
    if not folder.is_dir():
        return Finding(name, f"there is no {folder}", Status.WARNING, "messages go over UDP")
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e6:.0f} MB free in {folder}"
    if free < LEAST_SHARED_MEMORY:
        advice = "when no node runs, remove the files of dead ones there (fastrtps_*)"
        return Finding(name, text, Status.FAULT, advice)
    return Finding(name, text)


def run(as_json: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""
    findings = [
        Finding("Python", f"{sys.version.split()[0]} ({sys.executable})"),
        *map(check_library, LIBRARIES),
        *check_ros(),
        check_conversation(),
        *check_drivers(),
        check_disk(Path.cwd()),
        check_shared_memory(),
    ]
    faults = sum(finding.status is Status.FAULT for finding in findings)
    if as_json:
        items = [{**vars(finding), "status": finding.status.value} for finding in findings]
        print_json({"healthy": not faults, "findings": items})
    else:
        _print_findings(findings)
    if faults:
        raise SystemExit(EXIT_FAULT)


def _print_findings(findings: Sequence[Finding]) -> None:
    console = make_console()
    rows = []
    for item in findings:
        advice = f"\n{item.advice}" if item.advice else ""
        status = Text(item.status.value, style=STYLES[item.status])
        rows.append((status, item.name, Text.assemble(item.text, (advice, "bold"))))
    print_facts(console, rows)
    faults = sum(finding.status is Status.FAULT for finding in findings)
    console.print(
        f"{format_count(faults, 'fault')}: see above." if faults else "The rig can work."
    )
