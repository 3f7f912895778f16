"""The memory of a triggered digitizer: a ring that is written until a while after its trigger."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

CountArray = NDArray[np.int16]

SIZE = 16_384
"""Points of each channel."""
QUIET = 100
"""Points at either end of a signal that stand for the rest that goes on before and after it."""


class RingMemory:
    """Two or more channels, sampled all the time since `start`, by the clock of this computer.

    What was sampled is worked out when somebody looks: nothing runs in the meantime.

    Parameters
    ----------
    channels : int
        How many.
    clock : callable
        Returns seconds.
    """

    def __init__(self, channels: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._stored: CountArray = np.zeros((channels, SIZE), np.int16)
        self._signal: CountArray = np.zeros((channels, QUIET), np.int16)
        self._signal_start = 0
        self._rate = 1.0
        self._began: float | None = None
        self._origin = 0
        self._post = 0
        self._trigger: int | None = None

    @property
    def is_running(self) -> bool:
        """Whether it samples, or has until its trigger's delay was over."""
        return self._began is not None

    def start(self, rate: float, post: int) -> None:
        """Begin to sample at `rate` [Hz]; of what follows a trigger, `post` points are kept."""
        self.stop()
        self._rate, self._post = rate, post
        self._signal_start = -self._signal.shape[1]
        self._began = self._clock()

    def stop(self) -> None:
        """Keep what is there."""
        if self._began is not None:
            self._stored = self._look(np.arange(SIZE))
            self._origin = self.find_write_position()
        self._began, self._trigger = None, None

    def lay(self, signal: CountArray) -> None:
        """Let a signal, of shape (channels, n), come in from now on."""
        self._signal, self._signal_start = signal, self._count()

    def trigger_now(self) -> None:
        """Trigger, whatever comes in."""
        self._trigger = self._count()

    def trigger_on(self, channel: int, sign: int, level: int, hysteresis: int) -> float | None:
        """Look for the trigger in the signal that was laid.

        Parameters
        ----------
        channel : int
            Counted from 0.
        sign : int
            1: the signal must rise through the level; -1: fall.
        level, hysteresis : int
            In counts: it must have been further than the hysteresis from the level before.

        Returns
        -------
        float or None
            How long until the memory is full [s]; None: no trigger.
        """
        height = sign * self._signal[channel].astype(float)
        low = height < sign * level - hysteresis
        if self._began is None or not low.any():
            return None
        begin = int(np.argmax(low))
        above = height[begin:] >= sign * level
        if not above.any():
            return None
        self._trigger = self._signal_start + begin + int(np.argmax(above))
        full = self._began + (self._trigger + self._post) / self._rate
        return full - self._clock()

    def is_triggered(self) -> bool:
        """Return whether the trigger has come."""
        return self._trigger is not None and self._count() >= self._trigger

    def is_full(self) -> bool:
        """Return whether all that follows the trigger is written."""
        return self._trigger is not None and self._count() >= self._trigger + self._post

    def find_write_position(self) -> int:
        """Return where the next point will be written."""
        return (self._origin + self._count()) % SIZE

    def find_trigger_position(self) -> int:
        """Return where the trigger's point was written; without one, where the first point was."""
        return (self._origin + (self._trigger or 0)) % SIZE

    def read(self, channel: int, start: int, count: int) -> CountArray:
        """Return `count` points of a channel, counted from 0, from a place of the ring on."""
        return self._look((start + np.arange(count)) % SIZE)[channel]

    def _count(self) -> int:
        """Return how many points have been written since the start."""
        if self._began is None:
            return 0
        count = int((self._clock() - self._began) * self._rate)
        return count if self._trigger is None else min(count, self._trigger + self._post)

    def _look(self, positions: NDArray[np.int64]) -> CountArray:
        """Return what stands at some places of the ring now, of shape (channels, n)."""
        count = self._count()
        newest = self._origin + count - 1
        points = count - 1 - (newest - positions) % SIZE
        fresh = self._signal[:, self._find_places(points)]
        return np.where(points >= 0, fresh, self._stored[:, positions])

    def _find_places(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which place of the signal each point shows: its ends go on by themselves."""
        places = points - self._signal_start
        size = self._signal.shape[1]
        quiet = min(QUIET, size)
        before, after = places % quiet, size - quiet + (places - size) % quiet
        return np.where(places < 0, before, np.where(places >= size, after, places))
