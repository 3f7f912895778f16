"""What a file may take of memory and time: by its heading, or in a second process."""

import contextlib
import os
import resource
import signal
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.measurement import Measurement

MEMORY, MEMORY_PER_BYTE = 1 << 28, 16
"""What a file may unpack to [byte], and that for each byte of it [-], our choice: packed files of
thirty million points, of whatever size."""
TIME, TIME_PER_BYTE = 5.0, 2e-7
"""What reading a file may take of a processor [s], and that for each byte of it [s], our choice: a
tenth of the speed at which packed numbers are read."""


class SizeLimit:
    """Adds up what a file claims to hold, and refuses what no file of its size may."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._left = MEMORY + MEMORY_PER_BYTE * path.stat().st_size

    def claim(self, size: int) -> None:
        """Count an array of some bytes in.

        Raises
        ------
        FileError
            If all arrays together are too large.
        """
        self._left -= size
        if self._left < 0:
            raise FileError(
                f"{self._path} cannot be read: it asks for more memory than a file of its size may"
            )


_POOL: list[ProcessPoolExecutor] = []
"""The second process; empty: it was not needed yet."""


def read_apart(parse: Callable[[Path], Measurement], path: Path) -> Measurement:
    """Read a file in a second process: damaged ones crash scipy, and libhdf5 never ends on some.

    Raises
    ------
    FileError
        As `parse`, or if that process crashes or takes too long.
    """
    try:
        return _submit(parse, path).result()
    except BrokenProcessPool:
        _POOL.clear()
        raise FileError(
            f"{path} is no sound {path.suffix.lower()} file: it crashes the library that reads it,"
            " or keeps it busy"
        ) from None


def _submit(parse: Callable[[Path], Measurement], path: Path) -> "Future[Measurement]":
    try:
        return _POOL[0].submit(_parse_within_limits, parse, path)
    except (IndexError, BrokenProcessPool):  # there is none yet, or it was killed since
        context = get_context("spawn")
        _POOL[:] = [ProcessPoolExecutor(1, context, initializer=_end_with_parent)]
        return _POOL[0].submit(_parse_within_limits, parse, path)


def _end_with_parent() -> None:
    """End this process when the one that it reads for is gone, even if that was killed."""

    def wait() -> None:
        if parent := parent_process():
            parent.join()
        os._exit(1)

    Thread(target=wait, daemon=True).start()


def _parse_within_limits(parse: Callable[[Path], Measurement], path: Path) -> Measurement:
    for library in ("scipy.io", "h5py"):  # they do not count
        with contextlib.suppress(ImportError):
            import_module(library)
    size = path.stat().st_size
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY + MEMORY_PER_BYTE * size
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        limit = min(limit, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))
    signal.setitimer(signal.ITIMER_PROF, TIME + TIME_PER_BYTE * size)  # its signal ends a process
    return parse(path)
