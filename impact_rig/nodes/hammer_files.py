"""What the hammer reads from files, which nobody can send it by network: enable, and last stop."""

import contextlib
import hashlib
import os
import stat
from pathlib import Path

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def describe_missing_enable(path: str) -> str:
    """Return why a file does not enable the hammer; empty: it does, or none is asked for.

    Parameters
    ----------
    path : str
        Of a file that must be there, be this user's, and lie where nobody else may write.
    """
    if not path:
        return ""
    file = Path(path).expanduser()
    try:
        status, folder = file.lstat(), file.parent.stat()
    except OSError as error:
        return f"the operator's enable {file} is not there ({error.strerror}): touch it"
    if not stat.S_ISREG(status.st_mode) or status.st_uid != os.getuid():
        return f"the operator's enable {file} is no file of this user: nobody else may give it"
    if (status.st_mode | folder.st_mode) & OTHERS_WRITE:
        return f"others may write {file} or its folder: chmod go-w both"
    return ""


class StopMemory:
    """Remembers an emergency stop beyond the end of the process, as far as files can be written.

    Parameters
    ----------
    domain : int
        ROS domain.
    full_name : str
        Of the hammer node, with its namespace.
    """

    def __init__(self, domain: int, full_name: str) -> None:
        folder = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
        name = hashlib.sha256(f"{domain}:{full_name}".encode()).hexdigest()[:16]
        self._path = Path(folder, "impact_rig", f"emergency-stop-{name}")

    @property
    def is_stopped(self) -> bool:
        """Whether an emergency stop was not reset."""
        return self._path.exists()

    def keep(self) -> str:
        """Remember a stop; return why it cannot be, empty: it is."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.touch()
        except OSError as error:
            return f"the stop will not outlast this process: {error}"
        return ""

    def forget(self) -> None:
        """Hear that it was reset."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)
