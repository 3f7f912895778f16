"""Figures with their goals, the parts of the bench that measure them, and how parts are run."""

import gc
import importlib
import math
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median, quantiles

from bench import PARTS
from bench.campaigns import Campaigns
from impact_rig import __version__
from impact_rig.core.errors import RigError


@dataclass(frozen=True)
class Goal:
    """What is asked of a figure.

    Attributes
    ----------
    is_upper : bool
        The figure must not be larger than the limit; else not smaller.
    limit : float
        In the figure's unit.
    """

    is_upper: bool
    limit: float

    def __str__(self) -> str:
        """Return the goal in words."""
        return f"{'at most' if self.is_upper else 'at least'} {self.limit:g}"

    def is_reached(self, value: float) -> bool:
        """Return whether a value meets the goal; one that was not determined does not."""
        if not math.isfinite(value):
            return False
        return value <= self.limit if self.is_upper else value >= self.limit


def at_most(limit: float) -> Goal:
    """Return the goal of a figure that must not be larger."""
    return Goal(is_upper=True, limit=limit)


def at_least(limit: float) -> Goal:
    """Return the goal of a figure that must not be smaller."""
    return Goal(is_upper=False, limit=limit)


@dataclass(init=False)
class Figure:
    """One row of what is measured.

    Attributes
    ----------
    name : str
        What was measured.
    values : tuple of float
        Each measurement, in the order in which they were made; at least one.
    unit : str
        "" for numbers and ratios.
    goal : Goal or None
        For the median; None: nothing is asked.
    note : str
        What must be known to read it.
    """

    name: str
    values: tuple[float, ...]
    unit: str
    goal: Goal | None
    note: str

    def __init__(
        self,
        name: str,
        values: float | Iterable[float],
        unit: str = "",
        goal: Goal | None = None,
        note: str = "",
    ) -> None:
        self.name = name
        self.values = tuple(values) if isinstance(values, Iterable) else (float(values),)
        self.unit = unit
        self.goal = goal
        self.note = note

    @property
    def median(self) -> float:
        """Of the measurements, in `unit`."""
        return median(self.values)

    @property
    def quartiles(self) -> tuple[float, float]:
        """Between which half of the measurements lie, in `unit`: their spread."""
        if len(self.values) == 1:
            return self.values[0], self.values[0]
        low, _, high = quantiles(self.values, n=4, method="inclusive")
        return low, high

    @property
    def is_reached(self) -> bool | None:
        """Whether the median meets the goal; None: there is none."""
        return None if self.goal is None else self.goal.is_reached(self.median)


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
    gc.freeze()  # what is there already is nobody's garbage here, and need not be searched
    for turn in range(repeats):
        for function, count, found in sides if turn % 2 == 0 else sides[::-1]:
            gc.collect()
            started = clock()
            for _ in range(count):
                function()
            found.append((clock() - started) / count)
    gc.unfreeze()
    return times


def divide(values: Sequence[float], references: Sequence[float]) -> tuple[float, ...]:
    """Return the ratios of what was measured in the same turn."""
    return tuple(value / other for value, other in zip(values, references, strict=True))


@dataclass(frozen=True)
class Extent:
    """How much is measured: by default little, so that all parts together take five minutes.

    Attributes
    ----------
    demos : int
        Campaigns of the paper, each of 120 hits.
    seconds : float
        Of streaming at the highest rate [s].
    hits : int
        After which the memory of the nodes is looked at again.
    kills : int
        Processes, or whole rigs, that are killed.
    mutations : int
        Damaged recordings that are read.
    repeats : int
        Measurements of each figure that is a time.
    seed : int
        Of what is drawn at random.
    """

    demos: int = 2
    seconds: float = 15.0
    hits: int = 10_000
    kills: int = 2
    mutations: int = 60
    repeats: int = 7
    seed: int = 1


FULL = Extent(demos=5, seconds=60.0, hits=10_000, kills=50, mutations=2000)
"""What every goal asks for, or more: a quarter of an hour."""


@dataclass(frozen=True)
class Bench:
    """What a part works with.

    Attributes
    ----------
    folder : Path
        Empty; it is removed afterwards.
    extent : Extent
        How much is measured.
    campaigns : Campaigns
        To measure with; the same for all parts.
    report : callable
        Takes done and all, of whatever the part counts.
    """

    folder: Path
    extent: Extent
    campaigns: Campaigns
    report: Callable[[int, int], None]


Measure = Callable[[Bench], Iterable[Figure]]
"""Measures a part; raises `RigError` where that cannot be done."""


@dataclass(frozen=True)
class Part:
    """One part of the bench.

    Attributes
    ----------
    name : str
        By which it is asked for.
    title : str
        What it measures, in one line.
    measure : callable
        Does it.
    seconds : float
        That this takes on two cores, at the extent of `Extent()` [s].
    """

    name: str
    title: str
    measure: Measure
    seconds: float


_parts: dict[str, Part] = {}


def part(name: str, title: str, seconds: float) -> Callable[[Measure], Measure]:
    """Make a part of the function that measures it; parameters as the attributes of `Part`."""

    def register(measure: Measure) -> Measure:
        _parts[name] = Part(name, title, measure, seconds)
        return measure

    return register


def load_part(name: str) -> Part:
    """Return a part by its name."""
    importlib.import_module(f"bench.{PARTS[name]}")
    return _parts[name]


PROCESSOR_FILE = Path("/proc/cpuinfo")
PROCESSOR_LINE = "model name"


@dataclass(frozen=True)
class Machine:
    """Where and with what was measured.

    Attributes
    ----------
    processor : str
        Its model, as the kernel names it.
    cores : int
        Which this process may use.
    memory_byte : int
        Of the machine [byte].
    system : str
        Kernel and its version.
    python : str
        Its version.
    software : str
        Version of this software.
    """

    processor: str
    cores: int
    memory_byte: int
    system: str
    python: str
    software: str


def describe_machine() -> Machine:
    """Return the machine that this runs on."""
    return Machine(
        processor=_read_processor(),
        cores=len(os.sched_getaffinity(0)),
        memory_byte=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        system=f"{platform.system()} {platform.release()}",
        python=platform.python_version(),
        software=__version__,
    )


def _read_processor() -> str:
    try:
        lines = PROCESSOR_FILE.read_text("utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() == PROCESSOR_LINE:
            return value.strip()
    return platform.processor() or platform.machine()


LONGEST_BENCH = 300.0
"""Of all parts together, at the extent of `Extent()` [s], as asked for."""


@dataclass(frozen=True)
class PartResults:
    """What a part found.

    Attributes
    ----------
    name, title : str
        Of the part.
    figures : tuple of Figure
        What it measured.
    seconds : float
        That it took, a campaign that it had to run first included [s].
    announced : float
        That it was expected to take [s].
    error : str
        Why it could not; empty: it could.
    """

    name: str
    title: str
    figures: tuple[Figure, ...]
    seconds: float
    announced: float
    error: str = ""


@dataclass(frozen=True)
class BenchResults:
    """What was measured, how much of it, and on which machine."""

    machine: Machine
    extent: Extent
    parts: tuple[PartResults, ...]

    @property
    def errors(self) -> tuple[str, ...]:
        """Why parts could not be measured."""
        return tuple(f"{part.name}: {part.error}" for part in self.parts if part.error)

    @property
    def whole(self) -> Figure | None:
        """How long all parts took together; None: not all of them were measured."""
        if {part.name for part in self.parts} != set(PARTS) or self.errors:
            return None
        is_limited = replace(self.extent, seed=Extent.seed) == Extent()
        goal = at_most(LONGEST_BENCH) if is_limited else None
        return Figure("the whole bench", sum(part.seconds for part in self.parts), "s", goal)

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that do not meet their goal."""
        figures = [figure for part in self.parts for figure in part.figures]
        return tuple(
            figure for figure in (*figures, self.whole) if figure and figure.is_reached is False
        )


def run_parts(
    names: Sequence[str],
    extent: Extent,
    report: Callable[[Part, int, int], None],
    show: Callable[[PartResults], None] = lambda _: None,
) -> BenchResults:
    """Run parts one after the other, each in an empty folder; one that fails costs no other.

    Parameters
    ----------
    names : sequence of str
        Of `PARTS`.
    extent : Extent
        How much is measured.
    report : callable
        Takes the part, and done and all of what it counts.
    show : callable
        Takes what a part found, as soon as it has.
    """
    results = []
    with tempfile.TemporaryDirectory(prefix="impact_rig_campaigns_") as folder:
        campaigns = Campaigns(Path(folder))
        for name in names:
            results.append(_run_part(load_part(name), extent, campaigns, report))
            show(results[-1])
    return BenchResults(describe_machine(), extent, tuple(results))


def _run_part(
    part: Part, extent: Extent, campaigns: Campaigns, report: Callable[[Part, int, int], None]
) -> PartResults:
    report(part, 0, 0)
    figures: tuple[Figure, ...] = ()
    reason = ""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"impact_rig_{part.name}_") as folder:
        bench = Bench(
            Path(folder), extent, campaigns, lambda done, total: report(part, done, total)
        )
        try:
            figures = tuple(part.measure(bench))
        except RigError as error:
            reason = str(error)
        except ModuleNotFoundError as error:
            reason = f"Python finds no module {error.name!r}: see `impact-rig doctor`"
    taken = time.perf_counter() - started
    return PartResults(part.name, part.title, figures, taken, part.seconds, reason)
