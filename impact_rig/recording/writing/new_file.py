"""Files that get their name when they are complete, and never take the place of another."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recording.writing.disk_file import sync_folder

_WITHOUT_LINKS = frozenset({errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS})
"""What file systems without links, such as FAT, say when one is asked for."""
PART_SUFFIX = ".part"
"""What a file's name ends with while it is being written."""


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
    part = path.with_name(f".{path.name}.{os.getpid()}{PART_SUFFIX}")
    _make_folder(path.parent)
    try:
        part.unlink(missing_ok=True)
        yield part
        _sync_content(part)
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


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise FileError(f"the folder {folder} cannot be made: a file is in its way") from None
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made: {error.strerror}") from None


def _name(part: Path, path: Path) -> None:
    try:
        # A link, unlike a renaming, does not replace what has come into being meanwhile.
        path.hardlink_to(part)
    except FileExistsError:
        _refuse_existing(path)
        raise
    except OSError as error:
        if error.errno not in _WITHOUT_LINKS:
            raise
        _refuse_existing(path)
        part.rename(path)


def _sync_content(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
