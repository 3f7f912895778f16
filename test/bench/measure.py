"""Figures with their goals, and the parts of the bench that measure them."""

import gc
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from impact_rig.core.given.errors import RigError


class Figure:
    """One number that was measured: the median of its values, beside the most or least asked."""

    def __init__(
        self,
        name: str,
        values: float | Iterable[float],
        unit: str = "",
        note: str = "",
        *,
        most: float | None = None,
        least: float | None = None,
    ) -> None:
        self.name = name
        self.found = median(values) if isinstance(values, Iterable) else float(values)
        self.unit = unit
        self.note = note
        self.goal, self.is_missed = "", False
        if most is not None:
            self.goal, self.is_missed = f"≤ {most:.4g}", not self.found <= most
        elif least is not None:
            self.goal, self.is_missed = f"≥ {least:.4g}", not self.found >= least

    def __str__(self) -> str:
        """Return name, found, goal, whether it is missed, and the note."""
        verdict = "MISSED" if self.is_missed else ""
        found = f"{self.found:.4g} {self.unit}"
        return f"{self.name:50} {found:>14} {self.goal:>9} {verdict:6} {self.note}".rstrip()


def compare_times(
    work: Callable[[], object],
    peer: Callable[[], object],
    repeats: int,
    calls: tuple[int, int] = (1, 1),
) -> tuple[list[float], list[float]]:
    """Time two functions by turns, each of them first in every second turn.

    Parameters
    ----------
    work, peer : callable
        What is measured, and what it is measured by.
    repeats : int
        Turns of each, after one call of each.
    calls : tuple of int
        Of `work` and of `peer` in each turn: many where one takes microseconds.

    Returns
    -------
    tuple of list of float
        Processor times of one call of `work` and of `peer` [s], by turn.
    """
    times: tuple[list[float], list[float]] = ([], [])
    sides = list(zip((work, peer), calls, times, strict=True))
    work()
    peer()
    gc.freeze()  # what is there already need not be searched
    for turn in range(repeats):
        for function, count, found in sides if turn % 2 == 0 else sides[::-1]:
            gc.collect()
            started = time.process_time()
            for _ in range(count):
                function()
            found.append((time.process_time() - started) / count)
    gc.unfreeze()
    return times


def divide(values: Sequence[float], references: Sequence[float]) -> tuple[float, ...]:
    """Return the ratios of what was measured in the same turn."""
    return tuple(value / other for value, other in zip(values, references, strict=True))


@dataclass(frozen=True)
class Extent:
    """How much is measured; by default all parts together take five minutes."""

    demos: int = 2  # campaigns of 120 hits
    seconds: float = 15.0  # [s] of streaming at the highest rate
    kills: int = 2  # campaigns, each with a fault
    mutations: int = 60  # damaged files of each format
    simulated: int = 36  # campaigns on each plant, and series of each fault, in part study
    repeats: int = 7  # of each figure that is a time
    seed: int = 1


FULL = Extent(demos=5, seconds=60.0, kills=50, mutations=2000, simulated=360)
"""As much as every goal asks for: three quarters of an hour."""


@dataclass(frozen=True)
class Bench:
    """What a part works with."""

    folder: Path  # empty; it is removed afterwards
    extent: Extent
    campaigns: Path  # folder of the campaigns that several parts look at
    beside: Path | None = None  # another checkout, set up, that is measured in turn


class NotHereError(RigError):
    """What a part needs is not on this machine: the others are measured all the same."""
