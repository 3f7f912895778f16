"""Files that get their name when they are complete, and never take the place of another."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from impact_rig.core.errors import FileError

PART_SUFFIX = ".part"
"""What a file's name ends with while it is being written."""


@contextlib.contextmanager
def write_new_file(path: Path) -> Iterator[Path]:
    """Lend a path to write to; its file gets its name at the end of the block.

    If the block fails, nothing is left behind.

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
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.unlink(missing_ok=True)
        yield part
        # A link, unlike a renaming, does not replace what has come into being meanwhile.
        path.hardlink_to(part)
    except FileExistsError:
        _refuse_existing(path)
        raise FileError(f"the folder {path.parent} cannot be made: a file is in its way") from None
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def _refuse_existing(path: Path) -> None:
    if path.exists():
        raise FileError(f"{path} exists already: name another file, none is overwritten")
