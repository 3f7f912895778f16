"""Files that are named twice: each is evidence of its hits once only."""

import filecmp
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from impact_rig.recordings.bag import SUFFIX


class _Content(NamedTuple):
    """What a path leads to.

    Attributes
    ----------
    path : Path
        As it was given.
    files : tuple of Path
        Itself, or the recording's files in a folder.
    stats : tuple of os.stat_result
        Theirs.
    """

    path: Path
    files: tuple[Path, ...]
    stats: tuple[os.stat_result, ...]

    @property
    def identities(self) -> set[tuple[int, int]]:
        """Which files these are, whatever they are called."""
        return {(stat.st_dev, stat.st_ino) for stat in self.stats}

    @property
    def sizes(self) -> list[int]:
        """Of the files [byte]."""
        return [stat.st_size for stat in self.stats]


def find_repeated_files(paths: Sequence[Path]) -> dict[int, str]:
    """Find the paths that lead to what an earlier one leads to, by links or as copies.

    Files are compared byte by byte only where their sizes are the same.

    Parameters
    ----------
    paths : sequence of Path
        Files, and folders of recordings. What cannot be read is passed over: whoever reads it
        says so.

    Returns
    -------
    dict of int to str
        A sentence for each place in `paths` that is to be left out.
    """
    repeated: dict[int, str] = {}
    known: list[_Content] = []
    for place, path in enumerate(paths):
        content = _look_at(path)
        if content is None:
            continue
        sentence = next(filter(None, (_compare(content, earlier) for earlier in known)), None)
        if sentence is None:
            known.append(content)
        else:
            repeated[place] = sentence
    return repeated


def list_files(path: Path) -> tuple[Path, ...]:
    """Return the files of a recording in a folder, or the file itself, which may be missing."""
    return tuple(sorted(path.glob("*" + SUFFIX))) if path.is_dir() else (path,)


def _look_at(path: Path) -> _Content | None:
    try:
        files = list_files(path)
        return _Content(path, files, tuple(file.stat() for file in files)) if files else None
    except OSError:
        return None


def _compare(content: _Content, earlier: _Content) -> str | None:
    """Return what the two have in common, in words; None: nothing."""
    if content.identities == earlier.identities:
        return (
            f"{content.path} and {earlier.path} are the same: it is used once"
            if content.path != earlier.path
            else f"{content.path} is named twice: it is used once"
        )
    if content.identities & earlier.identities:
        return f"{content.path} is left out: it has a file in common with {earlier.path}"
    if content.sizes == earlier.sizes and any(content.sizes) and _are_copies(content, earlier):
        return f"{content.path} is left out: it is a copy of {earlier.path}, byte by byte"
    return None


def _are_copies(content: _Content, earlier: _Content) -> bool:
    try:
        pairs = zip(content.files, earlier.files, strict=True)
        return all(filecmp.cmp(one, other, shallow=False) for one, other in pairs)
    except OSError:
        return False
