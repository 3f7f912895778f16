"""When which block of a running stream is due, and what a full buffer loses."""

from impact_rig.core.checks import check_between, check_positive


class BlockClock:
    """The sampling clock of a digitizer, with a buffer of limited depth behind it.

    It counts blocks, and is told the time: what is not fetched before the buffer is full is lost,
    the oldest first.

    Parameters
    ----------
    period : float
        Between two blocks [s].
    depth : int
        Blocks that may wait.
    now : float
        Time at which the first point is taken [s].

    Attributes
    ----------
    next_block : int
        First block that has not been fetched yet.
    dropped : int
        Blocks that the buffer has lost.
    delay : float
        How long the oldest block waited that was fetched last [s].

    Raises
    ------
    ParameterError
        If the period is not positive or the depth below one block.
    """

    def __init__(self, period: float, depth: int, now: float) -> None:
        check_positive("block period", period, "s")
        check_between("stream depth", depth, 1, 1_000_000)
        self._period = period
        self._depth = depth
        self._start = now
        self.next_block = 0
        self.dropped = 0
        self.delay = 0.0

    def fetch(self, now: float) -> range:
        """Return the numbers of the blocks that are complete by `now` and not lost."""
        stop = max(int((now - self._start) / self._period), self.next_block)
        lost = max(stop - self._depth - self.next_block, 0)
        self.dropped += lost
        first = self.next_block + lost
        self.next_block = stop
        if first < stop:
            self.delay = now - self.find_time(first + 1)
        return range(first, stop)

    def find_time(self, number: int) -> float:
        """Return when a block begins [s]."""
        return self._start + number * self._period
