"""How good an estimator is: bias and coverage on hits whose truth is known."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from impact_rig.api import Hit, VirtualRig
from impact_rig.core.errors import ParameterError
from impact_rig.present.printed import Printed
from impact_rig.results.numbers import MISSING
from impact_rig.results.tables import Column, Table, make_table, make_text_column

Estimator = Callable[[Hit], Any]
"""Gets a hit; returns its estimate in SI units, or that and its expanded uncertainty."""


@dataclass(frozen=True)
class Score:
    """What an estimator made of one sample."""

    sample: str
    hits: int
    failed: int  # it raised an error, or found no number
    bias: float  # mean of estimate over truth, minus 1 [-]
    spread: float  # standard deviation of the same [-]
    coverage: float  # part of the hits whose truth lies within ± U [-]; NaN: it states no U


class Scores(Printed, tuple[Score, ...]):
    """Scores of all samples; they print themselves as a table."""

    def list_tables(self) -> list[Table]:
        """Return what is printed."""

        def show(values: list[float]) -> list[str]:
            return [f"{100.0 * item:.3f}" if math.isfinite(item) else MISSING for item in values]

        columns = [
            make_text_column("Sample", [item.sample for item in self]),
            Column("Hits", [str(item.hits) for item in self]),
            Column("Failed", [str(item.failed) for item in self]),
            Column("Bias [%]", show([item.bias for item in self])),
            Column("Spread [%]", show([item.spread for item in self])),
            Column("Coverage [%]", show([item.coverage for item in self])),
        ]
        return [make_table("Scores", columns)]

    __repr__ = Printed.__str__


def score(
    estimator: Estimator,
    *,
    quantity: str = "contact_time",
    samples: Sequence[str] = (),
    impacts: int = 20,
    seed: int = 1,
    plant: str = "contact",
    faults: float = 0.0,
) -> Scores:
    """Let an estimator judge hits of the virtual rig, and compare it with the truth.

    Parameters
    ----------
    estimator : callable
        Gets an `impact_rig.Hit` and returns a number in SI units, or a pair: it and its expanded
        uncertainty U for 95 %. An error, None or NaN counts as failed.
    quantity : str
        A field of `impact_rig.Truth`.
    samples : sequence of str
        Names; empty: all.
    impacts : int
        Hits of each.
    seed, plant, faults
        As of `impact_rig.VirtualRig`; a faulty hit is scored like all others.

    Raises
    ------
    ParameterError
        If the plant has no such quantity.

    Examples
    --------
    >>> import numpy as np
    >>> def width(hit):
    ...     above = hit.time[np.abs(hit.hammer) > 0.5 * np.abs(hit.hammer).max()]
    ...     return 2.0 * (above[-1] - above[0])
    >>> (found,) = score(width, samples=["steel small"], impacts=5)
    >>> found.failed, round(found.bias, 2)
    (0, 0.08)
    """
    rig = VirtualRig(seed=seed, plant=plant, faults=faults)
    scores = []
    for name in samples or rig.samples:
        ratios, covered, failed = [], [], 0
        for hit in (rig.strike(name) for _ in range(impacts)):
            truth = getattr(hit.truth, quantity, math.nan)
            if not isinstance(truth, float) or math.isnan(truth):
                raise ParameterError(f"the plant {plant!r} has no true {quantity!r}")
            value, expanded = _ask(estimator, hit)
            if not math.isfinite(value):
                failed += 1
                continue
            ratios.append(value / truth - 1.0)
            if math.isfinite(expanded):
                covered.append(abs(value - truth) <= expanded)
        scores.append(
            Score(
                name,
                impacts,
                failed,
                bias=fmean(ratios) if ratios else math.nan,
                spread=stdev(ratios) if len(ratios) > 1 else math.nan,
                coverage=fmean(covered) if covered else math.nan,
            )
        )
    return Scores(scores)


def _ask(estimator: Estimator, hit: Hit) -> tuple[float, float]:
    """Return an estimate and its expanded uncertainty, NaN where there is none."""
    try:
        found = estimator(hit)
    except Exception:  # noqa: BLE001 - whatever a foreign estimator does is its own
        return math.nan, math.nan
    if found is None:
        return math.nan, math.nan
    value, expanded = found if isinstance(found, tuple) else (found, math.nan)
    return float(value), float(expanded)
