"""What a study found: bias, spread, coverage and efficiency, held against goals."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest, chi2

from impact_rig.core.signals.record import FloatArray
from impact_rig.study.campaigns import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    EXPONENT,
    RESTITUTION,
    STIFFNESS,
)
from impact_rig.study.cases import (
    CONTACT_LAW,
    FREE_DECAY,
    IDENTIFICATION,
    PAPER,
    Case,
    Configuration,
    Part,
    list_cases,
)
from impact_rig.study.run import plan_units
from impact_rig.study.selection import ASKED, SelectionCount

CONFIDENCE = 0.95
"""Of every interval that the study gives for its own figures [-]."""


@dataclass(frozen=True)
class Bias:
    """Where estimates lie about the truth; NaN: too few of them.

    Attributes
    ----------
    bias : float
        Mean error [unit of the errors].
    standard_error : float
        Of that mean [unit of the errors].
    spread : float
        Standard deviation of the errors [unit of the errors].
    """

    bias: float
    standard_error: float
    spread: float


@dataclass(frozen=True)
class Ratio:
    """A figure with its own 95 % interval; NaN: not determined.

    Attributes
    ----------
    value, low, high : float
        [-]
    """

    value: float
    low: float
    high: float


UNDETERMINED_RATIO = Ratio(math.nan, math.nan, math.nan)


def estimate_bias(errors: FloatArray) -> Bias:
    """Estimate bias and spread from errors, shape (n,); NaN where n is too small."""
    count = errors.size
    bias = float(errors.mean()) if count else math.nan
    spread = float(errors.std(ddof=1)) if count > 1 else math.nan
    return Bias(bias, spread / math.sqrt(count) if count > 1 else math.nan, spread)


def estimate_coverage(errors: FloatArray, half_widths: FloatArray) -> Ratio:
    """Estimate how often an interval covers the truth, with the interval of that figure.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Estimate less truth.
    half_widths : ndarray, shape (n,)
        Expanded uncertainties in the unit of the errors; NaN: there is none, and the estimate
        does not count.
    """
    stated = np.isfinite(half_widths)
    covered = np.abs(errors[stated]) <= half_widths[stated]
    return compute_fraction(int(np.count_nonzero(covered)), covered.size)


def compute_fraction(successes: int, count: int) -> Ratio:
    """Return the fraction of successes with Clopper and Pearson's 95 % interval; NaN: of none."""
    if count == 0:
        return UNDETERMINED_RATIO
    interval = binomtest(successes, count).proportion_ci(CONFIDENCE, method="exact")
    return Ratio(successes / count, float(interval.low), float(interval.high))


def estimate_efficiency(errors: FloatArray, bounds: FloatArray) -> Ratio:
    """Estimate the root of the mean squared error over the Cramer-Rao bound.

    Parameters
    ----------
    errors : ndarray, shape (n,)
        Estimate less truth; their conditions, and so their bounds, may differ.
    bounds : ndarray, shape (n,)
        Least standard deviation of an unbiased estimator, in the unit of the errors; NaN where
        it is not defined: these do not count.

    Returns
    -------
    Ratio
        1: no unbiased estimator does better. The interval takes the errors over their bounds as
        normal with zero mean, so that their sum of squares is chi-square of n degrees of freedom.
    """
    defined = np.isfinite(bounds)
    count = int(np.count_nonzero(defined))
    if count == 0:
        return UNDETERMINED_RATIO
    ratio = math.sqrt(float(np.mean(np.square(errors[defined] / bounds[defined]))))
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = (math.sqrt(count / chi2.ppf(part, count)) for part in (1.0 - tail, tail))
    return Ratio(ratio, ratio * low, ratio * high)


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
    """

    configuration: Configuration
    lost_campaigns: int = 0
    rows: tuple[Row, ...] = ()
    selection: SelectionCount | None = None


def summarize(configuration: Configuration, finished: Mapping[str, Json]) -> StudyResults:
    """Make the results of a study from what its units found.

    Parameters
    ----------
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
    selection = [finished[unit.name] for unit in units if unit.part is Part.SELECTION]
    return StudyResults(
        configuration=configuration,
        lost_campaigns=lost,
        rows=tuple(rows),
        selection=sum((SelectionCount(**item) for item in selection), SelectionCount())
        if selection
        else None,
    )


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


COVERAGE_RANGE = (0.93, 0.97)
"""Part of the 95 % intervals that cover the truth [-]."""
LARGEST_EFFICIENCY_RATIO = 1.15
"""Of the identification's root mean squared error over the Cramer-Rao bound [-]."""
LEAST_DETECTION = 0.99
"""Faults of the sizes that are asked for which are found and rightly named [-]."""
LARGEST_FALSE_REJECTION = 2e-3
"""Good hits left out [-]."""

COVERAGE_GOALS: dict[str, dict[str, tuple[str, ...]]] = {
    "published": {
        PAPER: (CONTACT_TIME, STIFFNESS),
        FREE_DECAY: (DAMPING_RATIO, DAMPING_COEFFICIENT),
    },
    "dynamics": {
        # Its largest peak lies inside the contact: it cannot reach them, and that is said.
        PAPER: (DAMPING_RATIO, DAMPING_COEFFICIENT),
        FREE_DECAY: (DAMPING_RATIO, DAMPING_COEFFICIENT),
        IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT),
    },
    "contact": {CONTACT_LAW: (CONTACT_TIME, EXPONENT, RESTITUTION)},
}
"""Where coverage is asked for: by plant and estimator, for which quantities."""
EFFICIENCY_GOALS = {
    IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT),
    CONTACT_LAW: (CONTACT_TIME, EXPONENT, RESTITUTION),
}
"""Where efficiency is asked for: by estimator, for which quantities."""
UNDETERMINED = "not determined"
SYMBOLS = {
    CONTACT_TIME: "τp",
    STIFFNESS: "k2",
    DAMPING_COEFFICIENT: "c2",
    DAMPING_RATIO: "ζ2",
    EXPONENT: "n",
    RESTITUTION: "e",
}
ESTIMATOR_NAMES = {
    PAPER: "paper's method",
    FREE_DECAY: "free decay",
    IDENTIFICATION: "identification",
    CONTACT_LAW: "contact law",
}


@dataclass(frozen=True)
class JudgedGoal:
    """One goal.

    Attributes
    ----------
    part : str
        Of the study.
    subject : str
        What it is about.
    goal : str
        What is asked, in words.
    found, low, high : float or None
        The figure and its 95 % interval, in the unit of the goal; None: not determined.
    text : str
        The same as it is printed.
    is_reached : bool
        Whether the whole interval is as asked.
    """

    part: str
    subject: str
    goal: str
    found: float | None
    low: float | None
    high: float | None
    text: str
    is_reached: bool


def judge_goals(results: StudyResults) -> tuple[JudgedGoal, ...]:
    """Hold the results against every goal of the parts that were asked."""
    return (
        *_judge_coverage(results.rows),
        *_judge_efficiency(results.rows),
        *_judge_selection(results.selection),
    )


def _judge_coverage(rows: Sequence[Row]) -> Iterator[JudgedGoal]:
    low, high = COVERAGE_RANGE
    for row in rows:
        if row.part is not Part.COVERAGE:
            continue
        if row.quantity not in COVERAGE_GOALS[row.value].get(row.estimator, ()):
            continue
        yield _judge(
            Part.COVERAGE,
            f"{SYMBOLS[row.quantity]} by {ESTIMATOR_NAMES[row.estimator]}, {row.value}",
            f"{100 * low:g} to {100 * high:g} %",
            row.coverage,
            is_reached=low <= row.coverage.low and row.coverage.high <= high,
        )


def _judge_efficiency(rows: Sequence[Row]) -> Iterator[JudgedGoal]:
    asked = [
        row
        for row in rows
        if row.part is Part.EFFICIENCY and row.quantity in EFFICIENCY_GOALS.get(row.estimator, ())
    ]
    for estimator, quantity in dict.fromkeys((row.estimator, row.quantity) for row in asked):
        mine = [row for row in asked if row.estimator == estimator]
        # Nothing is worse than what could not be determined.
        worst = max(
            (row for row in mine if row.quantity == quantity),
            key=lambda row: np.nan_to_num(row.efficiency.value, nan=math.inf),
        )
        yield _judge(
            Part.EFFICIENCY,
            f"{SYMBOLS[quantity]} by {ESTIMATOR_NAMES[estimator]}, worst at {worst.value} noise",
            f"at most {LARGEST_EFFICIENCY_RATIO:g} bounds",
            worst.efficiency,
            is_reached=worst.efficiency.high <= LARGEST_EFFICIENCY_RATIO
            and all(row.determined == row.campaigns for row in mine),
        )


def _judge_selection(count: SelectionCount | None) -> Iterator[JudgedGoal]:
    if count is None:
        return
    for fault, total in count.faulty.items():
        if fault in ASKED:
            found = compute_fraction(count.detected[fault], total)
            yield _judge(
                Part.SELECTION,
                f"{fault}: {count.detected[fault]} of {total} found and rightly named",
                f"at least {100 * LEAST_DETECTION:g} %",
                found,
                is_reached=found.low >= LEAST_DETECTION,
            )
    rejected = compute_fraction(count.good_rejected, count.good)
    yield _judge(
        Part.SELECTION,
        f"good hits: {count.good_rejected} of {count.good} rejected",
        f"below {100 * LARGEST_FALSE_REJECTION:g} %",
        rejected,
        is_reached=rejected.high < LARGEST_FALSE_REJECTION,
    )


def _judge(part: Part, subject: str, goal: str, found: Ratio, *, is_reached: bool) -> JudgedGoal:
    """Return a goal that was asked in per cent, or in bounds of the efficiency."""
    if not math.isfinite(found.value):
        return JudgedGoal(
            part.value, subject, goal, None, None, None, UNDETERMINED, is_reached=False
        )
    if part is Part.EFFICIENCY:
        value, low, high = found.value, found.low, found.high
        text = f"{value:.3f} ({low:.3f} to {high:.3f})"
    else:
        value, low, high = (100.0 * figure for figure in (found.value, found.low, found.high))
        text = f"{value:.3g} % ({low:.3g} to {high:.3g})"
    return JudgedGoal(part.value, subject, goal, value, low, high, text, is_reached)
