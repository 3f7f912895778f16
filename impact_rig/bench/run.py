"""Runs the parts of the bench that are asked for; one that cannot be run costs no other."""

import importlib
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.machine import Machine, describe_machine
from impact_rig.bench.part import Bench, Extent, Part
from impact_rig.bench.part_names import PARTS
from impact_rig.bench.recordings import Campaigns
from impact_rig.core.errors import RigError

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
        return Figure(
            "the whole bench",
            (sum(part.seconds for part in self.parts),),
            "s",
            at_most(LONGEST_BENCH) if is_limited else None,
        )

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that do not meet their goal."""
        figures = [figure for part in self.parts for figure in part.figures]
        return tuple(
            figure for figure in (*figures, self.whole) if figure and figure.is_reached is False
        )


def load_part(name: str) -> Part:
    """Return a part by its name."""
    part: Part = importlib.import_module(f"impact_rig.bench.parts.{name}").PART
    return part


def run_parts(
    names: Sequence[str], extent: Extent, report: Callable[[Part, int, int], None]
) -> BenchResults:
    """Run parts one after the other, each in an empty folder of its own.

    Parameters
    ----------
    names : sequence of str
        Of `PARTS`.
    extent : Extent
        How much is measured.
    report : callable
        Takes the part, and done and all of what it counts.
    """
    with tempfile.TemporaryDirectory(prefix="impact_rig_campaigns_") as folder:
        campaigns = Campaigns(Path(folder))
        results = [_run_part(name, extent, campaigns, report) for name in names]
    return BenchResults(describe_machine(), extent, tuple(results))


def _run_part(
    name: str, extent: Extent, campaigns: Campaigns, report: Callable[[Part, int, int], None]
) -> PartResults:
    part = load_part(name)
    report(part, 0, 0)

    def tell(done: int, total: int) -> None:
        report(part, done, total)

    figures: tuple[Figure, ...] = ()
    reason = ""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"impact_rig_{name}_") as folder:
        try:
            figures = part.measure(Bench(Path(folder), extent, campaigns, tell))
        except RigError as error:
            reason = str(error)
        except ModuleNotFoundError as error:
            reason = f"Python finds no module {error.name!r}: see `impact-rig doctor`"
    taken = time.perf_counter() - started
    return PartResults(name, part.title, figures, taken, part.seconds, reason)
