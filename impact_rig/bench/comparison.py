"""Figures of two benches: by how much they differ, and whether that is more than their spread."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from impact_rig.bench.figures import Figure
from impact_rig.bench.run import BenchResults

MeasuredFigures = Mapping[tuple[str, str], Figure]
"""Figures by the names of their part and of themselves."""
PERCENT = 100.0


@dataclass(frozen=True)
class Change:
    """What has become of a figure.

    Attributes
    ----------
    percent : float
        Change of the median [%]; NaN: it was 0.
    is_beyond_spread : bool or None
        The quartiles of both have nothing in common; None: one of them was measured once, and
        its spread is not known.
    """

    percent: float
    is_beyond_spread: bool | None


def compare_figures(
    results: BenchResults, earlier: MeasuredFigures
) -> dict[tuple[str, str], Change]:
    """Return the changes of all figures that another bench has measured, too."""
    return {
        (part.name, figure.name): compare_figure(figure, earlier[part.name, figure.name])
        for part in results.parts
        for figure in part.figures
        if (part.name, figure.name) in earlier
    }


def compare_figure(figure: Figure, earlier: Figure) -> Change:
    """Return what has become of a figure."""
    before, now = earlier.median, figure.median
    percent = PERCENT * (now - before) / abs(before) if before else math.nan
    if now == before:
        percent = 0.0
    if min(len(figure.values), len(earlier.values)) == 1:
        return Change(percent, None)
    (low, high), (earlier_low, earlier_high) = figure.quartiles, earlier.quartiles
    return Change(percent, low > earlier_high or high < earlier_low)
