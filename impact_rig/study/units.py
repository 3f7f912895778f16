"""Work units: small enough to be lost, each with random numbers of its own."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from zlib import crc32

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.study.campaigns import CampaignSource
from impact_rig.study.cases import Configuration, Part, find_case, list_cases
from impact_rig.study.estimators import Outcome, evaluate
from impact_rig.study.selection import SelectionCount, simulate_series
from impact_rig.study.speed import measure_speed

UNIT_CAMPAIGNS = 20
"""Campaigns of one unit [-], our choice: a second or two of work, which Ctrl-C waits for."""
SELECTION_KEY = "selection/hits/all"
SPEED_KEY = "speed/identification/all"

Json = dict[str, Any]


@dataclass(frozen=True)
class Unit:
    """A stretch of campaigns of one case.

    Attributes
    ----------
    part : Part
        It belongs to.
    key : str
        Of the case.
    first, count : int
        Campaigns, counted from 0.
    """

    part: Part
    key: str
    first: int
    count: int

    @property
    def name(self) -> str:
        """Unique in the study."""
        return f"{self.key}#{self.first}+{self.count}"


def plan_units(configuration: Configuration) -> tuple[Unit, ...]:
    """Return all units of a study, in the order of its parts."""
    units: list[Unit] = []
    for part in configuration.parts:
        total = configuration.count_campaigns(part)
        if part is Part.SPEED:
            units.append(Unit(part, SPEED_KEY, 0, total))
            continue
        keys = [case.key for case in list_cases(part)] or [SELECTION_KEY]
        units += [
            Unit(part, key, first, min(UNIT_CAMPAIGNS, total - first))
            for key in keys
            for first in range(0, total, UNIT_CAMPAIGNS)
        ]
    return tuple(units)


def run_unit(unit: Unit, seed: int) -> Json:
    """Do the work of one unit.

    Returns
    -------
    dict
        Plain values, all that is kept of the unit. The same unit and seed give the same values,
        times apart.
    """
    entropy = (seed, crc32(unit.key.encode()))
    numbers = range(unit.first, unit.first + unit.count)
    if unit.part is Part.SPEED:
        return measure_speed(unit.count)
    if unit.part is Part.SELECTION:
        counts = (simulate_series(PAPER_SETUP, entropy, number) for number in numbers)
        return sum(counts, SelectionCount()).to_json()
    source = CampaignSource(find_case(unit.key), PAPER_SETUP, entropy)
    outcomes: list[Outcome] = []
    lost = 0
    for number in numbers:
        try:
            campaign = source.run(number)
        except NotDeterminedError:
            lost += 1
            continue
        outcomes += evaluate(campaign)
    return {"lost": lost, "outcomes": _collect(outcomes)}


def _collect(outcomes: Iterable[Outcome]) -> dict[str, dict[str, list[float | None]]]:
    """Return columns of numbers by estimator and quantity; None is NaN."""
    columns: dict[str, dict[str, list[float | None]]] = {}
    for outcome in outcomes:
        column = columns.setdefault(
            f"{outcome.estimator}/{outcome.quantity}",
            {"errors": [], "half_widths": [], "bounds": []},
        )
        for name, value in (
            ("errors", outcome.error),
            ("half_widths", outcome.half_width),
            ("bounds", outcome.bound),
        ):
            column[name].append(value if math.isfinite(value) else None)
    return columns
