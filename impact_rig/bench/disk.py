"""Room on the disk, before something large is written."""

import shutil
from pathlib import Path

from impact_rig.core.errors import RigError

GIGA = 1e9


def check_room(folder: Path, needed: float, what: str, remedy: str) -> None:
    """Require free disk space [byte] in a folder.

    Raises
    ------
    RigError
        If there is less.
    """
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise RigError(
            f"{what} may take {needed / GIGA:.1f} GB, and {folder} has {free / GIGA:.1f} GB:"
            f" set TMPDIR to another disk, or {remedy}"
        )
