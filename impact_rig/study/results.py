"""What a study found: one row per case, estimator and quantity; counts of hits; times."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.study.cases import Case, Configuration, Part, list_cases
from impact_rig.study.selection import SelectionCount
from impact_rig.study.speed import Speed
from impact_rig.study.statistics import (
    Bias,
    Ratio,
    estimate_bias,
    estimate_coverage,
    estimate_efficiency,
)
from impact_rig.study.units import Unit, plan_units

Json = dict[str, Any]


@dataclass(frozen=True)
class Row:
    """One quantity of one estimator under one condition; NaN: not determined, not defined.

    Attributes
    ----------
    part : Part
        It belongs to.
    axis, value : str
        What was varied, and its value here.
    position : float
        Of the value on the figure's axis.
    estimator, quantity : str
        Names.
    campaigns : int
        Simulated ones.
    determined : int
        Those in which the estimator had a result.
    bias : Bias
        Of the results relative to the truth [-].
    coverage : Ratio
        Of the 95 % intervals [-].
    efficiency : Ratio
        Root of the mean squared error over the Cramer-Rao bound [-].
    """

    part: Part
    axis: str
    value: str
    position: float
    estimator: str
    quantity: str
    campaigns: int
    determined: int
    bias: Bias
    coverage: Ratio
    efficiency: Ratio

    def to_json(self) -> Json:
        """Return one flat dict; percentages of the truth, None where there is no number."""
        return {
            "part": self.part.value,
            "axis": self.axis,
            "value": self.value,
            "position": self.position,
            "estimator": self.estimator,
            "quantity": self.quantity,
            "campaigns": self.campaigns,
            "determined": self.determined,
            "bias_percent": _scale(self.bias.bias),
            "bias_standard_error_percent": _scale(self.bias.standard_error),
            "spread_percent": _scale(self.bias.spread),
            "coverage_percent": _scale(self.coverage.value),
            "coverage_low_percent": _scale(self.coverage.low),
            "coverage_high_percent": _scale(self.coverage.high),
            "efficiency": _scale(self.efficiency.value, 1.0),
            "efficiency_low": _scale(self.efficiency.low, 1.0),
            "efficiency_high": _scale(self.efficiency.high, 1.0),
        }


def _scale(value: float, factor: float = 100.0) -> float | None:
    return factor * value if math.isfinite(value) else None


@dataclass(frozen=True)
class StudyResults:
    """Everything that a study found.

    Attributes
    ----------
    configuration : Configuration
        What was asked.
    lost_campaigns : int
        Those in which a good hit was rejected again and again.
    rows : tuple of Row
        Of the parts that simulate campaigns.
    selection : SelectionCount or None
        None: the part was not asked.
    speed : Speed or None
        None: the part was not asked.
    """

    configuration: Configuration
    lost_campaigns: int = 0
    rows: tuple[Row, ...] = ()
    selection: SelectionCount | None = None
    speed: Speed | None = None


def summarize(configuration: Configuration, finished: Mapping[str, Json]) -> StudyResults:
    """Make the results of a study from what its units found.

    Parameters
    ----------
    configuration : Configuration
        What was asked.
    finished : mapping of str to dict
        What `run_unit` returned, by the unit's name; all units of the study.
    """
    units = plan_units(configuration)
    rows: list[Row] = []
    lost = 0
    for part in configuration.parts:
        for case in list_cases(part):
            found = [finished[unit.name] for unit in units if unit.key == case.key]
            lost += sum(item["lost"] for item in found)
            rows += _summarize_case(case, found, configuration.count_campaigns(part))
    selection = _find_all(Part.SELECTION, units, finished)
    speed = _find_all(Part.SPEED, units, finished)
    return StudyResults(
        configuration=configuration,
        lost_campaigns=lost,
        rows=tuple(rows),
        selection=sum((SelectionCount(**item) for item in selection), SelectionCount())
        if selection
        else None,
        speed=Speed(**speed[0]) if speed else None,
    )


def _find_all(part: Part, units: Iterable[Unit], finished: Mapping[str, Json]) -> list[Json]:
    return [finished[unit.name] for unit in units if unit.part is part]


def _summarize_case(case: Case, found: list[Json], campaigns: int) -> list[Row]:
    names = list(dict.fromkeys(name for item in found for name in item["outcomes"]))
    rows = []
    for name in names:
        estimator, _, quantity = name.partition("/")
        errors, half_widths, bounds = (
            _join(item["outcomes"][name][column] for item in found if name in item["outcomes"])
            for column in ("errors", "half_widths", "bounds")
        )
        known = np.isfinite(errors)
        rows.append(
            Row(
                part=case.part,
                axis=case.axis,
                value=case.value,
                position=case.position,
                estimator=estimator,
                quantity=quantity,
                campaigns=campaigns,
                determined=int(np.count_nonzero(known)),
                bias=estimate_bias(errors[known]),
                coverage=estimate_coverage(errors[known], half_widths[known]),
                efficiency=estimate_efficiency(errors[known], bounds[known]),
            )
        )
    return rows


def _join(columns: Iterable[list[float | None]]) -> FloatArray:
    return np.array([value for column in columns for value in column], dtype=np.float64)
