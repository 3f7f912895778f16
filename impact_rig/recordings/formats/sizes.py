"""What a file may unpack to, known from its heading before anything is allocated."""

from pathlib import Path

from impact_rig.core.errors import FileError

MEMORY, MEMORY_PER_BYTE = 1 << 28, 16
"""What a file may unpack to [byte], and that for each byte of it [-], our choice: packed files of
thirty million points, of whatever size."""


class SizeLimit:
    """Adds up what a file claims to hold, and refuses what no file of its size may."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._left = MEMORY + MEMORY_PER_BYTE * path.stat().st_size

    def claim(self, size: int) -> None:
        """Count an array of some bytes in.

        Raises
        ------
        FileError
            If all arrays together are too large.
        """
        self._left -= size
        if self._left < 0:
            raise FileError(
                f"{self._path} cannot be read: it asks for more memory than a file of its size may"
            )
