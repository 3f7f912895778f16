"""Which files make up a recording in a folder as rosbag2 writes it, and in what order."""

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from impact_rig.core.errors import FileError

SUFFIX = ".mcap"
"""What a recording's name ends with."""
METADATA_NAME = "metadata.yaml"
"""The file that lists the others."""
METADATA_LIMIT = 16 << 20
"""What is read of it at most [byte], our choice: enough for 50 000 files."""

_NUMBERED = re.compile(r"(?P<name>.+)_(?P<number>\d{1,9})\.mcap")
_LIST = re.compile(r"^[ ]*relative_file_paths:[ ]*\n(?P<items>(?:[ ]*-[ ].*\n?)+)", re.MULTILINE)
_ITEM = re.compile(r"^[ ]*-[ ]+(.*\S)", re.MULTILINE)
_SQLITE_SUFFIXES = frozenset({".db3", ".db3-wal", ".db3-shm"})


def is_bag_folder(path: Path) -> bool:
    """Return whether a path is a folder with a list of files, or with files numbered from 0."""
    return path.is_dir() and (
        (path / METADATA_NAME).is_file() or bool(_list_numbered(path)) or _is_sqlite(path)
    )


def find_bag_files(folder: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Return the files of a recording in their order, and which are missing, in words.

    The list in `metadata.yaml` tells them, and after it the numbers in the names: a recorder
    that was killed has not listed its last files.

    Parameters
    ----------
    folder : Path
        As rosbag2 writes it.

    Raises
    ------
    FileError
        If none of its files is there, they belong to several recordings, or are none of MCAP.
    """
    numbered = _list_numbered(folder)
    listed = _read_list(folder)
    if not any((folder / name).is_file() for name in listed):
        listed = []
    stems = {_split_name(name)[0] for name in listed or numbered}
    if not listed and len(stems) > 1:
        raise FileError(
            f"{folder} holds several recordings, {', '.join(sorted(stems))}, and no"
            f" {METADATA_NAME}: name one of their files"
        )
    names = dict.fromkeys([*listed, *(it for it in numbered if _split_name(it)[0] in stems)])
    present = tuple(folder / name for name in names if (folder / name).is_file())
    if not present:
        raise _make_error(folder)
    return present, tuple(_describe_missing(listed, list(names), {path.name for path in present}))


def _read_list(folder: Path) -> list[str]:
    """Return the names in `metadata.yaml`; none where it is not there or makes no sense.

    Only its list of files is looked at, as rosbag2 writes it: a name in each line. A YAML reader
    takes minutes for a file that nests deep.
    """
    try:
        with (folder / METADATA_NAME).open("rb") as file:
            text = file.read(METADATA_LIMIT).decode("utf-8", "replace")
    except OSError:
        return []
    match = _LIST.search(text)
    items = _ITEM.findall(match["items"]) if match else []
    # The folder stands before the name in the lists of old versions.
    names = [Path(item.strip("\"'")).name for item in items]
    return list(dict.fromkeys(name for name in names if name.endswith(SUFFIX)))


def _list_numbered(folder: Path) -> list[str]:
    """Return the names that are numbered from 0 on, in the order of their numbers."""
    names = [path.name for path in folder.glob(f"*{SUFFIX}") if _NUMBERED.fullmatch(path.name)]
    begun = {_split_name(name)[0] for name in names if _split_name(name)[1] == 0}
    return sorted((name for name in names if _split_name(name)[0] in begun), key=_split_name)


def _split_name(name: str) -> tuple[str, int]:
    match = _NUMBERED.fullmatch(name)
    return (match["name"], int(match["number"])) if match else (name, 0)


def _describe_missing(listed: list[str], names: list[str], present: set[str]) -> Iterator[str]:
    """Yield the names, or from which to which, that are listed or left out in the numbers."""
    groups: dict[str, list[str]] = {}
    for name in names:
        if _NUMBERED.fullmatch(name):
            groups.setdefault(_split_name(name)[0], []).append(name)
        elif name not in present:
            yield name
    is_listed = frozenset(listed)
    for stem, group in groups.items():
        # The oldest files may have been dropped on purpose: then they are not listed.
        first = min((_split_name(name)[1] for name in group if name in is_listed), default=0)
        there = sorted(_split_name(name)[1] for name in group if name in present)
        last = max(_split_name(name)[1] for name in group)
        for before, after in pairwise((first - 1, *there, last + 1)):
            if after - before > 1:
                ends = dict.fromkeys((before + 1, after - 1))
                yield " to ".join(f"{stem}_{number}{SUFFIX}" for number in ends)


def _is_sqlite(folder: Path) -> bool:
    return any(path.suffix in _SQLITE_SUFFIXES for path in folder.iterdir())


def _make_error(folder: Path) -> FileError:
    if _is_sqlite(folder):
        return FileError(
            f"{folder} is a recording in SQLite (.db3): MCAP can be read; `ros2 bag convert`"
            " makes that of it"
        )
    return FileError(f"{folder} is a folder without a recording: there is no {SUFFIX} file in it")
