"""A new file that is written whole pieces at a time, and knows how much more the disk takes."""

import contextlib
import os
from pathlib import Path

from impact_rig.core.errors import FileError


class DiskFullError(FileError):
    """The disk takes no more, or may not: what was written before is kept."""


class DiskFile:
    """A new file, unbuffered, so that what is written is on its way to the disk at once.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder must.

    Raises
    ------
    FileError
        If the file exists already or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise FileError(
                f"{path} exists already: a recording is never overwritten, name another file"
            ) from None
        except OSError as error:
            raise FileError(f"{path} cannot be created: {error.strerror}") from None
        self.size = 0
        sync_folder(path.parent)

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def write(self, data: bytes) -> int:
        """Write all of `data`, or leave the file as it was and raise OSError."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            self._file.truncate(self.size)
            raise
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return where the next bytes go."""
        return self.size

    def flush(self) -> None:
        """Do nothing: there is no buffer."""

    def sync(self) -> None:
        """Return when everything written is on the disk itself; a power cut loses none of it."""
        os.fdatasync(self._file.fileno())

    def close(self) -> None:
        """Sync and close; safe to call twice."""
        if self._file.closed:
            return
        try:
            self.sync()
        finally:
            self._file.close()

    def measure_free_space(self) -> int:
        """Return what is free on the file's disk for such as us [byte]."""
        state = os.fstatvfs(self._file.fileno())
        return state.f_bavail * state.f_frsize


def sync_folder(folder: Path) -> None:
    """Put the names of new files in a folder on the disk, where the file system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
