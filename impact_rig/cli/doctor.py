"""`impact-rig doctor`: what is installed, what is broken, how to repair it."""

import os
import shutil
import subprocess
import sys
from importlib import metadata, util
from pathlib import Path
from typing import Any, NamedTuple

from rich.text import Text

from impact_rig.cli.libraries import LIBRARIES, Library
from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.drivers import HOLDERS, SOURCES, find_drivers
from impact_rig.nodes.discovery import offer_profile, reserve_domain
from impact_rig.present.console import ALARM, GOOD, WARNING, make_console, print_facts
from impact_rig.results.numbers import format_count

OK, DOUBT, FAULT = STYLES = {"ok": GOOD, "warning": WARNING, "fault": ALARM}
"""How bad a finding is, and how it is shown; with a fault the rig cannot work."""


class Finding(NamedTuple):
    """One line of the doctor's report."""

    name: str
    text: str
    status: str = OK
    advice: str = ""  # empty without a fault


DISTRIBUTION = "jazzy"
QUIET: dict[str, Any] = {
    "stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE,
}  # fmt: skip
ROS_VARIABLES = ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "RMW_IMPLEMENTATION")


def has_ros() -> bool:
    """Return whether anything of ROS 2 is here; without it the software analyses only."""
    return util.find_spec("rclpy") is not None or "ROS_DISTRO" in os.environ


def check_library(library: Library) -> Finding:
    """Find a library and its version."""
    if util.find_spec(library.module) is None:
        is_optional = library.is_ros and not has_ros()
        status = DOUBT if is_optional or not library.is_needed else FAULT
        return Finding(library.name, "missing", status, library.advice)
    try:
        return Finding(library.name, metadata.version(library.name))
    except metadata.PackageNotFoundError:
        return Finding(library.name, "installed")


def check_ros() -> list[Finding]:
    """Return which ROS 2 is sourced, and its variables in the environment."""
    found = os.environ.get("ROS_DISTRO", "")
    finding = Finding("ROS 2", found or ("from PyPI" if has_ros() else "none"))
    if found not in ("", DISTRIBUTION):
        advice = f"source ROS 2 {DISTRIBUTION}, or none: then it comes from PyPI"
        finding = Finding("ROS 2", found, FAULT, advice)
    return [finding, *(Finding(name, os.environ.get(name, "unset")) for name in ROS_VARIABLES)]


def check_conversation() -> Finding:
    """Let a hammer's node answer a command, two processes, in an unused domain."""
    name = "two processes"
    if util.find_spec("rclpy") is None:
        status = FAULT if has_ros() else DOUBT
        return Finding(name, "not tried: there is no rclpy", status)
    python = (sys.executable, "-P", "-m")
    try:
        with offer_profile(), reserve_domain() as number:
            environment = {**os.environ, "ROS_DOMAIN_ID": str(number)}
            node = [*python, "impact_rig.nodes", "hammer"]
            command = [*python, "impact_rig.cli.main", "hammer", "disarm"]
            with subprocess.Popen(node, env=environment, **QUIET) as running:
                try:
                    asked = subprocess.run(command, env=environment, check=False, **QUIET)
                finally:
                    running.kill()
                _, errors = running.communicate()
    except DeviceError as error:
        return Finding(name, str(error), FAULT)
    if asked.returncode == 0:
        return Finding(name, "a node answers a command")
    reason = (asked.stderr or errors).decode(errors="replace").strip().splitlines()[-1]
    advice = "repair the faults above first; then look for a firewall on the loopback interface"
    return Finding(name, reason, FAULT, f"{advice}, and at the variables of ROS 2")


def check_disk(folder: Path) -> Finding:
    """Check whether a campaign can be recorded in a folder."""
    if not os.access(folder, os.W_OK):
        advice = "change into a folder that you can write, or give --output"
        return Finding("disk", f"{folder} cannot be written", FAULT, advice)
    return Finding("disk", f"{shutil.disk_usage(folder).free / 1e9:.1f} GB free in {folder}")


def run() -> None:
    """Run the command; its options are declared in `commands.py`."""
    findings = [
        Finding("Python", f"{sys.version.split()[0]} ({sys.executable})"),
        *map(check_library, LIBRARIES),
        *check_ros(),
        check_conversation(),
        Finding("sources", ", ".join(find_drivers(SOURCES))),
        Finding("holders", ", ".join(find_drivers(HOLDERS))),
        check_disk(Path.cwd()),
    ]
    faults = sum(finding.status == FAULT for finding in findings)
    console = make_console()
    rows = []
    for name, text, status, advice in findings:
        told = Text.assemble(text, (f"\n{advice}" * bool(advice), "bold"))
        rows.append((Text(status, style=STYLES[status]), name, told))
    print_facts(console, rows)
    if faults:
        console.print(f"{format_count(faults, 'fault')}: see above.")
        raise SystemExit(1)
    alone = "Recordings and files can be analysed. What runs a rig needs ROS 2."
    console.print("The rig can work." if has_ros() else alone)
