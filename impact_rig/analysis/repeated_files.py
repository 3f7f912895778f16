"""Files that are named twice: each is evidence of its hits once only."""

from collections.abc import Sequence
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recordings.provenance import compute_sha256


def find_repeated_files(paths: Sequence[Path]) -> dict[int, str]:
    """Find the files that hold what an earlier one holds: the same one, a link to it, or a copy.

    Parameters
    ----------
    paths : sequence of Path
        Files. What cannot be read or is empty is passed over: its reader names it.

    Returns
    -------
    dict of int to str
        A sentence for each place in `paths` that is to be left out.
    """
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    repeated: dict[int, str] = {}
    known: dict[str, Path] = {}
    for place, path in enumerate(paths):
        if not sizes[place] or sizes.count(sizes[place]) == 1:
            continue
        try:
            digest = compute_sha256(path)
        except FileError:
            continue
        earlier = known.setdefault(digest, path)
        if earlier is not path or path in paths[:place]:
            repeated[place] = (
                f"{path} is named twice: it is used once"
                if path == earlier
                else f"{path} is left out: it is a copy of {earlier}, byte by byte"
            )
    return repeated
