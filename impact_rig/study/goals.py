"""What the estimators are held to, and how far the study found them to get."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.study.cases import FREE_DECAY, IDENTIFICATION, PAPER, Part
from impact_rig.study.estimators import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    STIFFNESS,
)
from impact_rig.study.results import Row, StudyResults
from impact_rig.study.statistics import Ratio, find_fraction

COVERAGE_RANGE = (0.93, 0.97)
"""Part of the 95 % intervals that cover the truth [-]."""
LARGEST_EFFICIENCY_RATIO = 1.15
"""Of the identification's root mean squared error over the Cramer-Rao bound [-]."""
LARGEST_FALSE_REJECTION = 1e-3
"""Good hits left out [-]."""
LONGEST_IDENTIFICATION = 60e-3
"""Median of one identification on one core [s]."""
LEAST_SPEED_RATIO = 50.0
"""How many times faster than the same fit around an integrator [-]."""

COVERAGE_GOALS: dict[str, dict[str, tuple[str, ...]]] = {
    "published": {
        PAPER: (CONTACT_TIME, STIFFNESS),
        FREE_DECAY: (DAMPING_RATIO, DAMPING_COEFFICIENT),
    },
    "dynamics": {
        FREE_DECAY: (DAMPING_RATIO, DAMPING_COEFFICIENT),
        IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT),
    },
}
"""Where coverage is asked for: by plant and estimator, for which quantities."""
EFFICIENCY_GOALS = (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT)
"""Quantities of the identification for which efficiency is asked."""
UNDETERMINED = "not determined"
SYMBOLS = {
    CONTACT_TIME: "τp",
    STIFFNESS: "k2",
    DAMPING_COEFFICIENT: "c2",
    DAMPING_RATIO: "ζ2",
}
ESTIMATOR_NAMES = {
    PAPER: "paper's method",
    FREE_DECAY: "free decay",
    IDENTIFICATION: "identification",
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
    found : float or None
        The figure, in the unit of the goal; None: not determined.
    low, high : float or None
        Its 95 % interval, where it has one.
    text : str
        The figure as it is printed.
    is_reached : bool
        Whether the figure itself is as asked; its interval is for the reader.
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
        *_judge_selection(results),
        *_judge_speed(results),
    )


def _judge_coverage(rows: Sequence[Row]) -> Iterator[JudgedGoal]:
    low, high = COVERAGE_RANGE
    for row in rows:
        if row.part is not Part.COVERAGE:
            continue
        if row.quantity not in COVERAGE_GOALS[row.value].get(row.estimator, ()):
            continue
        yield _judge_percentage(
            Part.COVERAGE,
            f"{SYMBOLS[row.quantity]} by {ESTIMATOR_NAMES[row.estimator]}, {row.value}",
            f"{100 * low:g} to {100 * high:g} %",
            row.coverage,
            is_reached=low <= row.coverage.value <= high,
        )


def _judge_efficiency(rows: Sequence[Row]) -> Iterator[JudgedGoal]:
    asked = [
        row
        for row in rows
        if row.part is Part.EFFICIENCY
        and row.estimator == IDENTIFICATION
        and row.quantity in EFFICIENCY_GOALS
    ]
    for quantity in dict.fromkeys(row.quantity for row in asked):
        # Nothing is worse than what could not be determined.
        worst = max(
            (row for row in asked if row.quantity == quantity),
            key=lambda row: np.nan_to_num(row.efficiency.value, nan=math.inf),
        )
        found = worst.efficiency
        subject = f"{SYMBOLS[quantity]} by identification, worst at {worst.value} noise"
        goal = f"at most {LARGEST_EFFICIENCY_RATIO:g} bounds"
        part = Part.EFFICIENCY.value
        if not math.isfinite(found.value):
            yield JudgedGoal(part, subject, goal, None, None, None, UNDETERMINED, is_reached=False)
            continue
        yield JudgedGoal(
            part=part,
            subject=subject,
            goal=goal,
            found=found.value,
            low=found.low,
            high=found.high,
            text=f"{found.value:.3f} ({found.low:.3f} to {found.high:.3f})",
            is_reached=found.value <= LARGEST_EFFICIENCY_RATIO
            and all(row.determined == row.campaigns for row in asked),
        )


def _judge_selection(results: StudyResults) -> Iterator[JudgedGoal]:
    count = results.selection
    if count is None:
        return
    for fault, total in count.faulty.items():
        detected = count.detected.get(fault, 0)
        yield _judge_percentage(
            Part.SELECTION,
            f"{fault.replace('_', ' ')}: {detected} of {total} rejected for the right reason",
            "all",
            find_fraction(detected, total),
            is_reached=detected == total,
        )
    rejected = find_fraction(count.good_rejected, count.good)
    yield _judge_percentage(
        Part.SELECTION,
        f"good hits: {count.good_rejected} of {count.good} rejected",
        f"below {100 * LARGEST_FALSE_REJECTION:g} %",
        rejected,
        is_reached=rejected.value < LARGEST_FALSE_REJECTION,
    )


def _judge_percentage(
    part: Part, subject: str, goal: str, found: Ratio, *, is_reached: bool
) -> JudgedGoal:
    if not math.isfinite(found.value):
        return JudgedGoal(
            part.value, subject, goal, None, None, None, UNDETERMINED, is_reached=False
        )
    value, low, high = (100.0 * figure for figure in (found.value, found.low, found.high))
    return JudgedGoal(
        part=part.value,
        subject=subject,
        goal=goal,
        found=value,
        low=low,
        high=high,
        text=f"{value:.3g} % ({low:.3g} to {high:.3g})",
        is_reached=is_reached,
    )


def _judge_speed(results: StudyResults) -> Iterator[JudgedGoal]:
    speed = results.speed
    if speed is None:
        return
    yield JudgedGoal(
        part=Part.SPEED.value,
        subject=f"one identification of two traces of {speed.points} points",
        goal=f"below {LONGEST_IDENTIFICATION * 1e3:g} ms",
        found=speed.identification_s * 1e3,
        low=None,
        high=None,
        text=f"{speed.identification_s * 1e3:.1f} ms",
        is_reached=speed.identification_s < LONGEST_IDENTIFICATION,
    )
    yield JudgedGoal(
        part=Part.SPEED.value,
        subject="times faster than the same fit around solve_ivp",
        goal=f"above {LEAST_SPEED_RATIO:g}",
        found=speed.ratio,
        low=None,
        high=None,
        text=f"{speed.ratio:.0f}",
        is_reached=speed.ratio > LEAST_SPEED_RATIO,
    )
