"""Goals are judged by the figure that was found."""

import math

from impact_rig.study.cases import Configuration, Part
from impact_rig.study.goals import judge_goals
from impact_rig.study.results import Row, StudyResults
from impact_rig.study.selection import SelectionCount
from impact_rig.study.speed import Speed
from impact_rig.study.statistics import Bias, Ratio

UNKNOWN = Ratio(math.nan, math.nan, math.nan)


def make_row(part, value, estimator, quantity, *, coverage=math.nan, efficiency=math.nan, lost=0):
    return Row(
        part=part,
        axis="axis",
        value=value,
        position=0.0,
        estimator=estimator,
        quantity=quantity,
        campaigns=100,
        determined=100 - lost,
        bias=Bias(0.0, 0.0, 0.0),
        coverage=Ratio(coverage, coverage - 0.01, coverage + 0.01),
        efficiency=Ratio(efficiency, efficiency - 0.1, efficiency + 0.1),
    )


def judge(**values):
    return judge_goals(StudyResults(Configuration(), **values))


def test_coverage_is_asked_for_between_93_and_97_percent():
    goals = judge(
        rows=tuple(
            make_row(Part.COVERAGE, "published", "paper", "contact_time", coverage=value)
            for value in (0.929, 0.93, 0.97, 0.971)
        )
    )
    assert [goal.is_reached for goal in goals] == [False, True, True, False]
    assert goals[0].text == "92.9 % (91.9 to 93.9)"


def test_what_is_known_to_be_biased_has_no_goal():
    row = make_row(Part.COVERAGE, "dynamics", "paper", "damping_ratio", coverage=0.0)
    assert judge(rows=(row,)) == ()


def test_an_interval_that_is_never_there_covers_nothing():
    row = make_row(Part.COVERAGE, "dynamics", "identification", "stiffness")
    (goal,) = judge(rows=(row,))
    assert not goal.is_reached
    assert (goal.found, goal.text) == (None, "not determined")


def test_the_worst_noise_level_counts_for_the_efficiency():
    rows = [
        make_row(Part.EFFICIENCY, value, "identification", "stiffness", efficiency=ratio)
        for value, ratio in (("0.1 %", 1.05), ("1 %", 1.2), ("0.3 %", 1.1))
    ]
    (goal,) = judge(rows=tuple(rows))
    assert not goal.is_reached
    assert "1 %" in goal.subject
    (goal,) = judge(rows=(rows[0], rows[2]))
    assert goal.is_reached


def test_an_estimator_that_gives_up_is_not_efficient():
    row = make_row(Part.EFFICIENCY, "1 %", "identification", "stiffness", efficiency=1.0, lost=1)
    (goal,) = judge(rows=(row,))
    assert not goal.is_reached


def test_every_fault_must_be_found_and_few_good_hits_lost():
    count = SelectionCount(2000, 2, {"overload": 9, "weak_hit": 9}, {"overload": 9}, {})
    overload, weak, good = judge(selection=count)
    assert (overload.is_reached, weak.is_reached, good.is_reached) == (True, False, False)
    assert "0 of 9" in weak.subject
    (good,) = judge(selection=SelectionCount(2001, 2))
    assert good.is_reached


def test_speed_is_judged_by_time_and_ratio():
    goals = judge(speed=Speed(0.02, 0.9, 45.0, 5000, 20, 3, 1e-6))
    assert [goal.is_reached for goal in goals] == [True, False]
    assert [goal.text for goal in goals] == ["20.0 ms", "45"]
