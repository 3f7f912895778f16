"""Which files make up a recording in a folder as rosbag2 writes it, and in what order."""

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import yaml

from impact_rig.core.errors import FileError

SUFFIX = ".mcap"
"""What a recording's name ends with."""
METADATA_NAME = "metadata.yaml"
"""The file that lists the others."""
METADATA_LIMIT = 16 << 20
"""A longer list is none [byte], our choice: enough for 50 000 files."""

_NUMBERED = re.compile(r"(?P<name>.+)_(?P<number>\d{1,9})\.mcap")
_SQLITE_SUFFIXES = frozenset({".db3", ".db3-wal", ".db3-shm"})


def is_bag_folder(path: Path) -> bool:
    """Return whether a path is a folder with a list of files, or with numbered ones."""
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
    listed = _read_list(folder)
    found = _list_numbered(folder)
    names = {_split_name(name)[0] for name in (listed or found)}
    if not listed and len(names) > 1:
        raise FileError(
            f"{folder} holds several recordings, {', '.join(sorted(names))}, and no"
            f" {METADATA_NAME}: name one of their files"
        )
    later = [name for name in found if name not in listed and _split_name(name)[0] in names]
    order = [*listed, *sorted(later, key=_split_name)]
    present = tuple(folder / name for name in order if (folder / name).is_file())
    if not present:
        raise _make_error(folder)
    return present, tuple(_describe_missing(listed, order, {path.name for path in present}))


def _read_list(folder: Path) -> list[str]:
    """Return the names in `metadata.yaml`; none where it is not there or makes no sense."""
    try:
        with (folder / METADATA_NAME).open("rb") as file:
            text = file.read(METADATA_LIMIT + 1)
        if len(text) > METADATA_LIMIT:
            return []
        # The folder stands before the name in the lists of old versions.
        names = [Path(path).name for path in _find_sequence(text, "relative_file_paths")]
    except (OSError, yaml.YAMLError, ValueError):
        return []
    return list(dict.fromkeys(name for name in names if name.endswith(SUFFIX)))


def _find_sequence(text: bytes, key: str) -> Iterator[str]:
    """Yield the texts in the list after a key; deep nesting and references do no harm."""
    events = yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    for event in events:
        if isinstance(event, yaml.ScalarEvent) and event.value == key:
            break
    if isinstance(next(events, None), yaml.SequenceStartEvent):
        for event in events:
            if not isinstance(event, yaml.ScalarEvent):
                return
            yield event.value


def _list_numbered(folder: Path) -> list[str]:
    names = (path.name for path in folder.glob(f"*{SUFFIX}"))
    return sorted((name for name in names if _NUMBERED.fullmatch(name)), key=_split_name)


def _split_name(name: str) -> tuple[str, int]:
    match = _NUMBERED.fullmatch(name)
    return (match["name"], int(match["number"])) if match else (name, 0)


def _describe_missing(listed: list[str], order: list[str], present: set[str]) -> Iterator[str]:
    """Yield the names, or from which to which, that are listed or left out in the numbers."""
    for stem in dict.fromkeys(_split_name(name)[0] for name in order):
        numbers = {name: _split_name(name)[1] for name in order if _split_name(name)[0] == stem}
        # The oldest files may have been dropped on purpose: then they are not listed.
        first = min((numbers[name] for name in listed if name in numbers), default=0)
        there = sorted(number for name, number in numbers.items() if name in present)
        for before, after in pairwise((first - 1, *there, max(numbers.values()) + 1)):
            if stem.endswith(SUFFIX):
                yield from (name for name in numbers if name not in present)
            elif after - before > 1:
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
