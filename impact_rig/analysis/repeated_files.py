"""Files that are named twice: each is evidence of its hits once only."""

import filecmp
import os
from collections.abc import Sequence
from pathlib import Path


def find_repeated_files(paths: Sequence[Path]) -> dict[int, str]:
    """Find the paths that lead to what an earlier one leads to, by links or as copies.

    Files are compared byte by byte only where their sizes are the same.

    Parameters
    ----------
    paths : sequence of Path
        Files. What cannot be read is passed over: its reader names it.

    Returns
    -------
    dict of int to str
        A sentence for each place in `paths` that is to be left out.
    """
    repeated: dict[int, str] = {}
    known: list[tuple[Path, os.stat_result]] = []
    for place, path in enumerate(paths):
        try:
            stat = path.stat()
        except OSError:
            continue
        sentence = next(filter(None, (_compare(path, stat, *earlier) for earlier in known)), None)
        if sentence is None:
            known.append((path, stat))
        else:
            repeated[place] = sentence
    return repeated


def _compare(path: Path, stat: os.stat_result, earlier: Path, known: os.stat_result) -> str | None:
    """Return what the two have in common, in words; None: nothing."""
    if os.path.samestat(stat, known):
        return (
            f"{path} and {earlier} are the same: it is used once"
            if path != earlier
            else f"{path} is named twice: it is used once"
        )
    if stat.st_size and stat.st_size == known.st_size and _are_copies(path, earlier):
        return f"{path} is left out: it is a copy of {earlier}, byte by byte"
    return None


def _are_copies(path: Path, earlier: Path) -> bool:
    try:
        return filecmp.cmp(path, earlier, shallow=False)
    except OSError:
        return False
