"""Checks of the host: disk and shared memory."""

import os
import shutil
import tempfile
from pathlib import Path

from impact_rig.cli.checks.findings import Finding, Status

SCARCE_DISK = 2e9
"""Free space below which a warning is due [bytes], our choice: some forty campaigns."""
TOO_LITTLE_DISK = 1e8
"""Free space that one campaign may fill [bytes]."""
SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - this is what Linux and Fast DDS use
SCARCE_SHARED_MEMORY = 32e6
"""Free shared memory below which a warning is due [bytes], our choice: seven nodes take about
half of it."""
MEGABYTE = 1e6
GIGABYTE = 1e9


def check_disk(folder: Path) -> Finding:
    """Look whether a campaign can be recorded in `folder`."""
    name = "disk"
    if not os.access(folder, os.W_OK):
        return Finding(
            name,
            Status.FAULT,
            f"{folder} cannot be written",
            "change into a folder of yours, or give --output",
        )
    free = shutil.disk_usage(folder).free
    text = f"{_format_size(free)} free in {folder}"
    if free < TOO_LITTLE_DISK:
        return Finding(name, Status.FAULT, text, "free some space: a campaign takes up to 100 MB")
    if free < SCARCE_DISK:
        return Finding(name, Status.WARNING, text, "free some space before a long campaign")
    return Finding(name, Status.OK, text)


def check_shared_memory(folder: Path = SHARED_MEMORY) -> Finding:
    """Look whether nodes of this host can pass messages through shared memory."""
    name = "shared memory"
    if not folder.is_dir():
        return Finding(
            name,
            Status.WARNING,
            f"there is no {folder}",
            "mount a tmpfs there; until then messages take the slower way over UDP",
        )
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return Finding(
            name,
            Status.WARNING,
            f"{folder} cannot be written ({error.strerror})",
            "let everyone write there (mode 1777); until then messages take the slower way",
        )
    usage = shutil.disk_usage(folder)
    text = f"{_format_size(usage.free)} of {_format_size(usage.total)} free in {folder}"
    if usage.free < SCARCE_SHARED_MEMORY:
        return Finding(
            name,
            Status.WARNING,
            text,
            "remove what dead processes left there (fastrtps_*) once no node runs; in a container"
            " give it more (docker run --shm-size=256m)",
        )
    return Finding(name, Status.OK, text)


def _format_size(size: float) -> str:
    if size >= GIGABYTE:
        return f"{size / GIGABYTE:.1f} GB"
    return f"{size / MEGABYTE:.0f} MB"
