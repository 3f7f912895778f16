"""Where a stream of blocks does not go on as it should: found, named, never bridged."""

from dataclasses import dataclass

from impact_rig.core.signals.record import Block


@dataclass(frozen=True)
class Gap:
    """A place where the stream does not go on as it should.

    Attributes
    ----------
    low, high : int
        First point that is concerned, and the one behind the last; equal where nothing is
        missing and something else has changed.
    description : str
        In words.
    is_backward : bool
        Points are repeated, or the stream has begun anew.
    """

    low: int
    high: int
    description: str
    is_backward: bool = False


class Continuity:
    """Holds each block of a stream against the one before it.

    Parameters
    ----------
    expected : int or None
        First point of the first block; None: whatever it is.

    Attributes
    ----------
    previous : Block or None
        The last block that came.
    expected : int or None
        First point of the next one.
    """

    def __init__(self, expected: int | None) -> None:
        self.previous: Block | None = None
        self.expected = expected

    def follow(self, block: Block) -> Gap | None:
        """Take the next block; return what lies between it and the one before, if it is bad."""
        previous, expected, start = self.previous, self.expected, block.first_sample
        self.previous = block
        self.expected = start + block.hammer.output.size
        if expected is None:
            return None
        if start > expected:
            what = f"{start - expected} points missing at point {expected}"
            return Gap(expected, start, what)
        if start < expected:
            what = f"{expected - start} points repeated at point {start}"
            return Gap(start, expected, what, is_backward=True)
        if previous is not None and not _is_alike(previous, block):
            what = f"sampling rate, channels or calibration changed at point {start}"
            return Gap(start, start, what)
        return None


def _is_alike(block: Block, other: Block) -> bool:
    """Whether two blocks may be joined: equal rate, channels and calibration."""
    # A block without points does not show whether the sample is measured.
    shows_channels = block.hammer.output.size > 0 and other.hammer.output.size > 0
    return (
        block.sampling_rate == other.sampling_rate
        and (block.has_specimen == other.has_specimen or not shows_channels)
        and block.hammer.has_calibration_of(other.hammer)
        and block.specimen.has_calibration_of(other.specimen)
    )
