"""Bounds on a file's memory and time: by its heading, or in a second process."""

import contextlib
import faulthandler
import os
import signal
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import cast

from impact_rig.core.given.errors import FileError
from impact_rig.files.measurement import Measurement

MEMORY, MEMORY_PER_BYTE = 1 << 28, 16
"""What a file may unpack to [byte], and that for each byte of it [-], our choice: packed files of
thirty million points, of whatever size."""
TIME, TIME_PER_BYTE = 5.0, 2e-7
"""What reading a file may take of a processor [s], and that for each byte of it [s], our choice: a
tenth of the speed at which packed numbers are read."""

STATE = Path("/proc/self/statm")
"""What Linux tells of a process's memory."""


def check_size(path: Path, size: int) -> None:
    """Raise `MemoryError` if a file claims to hold more bytes than one of its size may."""
    if size > MEMORY + MEMORY_PER_BYTE * path.stat().st_size:
        raise MemoryError


def read_apart(library: str, parse: Callable[[Path], Measurement], path: Path) -> Measurement:
    """Read a file in a second process: damaged ones crash scipy, and libhdf5 never ends on some.

    Only Linux bounds a process; on other systems the file is read in this one.

    Parameters
    ----------
    library : str
        What reads it: loaded here, once, so that its size and time do not count.
    parse : callable
        Reads the file.

    Raises
    ------
    FileError
        As `parse`, or if that process crashes or takes too long.
    """
    with contextlib.suppress(ImportError):
        import_module(library)
    if find_spec("resource") is None or not STATE.exists():
        return parse(path)
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_parse_within_limits, args=(parse, path, sender))
    process.start()
    sender.close()
    try:
        outcome = receiver.recv()
    except EOFError:
        raise FileError(
            f"{path} is no sound {path.suffix.lower()} file: it crashes the library that reads it,"
            " or keeps it busy"
        ) from None
    finally:
        process.join()
    if isinstance(outcome, Exception):
        raise outcome
    return cast(Measurement, outcome)


def _parse_within_limits(
    parse: Callable[[Path], Measurement], path: Path, sender: Connection
) -> None:
    import resource

    # What a crash prints, its library's or Python's, is no news: the parent says it in a sentence.
    faulthandler.disable()
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    size = path.stat().st_size
    pages = int(STATE.read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY + MEMORY_PER_BYTE * size
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        limit = min(limit, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))
    signal.setitimer(signal.ITIMER_PROF, TIME + TIME_PER_BYTE * size)  # its signal ends a process
    try:
        outcome: Measurement | Exception = parse(path)
    except Exception as error:  # noqa: BLE001 - raised where the file is read
        outcome = error
    sender.send(outcome)
