"""`impact-rig doctor`: what is installed, what is broken, what to do about it."""

import contextlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib import metadata, util
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.libraries import LIBRARIES, Library
from impact_rig.nodes.discovery import SHARED_MEMORY, reserve_domain
from impact_rig.present.terminal.console import (
    ALARM,
    GOOD,
    WARNING,
    make_console,
    print_facts,
)
from impact_rig.results.numbers import format_count
from impact_rig.results.results_file import format_json
from impact_rig.simulators.check import find_obstacle
from impact_rig.simulators.parameters import ENGINES


class Status(Enum):
    """How good a finding is."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's report.

    Attributes
    ----------
    name : str
        What was looked at.
    status : Status
        A fault is what keeps the rig from working.
    text : str
        What was found.
    advice : str
        What to do about it; empty where all is well.
    """

    name: str
    status: Status
    text: str
    advice: str = ""


def _find(name: str, text: str, advice: str = "", status: Status = Status.FAULT) -> Finding:
    """Return a finding; without advice all is well."""
    return Finding(name, status if advice else Status.OK, text, advice)


def check_libraries(libraries: Sequence[Library] = LIBRARIES) -> list[Finding]:
    """Load every library, each in a process of its own, and look at its version.

    Some end the process that loads them when their settings are wrong.
    """
    loading = [
        subprocess.Popen(
            [sys.executable, "-c", f"import {library.module}"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for library in libraries
    ]
    return [
        _judge(library, process.communicate()[1].strip(), process.returncode)
        for library, process in zip(libraries, loading, strict=True)
    ]


def check_simulators() -> Finding:
    """Tell in which simulators an exported contact can be checked; none is needed."""
    engines = [engine for engine in ENGINES.values() if engine.package]
    missing = [engine.package for engine in engines if find_obstacle(engine)]
    text = ", ".join(engine.title for engine in engines if engine.package not in missing) or "none"
    if missing:
        text += f"; `export --check` in others: pip install {' '.join(missing)}"
    return _find("simulators", text)


def _judge(library: Library, errors: str, code: int) -> Finding:
    name = library.name
    trouble = Status.FAULT if library.is_needed else Status.WARNING
    if code != 0:
        reason = errors.splitlines()[-1] if errors else f"Python ended with code {code}"
        missing = re.fullmatch(r"ModuleNotFoundError: No module named '(.+)'", reason)
        if missing and library.module.startswith(missing.group(1)):
            reason = f"missing; {library.purpose} needs it"
        else:
            reason = f"does not load: {reason}"
        return _find(name, reason, library.advice, trouble)
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return _find(name, "installed")
    numbers = tuple(int(number) for number in re.findall(r"\d+", version)[:2])
    wanted = ".".join(map(str, library.oldest))
    is_old = numbers < library.oldest
    return _find(name, version, f"install {name} {wanted} or newer" if is_old else "", trouble)


DISTRIBUTION = "jazzy"
PROBE_TIMEOUT = 20.0
"""How long two processes may take to find each other [s]: one or two, more on a busy host."""
DISCOVERY_RANGES = {
    "SUBNET": "the local network",
    "LOCALHOST": "this host",
    "SYSTEM_DEFAULT": "whatever the middleware does by itself",
    "OFF": "nothing",
}
HIGHEST_DOMAIN = 232
HIGHEST_SAFE_DOMAIN = 101
"""Above it the ports of a domain may collide with those that Linux hands out."""


def check_distribution(environment: Mapping[str, str]) -> Finding:
    """Tell which ROS 2 this is."""
    name, title = "ROS 2", DISTRIBUTION.title()
    chosen = environment.get("ROS_DISTRO", "")
    if chosen and chosen != DISTRIBUTION:
        advice = f"source ROS 2 {title}, or none: then it comes from PyPI"
        return _find(name, f"{chosen} is sourced (ROS_DISTRO)", advice)
    if util.find_spec("rclpy") is None:
        advice = "run `python3 launch_scripts/rig.py exec -- impact-rig doctor`, or source ROS 2"
        return _find(name, "none: there is no rclpy", f"{advice} {title}")
    try:
        origin = f"wheels from PyPI (ros-rclpy {metadata.version('ros-rclpy')})"
    except metadata.PackageNotFoundError:
        origin = "installed on this machine"
    return _find(name, f"{title}, {origin}")


def check_domain(environment: Mapping[str, str]) -> Finding:
    """Look at ROS_DOMAIN_ID."""
    name = "ROS_DOMAIN_ID"
    text = environment.get(name, "")
    if not text:
        return _find(name, "unset: domain 0; demo takes an unused one")
    if not text.isdecimal() or int(text) > HIGHEST_DOMAIN:
        advice = f"unset it, or set a whole number from 0 to {HIGHEST_SAFE_DOMAIN}"
        return _find(name, repr(text), advice)
    if int(text) > HIGHEST_SAFE_DOMAIN:
        advice = f"set a number up to {HIGHEST_SAFE_DOMAIN}: above it ports may be taken by others"
        return _find(name, text, advice, Status.WARNING)
    return _find(name, text)


def check_discovery(environment: Mapping[str, str]) -> Finding:
    """Look at how far nodes search for each other."""
    name = "discovery"
    variable = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    if environment.get("ROS_LOCALHOST_ONLY", "0") not in ("", "0"):
        text = "ROS_LOCALHOST_ONLY is set: this host, whatever else is said"
        advice = f"unset it and set {variable}=LOCALHOST instead: it is deprecated"
        return _find(name, text, advice, Status.WARNING)
    chosen = environment.get(variable, "")
    if not chosen:
        return _find(name, f"{variable} unset: the rig stays on this host")
    if chosen not in DISCOVERY_RANGES:
        advice = f"unset it, or set one of {', '.join(DISCOVERY_RANGES)}"
        return _find(name, f"{variable} is {chosen!r}", advice)
    advice = "set LOCALHOST: not even the nodes of one host meet" if chosen == "OFF" else ""
    return _find(name, f"{variable}={chosen}: {DISCOVERY_RANGES[chosen]}", advice)


def check_conversation(timeout: float = PROBE_TIMEOUT) -> list[Finding]:
    """Let two processes of this host exchange a message, and tell the middleware they used.

    Parameters
    ----------
    timeout : float
        For all of it [s].
    """
    name = "two processes"
    if util.find_spec("rclpy") is None:
        return [_find(name, "not tried: there is no rclpy", "install ROS 2 first")]
    started = time.monotonic()
    token = uuid.uuid4().hex
    with _pick_environment() as environment:
        talker = _start_probe("talk", token, environment)
        listener = _start_probe("listen", token, environment)
        try:
            output, errors = listener.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            advice = (
                "look for a firewall on the loopback interface, a missing `lo`, or variables"
                " of another middleware (RMW_IMPLEMENTATION, *_PROFILES_FILE, CYCLONEDDS_URI)"
            )
            return [_find(name, f"did not hear each other within {timeout:g} s", advice)]
        finally:
            for process in (listener, talker):
                process.kill()
                process.communicate()
    if listener.returncode != 0 or not output.strip():
        reason = (errors.strip() or "no output").splitlines()[-1]
        text = f"the listener ended with code {listener.returncode}: {reason}"
        advice = "mend what is marked above first; RMW_IMPLEMENTATION must name an installed one"
        return [_find(name, text, advice)]
    elapsed = time.monotonic() - started
    return [
        _find("middleware", output.strip().splitlines()[-1]),
        _find(name, f"hear each other ({elapsed:.1f} s from start to message)"),
    ]


def _start_probe(
    program: str, token: str, environment: Mapping[str, str]
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "impact_rig.nodes.probe", program, token],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@contextlib.contextmanager
def _pick_environment() -> Iterator[dict[str, str]]:
    """Yield the environment of a node, in a domain where nobody else is."""
    environment = dict(os.environ)
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ModuleNotFoundError):
            environment["ROS_DOMAIN_ID"] = str(stack.enter_context(reserve_domain()))
        yield environment


SCARCE_DISK = 2e9
"""Free space below which a warning is due [bytes], our choice: some forty campaigns."""
TOO_LITTLE_DISK = 1e8
"""Free space that one campaign may fill [bytes]."""
SCARCE_SHARED_MEMORY = 32e6
"""Free shared memory below which a warning is due [bytes], our choice: seven nodes take about
half of it."""
MEGABYTE = 1e6
GIGABYTE = 1e9


def check_disk(folder: Path) -> Finding:
    """Look whether a campaign can be recorded in `folder`."""
    name = "disk"
    if not os.access(folder, os.W_OK):
        advice = "change into a folder of yours, or give --output"
        return _find(name, f"{folder} cannot be written", advice)
    free = shutil.disk_usage(folder).free
    text = f"{_format_size(free)} free in {folder}"
    if free < TOO_LITTLE_DISK:
        return _find(name, text, "free some space: a campaign takes up to 100 MB")
    if free < SCARCE_DISK:
        return _find(name, text, "free some space before a long campaign", Status.WARNING)
    return _find(name, text)


def check_shared_memory(folder: Path = SHARED_MEMORY) -> Finding:
    """Look whether nodes of this host can pass messages through shared memory."""
    name = "shared memory"
    if not folder.is_dir():
        advice = "mount a tmpfs there; until then messages take the slower way over UDP"
        return _find(name, f"there is no {folder}", advice, Status.WARNING)
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        text = f"{folder} cannot be written ({error.strerror})"
        advice = "let everyone write there (mode 1777); until then messages take the slower way"
        return _find(name, text, advice, Status.WARNING)
    usage = shutil.disk_usage(folder)
    text = f"{_format_size(usage.free)} of {_format_size(usage.total)} free in {folder}"
    if usage.free >= SCARCE_SHARED_MEMORY:
        return _find(name, text)
    advice = (
        "remove what dead processes left there (fastrtps_*) once no node runs; in a container"
        " give it more (docker run --shm-size=256m)"
    )
    return _find(name, text, advice, Status.WARNING)


def _format_size(size: float) -> str:
    if size >= GIGABYTE:
        return f"{size / GIGABYTE:.1f} GB"
    return f"{size / MEGABYTE:.0f} MB"


EXIT_FAULT = 1
STYLES = {Status.OK: GOOD, Status.WARNING: WARNING, Status.FAULT: ALARM}


@click.command(
    "doctor",
    epilog="""
    \b
    Examples:
      impact-rig doctor
      impact-rig doctor --json
    Exit code: 0 if the rig can work, 1 if something that it needs is broken.
    """,
)
@options.json_option
def command(as_json: bool) -> None:
    """See what is installed and what is broken.

    Looks at Python and its libraries, at ROS 2 and its settings, at disk and shared memory, and
    lets two processes exchange a message. Each line is ok, a warning or a fault, with what to do
    about it.
    """
    findings = examine()
    is_healthy = all(finding.status is not Status.FAULT for finding in findings)
    if as_json:
        items = [{**vars(finding), "status": finding.status.value} for finding in findings]
        click.echo(format_json({"healthy": is_healthy, "findings": items}), nl=False)
    else:
        _print_findings(make_console(), findings)
    if not is_healthy:
        raise SystemExit(EXIT_FAULT)


def examine() -> list[Finding]:
    """Run every check."""
    return [
        _find("Python", f"{sys.version.split()[0]} ({sys.executable})"),
        *check_libraries(),
        check_simulators(),
        check_distribution(os.environ),
        check_domain(os.environ),
        check_discovery(os.environ),
        *check_conversation(),
        check_disk(Path.cwd()),
        check_shared_memory(),
    ]


def _print_findings(console: Console, findings: Sequence[Finding]) -> None:
    print_facts(
        console,
        [
            (
                Text(finding.status.value, style=STYLES[finding.status]),
                finding.name,
                Text.assemble(
                    finding.text, (f"\n{finding.advice}" * bool(finding.advice), "bold")
                ),
            )
            for finding in findings
        ],
    )
    parts = [
        format_count(count, status.value)
        for status in (Status.FAULT, Status.WARNING)
        if (count := sum(finding.status is status for finding in findings))
    ]
    console.print(f"{' and '.join(parts)}: see what to do above." if parts else "All is well.")
