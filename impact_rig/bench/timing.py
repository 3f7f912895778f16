"""Two ways to do the same thing, timed by turns."""

import gc
import time
from collections.abc import Callable


def compare_times(
    work: Callable[[], object],
    peer: Callable[[], object],
    repeats: int,
    calls: tuple[int, int] = (1, 1),
    clock: Callable[[], float] = time.process_time,
) -> tuple[list[float], list[float]]:
    """Time two functions by turns, each of them first in every second one, after a call of each.

    Parameters
    ----------
    work, peer : callable
        What is measured, and what it is measured by.
    repeats : int
        Of each.
    calls : tuple of int
        Of `work` and of `peer` in each of their turns: many where one takes microseconds.
    clock : callable
        Returns a time [s]: by default processor time, in which other work on the machine counts
        as little as possible.

    Returns
    -------
    tuple of list of float
        Times of one call of `work` and of `peer` [s], means over the turn; those of the same turn
        stand at the same place.
    """
    times: tuple[list[float], list[float]] = ([], [])
    sides = list(zip((work, peer), calls, times, strict=True))
    work()
    peer()
    for turn in range(repeats):
        for function, count, found in sides if turn % 2 == 0 else sides[::-1]:
            gc.collect()
            started = clock()
            for _ in range(count):
                function()
            found.append((clock() - started) / count)
    return times


def divide(values: list[float], references: list[float]) -> tuple[float, ...]:
    """Return the ratios of what was measured in the same turn."""
    return tuple(value / other for value, other in zip(values, references, strict=True))
