"""When a recorded moment is due: at a rate that may change, with pauses that do not count."""

import threading
import time
from collections.abc import Callable

NANOSECONDS = 1_000_000_000


class Pace:
    """The clock of a replay, which one thread waits for and others set.

    Parameters
    ----------
    rate : float
        Of the original speed [-]; 0: nothing is waited for.
    is_paused : bool
        Whether it begins with a pause.
    """

    def __init__(self, rate: float, *, is_paused: bool = False) -> None:
        self._changed = threading.Condition()
        self._rate = rate
        self._is_paused = is_paused
        self._is_stepping = False
        self._is_stopped = False
        self._position = 0
        self._since = time.monotonic()

    @property
    def is_paused(self) -> bool:
        """Whether nothing is due; not while a step is made."""
        return self._is_paused and not self._is_stepping

    @property
    def is_stopped(self) -> bool:
        """Whether nothing will be due any more."""
        return self._is_stopped

    @property
    def is_free(self) -> bool:
        """Whether everything is due at once: a rate of 0, or a step."""
        return self._rate == 0.0 or self._is_stepping

    def jump(self, position: int) -> None:
        """Let the recorded moment `position` [ns] be now."""
        with self._changed:
            self._anchor(position)

    def set_rate(self, rate: float) -> None:
        """Go on at another speed from here."""
        with self._changed:
            self._anchor(self._find_position())
            self._rate = rate
            self._changed.notify_all()

    def pause(self) -> None:
        """Stand still."""
        with self._changed:
            self._anchor(self._find_position())
            self._is_paused = True
            self._is_stepping = False

    def resume(self) -> None:
        """Go on from where it stands."""
        with self._changed:
            self._anchor(self._position if self._is_paused else self._find_position())
            self._is_paused = self._is_stepping = False
            self._changed.notify_all()

    def step(self) -> None:
        """Let everything be due until `end_step`."""
        with self._changed:
            self._is_paused = self._is_stepping = True
            self._changed.notify_all()

    def end_step(self) -> bool:
        """Stand still again, if a step was being made; return whether it was."""
        with self._changed:
            was_stepping, self._is_stepping = self._is_stepping, False
        return was_stepping

    def stop(self) -> None:
        """Let nothing be due any more, and wake who waits."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()

    def wait_for(self, position: int, tick: Callable[[int], None], period: float) -> bool:
        """Wait until a recorded moment is due.

        Parameters
        ----------
        position : int
            The moment [ns]; afterwards it is now.
        tick : callable
            Called with the moment that is now [ns], while waiting.
        period : float
            How often [s].

        Returns
        -------
        bool
            False: it will never be due, the replay is stopped.
        """
        with self._changed:
            while not self._is_stopped:
                left = self._find_time_left(position)
                if left is not None and left <= 0.0:
                    # A late one does not make the next ones early, nor the other way round.
                    if self.is_free:
                        self._anchor(position)
                    return True
                tick(min(self._find_position(), position))
                self._changed.wait(period if left is None else min(left, period))
        return False

    def _find_time_left(self, position: int) -> float | None:
        """Return how long it takes until a moment is due [s]; None: until somebody says so."""
        if self.is_paused:
            return None
        if self.is_free:
            return 0.0
        return (position - self._find_position()) / NANOSECONDS / self._rate

    def _find_position(self) -> int:
        if self._is_paused or self._rate == 0.0:
            return self._position
        elapsed = time.monotonic() - self._since
        return self._position + round(elapsed * self._rate * NANOSECONDS)

    def _anchor(self, position: int) -> None:
        self._position = position
        self._since = time.monotonic()
