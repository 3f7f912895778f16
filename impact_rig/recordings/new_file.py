"""Files opened, and new ones: they replace no others, and are on the disk once that is said."""

import contextlib
import errno
import itertools
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import IO, BinaryIO

from impact_rig.core.given.errors import FileError

ROOM_FOR_ENDING = 16 << 20
"""Room left free on the disk [byte], our choice: for the end of the file, and for others."""
ROOM_FOR_INDEX = 0.01
"""Part of the size of the file that is left free beside it, our choice: the index at the end has
300 byte for a chunk, and a chunk with a hit at least 30 kB."""
KEPT_IN_MEMORY = 16 << 20
"""How much of what was written last stays in the memory of the system [byte], our choice: longer
than a disk takes to write it, so that giving it back waits for nothing."""
SENT_AT_ONCE = 4 << 20
"""How much is written before the system is asked to send it to the disk [byte], our choice: a disk
takes it in hundredths of a second, and sending less takes a tenth more of the processor."""


def open_regular(path: Path) -> BinaryIO:
    """Open a file to be read; a pipe or a device, which may never end, raises `FileError`."""
    if path.exists() and not path.is_file():
        raise FileError(f"{path} cannot be read: it is no regular file")
    return path.open("rb")


def list_successors(path: Path) -> Iterator[Path]:
    """Yield the names for files that follow each other in one place: it, it-2, it-3 ..."""
    yield path
    for number in itertools.count(2):
        yield path.with_name(f"{path.stem}-{number}{path.suffix}")


def choose_free(path: Path) -> Path:
    """Return the first of the `list_successors` of a path that is not taken."""
    return next(item for item in list_successors(path) if not os.path.lexists(item))


def is_being_written(file: IO[bytes]) -> bool:
    """Return whether another process writes a file, which is locked then, see `DiskFile`."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        fcntl.flock(file, fcntl.LOCK_UN)
    except BlockingIOError:
        return True
    except (ImportError, OSError):  # a system, or a file system, without such locks
        pass
    return False


class DiskFullError(FileError):
    """The disk is full, or nearly so; everything written before is kept."""


class DiskFile:
    """A new file, unbuffered, so that what is written is safe from the end of this process.

    `mcap.writer.Writer` writes to it as to any file. After a write that failed it takes no more.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder must.

    Raises
    ------
    DiskFullError
        If there is no room for any file.
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
        # Readers see by it that the file is being written, see `is_being_written`.
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self.path = path
        self.size = 0  # written so far [byte]
        self.failure: FileError | None = None  # why nothing can be written any more
        self._sent = 0
        self._given_back = 0
        self._planned = 0
        self._room = self._measure_room()
        if self._room <= 0:
            self.close()
            path.unlink()
            raise DiskFullError(
                f"{path} cannot be begun: its disk should have at least"
                f" {ROOM_FOR_ENDING / 1e6:.0f} MB free"
            )
        sync_folder(path.parent)

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def check(self) -> None:
        """Raise a FileError with the reason if nothing can be written any more."""
        if self.failure is not None:
            raise self.failure

    def plan(self, length: int) -> None:
        """Count on writing some bytes before the next `flush`.

        Raises
        ------
        DiskFullError
            If they would leave too little room for the end of the file.
        FileError
            If nothing can be written any more.
        """
        self.check()
        planned = self._planned + length
        if planned > self._room:
            raise self._make_error(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        self._planned = planned

    def write(self, data: bytes) -> int:
        """Write all of it, or leave the file as it was and raise FileError from now on."""
        self.check()
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            # A disk that fails altogether keeps what it took; readers stop before it.
            with contextlib.suppress(OSError):
                self._file.truncate(self.size)
            self.failure = self._make_error(error)
            raise self.failure from None
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        """Return where the next byte goes."""
        return self.size

    def flush(self) -> None:
        """Send what was written to the disk, and measure its free space again.

        Without the first, seconds of a stream wait in the memory of the system, and the sync at
        its end as long.
        """
        # The advice makes Linux begin to write what is new, and take back the memory of what is
        # written. Otherwise each chunk takes new memory, which costs three times the copying.
        if self.size - self._sent >= SENT_AT_ONCE:
            self._advise(self._sent, self.size)
            self._sent = self.size
        if self.size - self._given_back > 2 * KEPT_IN_MEMORY:
            self._advise(self._given_back, self.size - KEPT_IN_MEMORY)
            self._given_back = self.size - KEPT_IN_MEMORY
        self._planned = 0
        self._room = self._measure_room()

    def sync(self) -> None:
        """Return when everything written is on the disk itself and survives a power cut.

        Raises
        ------
        FileError
            If the disk fails, or the file was deleted, replaced or cut meanwhile.
        """
        try:
            getattr(os, "fdatasync", os.fsync)(self._file.fileno())  # only some systems have it
            written, named = os.fstat(self._file.fileno()), self.path.stat()
        except FileNotFoundError:
            raise FileError(f"{self.path} was deleted while it was written") from None
        except OSError as error:
            raise self._make_error(error) from None
        if not os.path.samestat(written, named):
            raise FileError(f"{self.path} was replaced while it was written")
        if written.st_size < self.size:
            raise FileError(
                f"{self.path} was cut to {written.st_size} byte while it was written: there were"
                f" {self.size}"
            )

    def close(self) -> None:
        """Sync and close; safe to call twice; raises as `sync`."""
        if self.closed:
            return
        try:
            self.sync()
        finally:
            self.failure = self.failure or FileError(f"{self.path} is closed already")
            try:
                self._file.close()
            except OSError as error:  # network drives say here what they have not written
                raise self._make_error(error) from None

    def _advise(self, start: int, end: int) -> None:
        # That it is not followed, or that the system takes none, does no harm.
        with contextlib.suppress(AttributeError, OSError):
            os.posix_fadvise(self._file.fileno(), start, end - start, os.POSIX_FADV_DONTNEED)

    def _measure_room(self) -> int:
        try:
            place = self._file.fileno() if hasattr(os, "statvfs") else self.path.parent
            free = shutil.disk_usage(place).free
        except OSError as error:
            raise self._make_error(error) from None
        return free - ROOM_FOR_ENDING - int(ROOM_FOR_INDEX * self.size)

    def _make_error(self, error: OSError) -> FileError:
        is_full = error.errno in {errno.ENOSPC, errno.EDQUOT}
        return (DiskFullError if is_full else FileError)(
            f"{self.path} cannot be written: {error.strerror}; it keeps what was written before"
        )


def sync_folder(folder: Path) -> None:
    """Put the names of new files in a folder on the disk, where the file system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextlib.contextmanager
def write_new_file(path: Path) -> Iterator[Path]:
    """Lend a path to write to; its file gets its name at the end of the block.

    By then it is on the disk, and a power cut takes nothing of it. If the block fails, nothing
    is left behind.

    Parameters
    ----------
    path : Path
        Of the new file; it must not exist, its folder is made.

    Yields
    ------
    Path
        Where to write; there is no file yet. In the same folder, so that naming it cannot fail
        for want of space.

    Raises
    ------
    FileError
        If there is a file of that name already, before or after, or it cannot be written.
    """
    _refuse_existing(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    make_folders(path.parent)
    try:
        part.unlink(missing_ok=True)
        yield part
        with part.open("r+b") as file:  # Windows syncs what may be written
            os.fsync(file.fileno())
        _name(part, path)
        sync_folder(path.parent)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def _refuse_existing(path: Path) -> None:
    if os.path.lexists(path):
        raise FileError(f"{path} exists already: name another file, none is overwritten")


def make_folders(folder: Path) -> None:
    """Make a folder and those above it, and put their names on the disk.

    Raises
    ------
    FileError
        If one cannot be made.
    """
    try:
        missing = [item for item in (folder, *folder.parents) if not item.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise FileError(f"the folder {folder} cannot be made: a file is in its way") from None
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made: {error.strerror}") from None
    for item in missing:
        sync_folder(item.parent)


def _name(part: Path, path: Path) -> None:
    try:
        # A link, unlike a renaming, does not replace what has come into being meanwhile.
        path.hardlink_to(part)
    except OSError:  # some file systems, such as FAT, have no links
        _refuse_existing(path)
        part.rename(path)
