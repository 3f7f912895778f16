"""Checks of the installation: which Python, which libraries, do they really load."""

import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata

from impact_rig.cli.checks.findings import Finding, Status

OLDEST_PYTHON = (3, 11)
SET_UP = "use `python3 launch_scripts/rig.py exec -- impact-rig ...`, which installs it"


@dataclass(frozen=True)
class Library:
    """A library that the rig uses.

    Attributes
    ----------
    module : str
        What Python imports.
    distributions : tuple of str
        Names it may be installed under, the first one for people.
    purpose : str
        What does not work without it.
    oldest : tuple of int
        Oldest version that will do; empty: any.
    is_needed : bool
        The rig cannot do its main job without it.
    advice : str
        How to get it.
    """

    module: str
    distributions: tuple[str, ...]
    purpose: str
    oldest: tuple[int, ...] = ()
    is_needed: bool = True
    advice: str = SET_UP


LIBRARIES = (
    Library("numpy", ("numpy",), "every computation", (1, 26)),
    Library("scipy", ("scipy",), "every computation", (1, 11)),
    Library("rclpy", ("rclpy",), "every node", advice=f"{SET_UP}, or source ROS 2 Jazzy"),
    Library(
        "impact_rig_msgs.msg",
        ("impact_rig_msgs", "impact-rig-msgs"),
        "every node",
        advice=f"{SET_UP}, or build and source the workspace with colcon",
    ),
    Library("domain_coordinator", ("domain-coordinator", "domain_coordinator"), "`demo`"),
    Library("GTC", ("GTC",), "every uncertainty"),
    Library("honcho", ("honcho",), "`up`"),
    Library("pint", ("pint",), "rig files"),
    Library("rosbags", ("rosbags",), "reading recordings"),
    Library("mcap", ("mcap",), "reading and writing recordings"),
    *(
        Library(
            module,
            (name,),
            f"importing and exporting {kind}",
            is_needed=False,
            advice=f"pip install {name}; all else works without it",
        )
        for module, name, kind in (
            ("nptdms", "npTDMS", ".tdms"),
            ("pyuff", "pyuff", ".uff"),
            ("h5py", "h5py", ".h5 and .mat of version 7.3"),
        )
    ),
    *(
        Library(
            module,
            (name,),
            purpose,
            is_needed=False,
            advice=f'pip install "{wanted}"; all else works without it',
        )
        for module, name, purpose, wanted in (
            ("nidaqmx", "nidaqmx", "devices of National Instruments", "nidaqmx[grpc]"),
            ("serial", "pyserial", "relays on a serial port", "pyserial"),
            ("sounddevice", "sounddevice", "sound cards", "sounddevice"),
            ("gpiod", "gpiod", "GPIO lines", "gpiod"),
        )
    ),
    Library(
        "distributed",
        ("distributed",),
        "many recordings at once",
        is_needed=False,
        advice="pip install distributed; recordings are then analyzed one after the other",
    ),
    Library(
        "matplotlib",
        ("matplotlib",),
        "the figures of `study` and `report`",
        is_needed=False,
        advice="pip install matplotlib; all else works without it",
    ),
    Library(
        "jinja2",
        ("jinja2",),
        "`report`",
        is_needed=False,
        advice="pip install jinja2; all else works without it",
    ),
    Library(
        "rerun",
        ("rerun-sdk",),
        "the visualizer",
        is_needed=False,
        advice="pip install rerun-sdk; it needs numpy 2, all else works without it",
    ),
)


def find_library(module: str) -> Library | None:
    """Return the library that a module is of; None: it is none of `LIBRARIES`."""
    top = module.partition(".")[0]
    return next((item for item in LIBRARIES if item.module.partition(".")[0] == top), None)


def check_python() -> Finding:
    """Look at the interpreter."""
    text = f"{sys.version.split()[0]} ({sys.executable})"
    if sys.version_info[:2] >= OLDEST_PYTHON:
        return Finding("Python", Status.OK, text)
    wanted = ".".join(map(str, OLDEST_PYTHON))
    return Finding("Python", Status.FAULT, text, f"use Python {wanted} or newer")


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
    findings = []
    for library, process in zip(libraries, loading, strict=True):
        errors = process.communicate()[1]
        findings.append(_judge(library, process.returncode, errors.strip()))
    return findings


def _judge(library: Library, code: int, errors: str) -> Finding:
    name = library.distributions[0]
    trouble = Status.FAULT if library.is_needed else Status.WARNING
    if code != 0:
        reason = errors.splitlines()[-1] if errors else f"Python ended with code {code}"
        missing = re.fullmatch(r"ModuleNotFoundError: No module named '(.+)'", reason)
        if missing and library.module.startswith(missing.group(1)):
            reason = f"missing; {library.purpose} needs it"
        else:
            reason = f"does not load: {reason}"
        return Finding(name, trouble, reason, library.advice)
    version = find_version(library)
    if library.oldest and version and _parse_version(version) < library.oldest:
        wanted = ".".join(map(str, library.oldest))
        return Finding(name, trouble, version, f"install {name} {wanted} or newer")
    return Finding(name, Status.OK, version or "installed")


def find_version(library: Library) -> str:
    """Return a library's version; empty: it does not say."""
    for distribution in library.distributions:
        try:
            return metadata.version(distribution)
        except metadata.PackageNotFoundError:
            continue
    return ""


def _parse_version(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", text)[:2])
