"""Counts what a recording has of a running stream, and what it lacks."""

from dataclasses import dataclass


@dataclass
class StreamWatch:
    """Follows the blocks of the running stream of one accelerometer pair.

    Attributes
    ----------
    blocks : int
        In the recording [-].
    points : int
        In them, per channel [-].
    gaps : int
        Jumps of `first_sample` in them [-].
    missing_points : int
        That they lack, per channel [-].
    """

    blocks: int = 0
    points: int = 0
    gaps: int = 0
    missing_points: int = 0
    _expected: int | None = None

    def add(self, first_sample: int, points: int) -> None:
        """Count a block in.

        Parameters
        ----------
        first_sample : int
            Index of its first point, counted since the stream began. A recording may begin in
            the middle of a stream, and one that goes back is another one: neither is a gap.
        points : int
            Per channel.
        """
        if self._expected is not None and first_sample > self._expected:
            self.gaps += 1
            self.missing_points += first_sample - self._expected
        self._expected = first_sample + points
        self.blocks += 1
        self.points += points
