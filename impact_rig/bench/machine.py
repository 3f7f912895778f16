"""The machine that the figures belong to."""

import os
import platform
from dataclasses import dataclass
from pathlib import Path

from impact_rig import __version__

PROCESSOR_FILE = Path("/proc/cpuinfo")
PROCESSOR_LINE = "model name"


@dataclass(frozen=True)
class Machine:
    """Where and with what was measured.

    Attributes
    ----------
    processor : str
        Its model, as the kernel names it.
    cores : int
        Which this process may use.
    memory_byte : int
        Of the machine [byte].
    system : str
        Kernel and its version.
    python : str
        Its version.
    software : str
        Version of this software.
    """

    processor: str
    cores: int
    memory_byte: int
    system: str
    python: str
    software: str


def describe_machine() -> Machine:
    """Return the machine that this runs on."""
    return Machine(
        processor=_read_processor(),
        cores=len(os.sched_getaffinity(0)),
        memory_byte=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        system=f"{platform.system()} {platform.release()}",
        python=platform.python_version(),
        software=__version__,
    )


def _read_processor() -> str:
    try:
        lines = PROCESSOR_FILE.read_text("utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() == PROCESSOR_LINE:
            return value.strip()
    return platform.processor() or platform.machine()
