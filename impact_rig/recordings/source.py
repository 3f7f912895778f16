"""Finds the recordings that a person names."""

import contextlib
import itertools
import re
import shlex
from pathlib import Path

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.new_file import list_successors, open_regular
from impact_rig.recordings.scan import MAGIC, Scan

SUFFIX = ".mcap"
"""Suffix of a recording."""
RUN_NAME = "session"
"""Name of the recording in a run's folder, without the suffix."""
POINTER = b"version https://git-lfs.github.com/spec/"
"""Beginning of what git-lfs leaves in place of a file."""
RIG_TYPES = "impact_rig_msgs/"
"""Beginning of the names of the rig's own message types."""
OTHER_FORMS = (".db3", ".mcap.zstd")
"""Ends of the names of recordings in SQLite, and of those that rosbag2 compressed as a whole."""


def find_recordings(path: Path) -> tuple[Path, ...]:
    """Return the recordings of the run that a path means, in the order of their recording.

    Parameters
    ----------
    path : Path
        An `.mcap` file, which stands for all recordings of its run, a run's folder with
        `session.mcap`, or any folder with one `.mcap` file, as `ros2 bag record` makes it.

    Raises
    ------
    FileError
        If there is nothing of that name, it is a folder without a recording, or with those of
        several runs, or the recording has to be converted first.
    """
    try:
        if not path.is_dir():
            if not path.exists():
                raise FileError(f"there is no file {path}")
            if is_other_form(path):
                raise FileError(f"{path} cannot be read: {_advise_conversion(path)}")
            with open_regular(path) as file:
                refuse_pointer(path, file.read(len(POINTER)))
            return _drop_empty(list_parts(path), path)
        run = path / f"{RUN_NAME}{SUFFIX}"
        files = sorted(path.glob(f"*{SUFFIX}"))
        if run.is_file():
            return _drop_empty(list_parts(run), run)
        if files and set(files) == set(parts := list_parts(files[0])):
            return parts
        if files:
            raise FileError(
                f"{path} is a folder with {len(files)} recordings: name one of them; if they are"
                f" parts of one, {_advise_conversion(path)}"
            )
        if any(map(is_other_form, path.iterdir())):
            raise FileError(f"{path} cannot be read: {_advise_conversion(path)}")
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None
    raise FileError(
        f"{path} is a folder without a recording: there is no {SUFFIX} file in it; name other"
        " files one by one"
    )


def _drop_empty(parts: tuple[Path, ...], named: Path) -> tuple[Path, ...]:
    """Return the parts that are not empty: a recorder that is killed at once leaves an empty file.

    If all are empty, return the named one: its reader refuses it.
    """
    return tuple(part for part in parts if part.stat().st_size) or (named,)


def list_parts(path: Path) -> tuple[Path, ...]:
    """Return all recordings of the run to which one belongs: NAME.mcap, NAME-2.mcap ...

    The recorder names them so. What another program wrote under such a name is no part, nor has
    it parts.
    """
    first = path.with_name(re.sub(r"-\d+$", "", path.stem) + path.suffix)
    named = tuple(itertools.takewhile(Path.is_file, list_successors(first)))
    if len(named) < 2 or path not in named:  # noqa: PLR2004 - itself
        return (path,)
    parts = tuple(filter(_is_of_recorder, named))
    return parts if path in parts else (path,)


def _is_of_recorder(path: Path) -> bool:
    """Return whether the recorder wrote a file, as far as its beginning can be read."""
    if not path.stat().st_size:
        return True
    scan = Scan(path, is_strict=False)
    return scan.header is None or scan.is_of_recorder


def refuse_pointer(path: Path, beginning: bytes) -> None:
    """Raise `FileError` if a file begins like what git-lfs leaves in place of it."""
    if beginning == POINTER:
        raise FileError(
            f"{path} is what git-lfs leaves in place of the file: `git lfs pull` brings the file"
        )


def is_recording(path: Path) -> bool:
    """Return whether a path means a recording of a rig, and not a file of traces.

    A name that ends with `.mcap` does, unless the file holds messages of other nodes alone:
    opening a damaged one tells what is wrong.
    """
    if is_other_form(path):
        return True
    try:
        if path.is_dir():
            find_recordings(path)
            return True
        with open_regular(path) as file:
            is_mcap = file.read(len(MAGIC)) == MAGIC
        return not is_foreign(Scan(path)) if is_mcap else path.suffix == SUFFIX
    except (FileError, OSError):
        return path.suffix == SUFFIX


def find_bag(path: Path) -> Path:
    """Return the recording of other nodes in a folder; any other path as it is."""
    with contextlib.suppress(FileError, OSError):
        if path.is_dir():
            files = find_recordings(path)
            if all(is_foreign(Scan(file)) for file in files):
                return files[0]
    return path


def is_foreign(file: Scan) -> bool:
    """Return whether an MCAP file holds messages of other nodes, and none of a rig."""
    types = [channel.type_name for channel in file.read_channels()]
    return bool(types) and not any(name.startswith(RIG_TYPES) for name in types)


def is_other_form(path: Path) -> bool:
    """Return whether a file's name is that of a recording which has to be converted."""
    return path.name.endswith(OTHER_FORMS)


def _advise_conversion(path: Path) -> str:
    folder = path if path.is_dir() else path.parent
    names = shlex.join(["--src", str(folder), "--dst", f"{folder}.converted"])
    return (
        "rosbags makes one plain MCAP file of what ros2 bag has split, compressed or written in"
        f" SQLite: rosbags-convert {names} --dst-storage mcap"
    )
