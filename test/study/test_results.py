"""Bias, coverage and efficiency against known distributions and published intervals."""

import csv
import io
import json
import math

import numpy as np
import pytest
from scipy.stats import t as student

from impact_rig.study.cases import Configuration, Part, list_cases
from impact_rig.study.files import format_csv, list_selection, results_to_json
from impact_rig.study.results import (
    Bias,
    Ratio,
    Row,
    StudyResults,
    compute_fraction,
    estimate_bias,
    estimate_coverage,
    estimate_efficiency,
    judge_goals,
    summarize,
)
from impact_rig.study.run import plan_units
from impact_rig.study.selection import STEP, SelectionCount


def test_the_interval_is_that_of_the_textbook():
    # Newcombe 1998, table I, method 5: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
    for successes, count, low, high in (
        (81, 263, 0.2527, 0.3676),
        (15, 148, 0.0578, 0.1617),
        (0, 20, 0.0, 0.1684),
        (1, 29, 0.0009, 0.1776),
    ):
        found = compute_fraction(successes, count)
        assert found.value == successes / count
        assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize("errors", [[], [0.5]])
def test_too_few_errors_have_no_spread(errors):
    found = estimate_bias(np.array(errors))
    assert math.isnan(found.spread)
    assert math.isnan(found.standard_error)
    assert math.isnan(found.bias) is (not errors)


def test_coverage_of_students_intervals_is_what_they_claim():
    hits = np.random.default_rng(2).normal(size=(20_000, 10))
    half_widths = student.ppf(0.975, 9) * hits.std(axis=1, ddof=1) / math.sqrt(10)
    found = estimate_coverage(hits.mean(axis=1), half_widths)
    assert found.low < 0.95 < found.high
    # Without Student's t they would claim too much.
    assert estimate_coverage(hits.mean(axis=1), half_widths * 1.96 / 2.262).high < 0.93


def test_efficiency_is_the_rms_error_over_the_bound():
    generator = np.random.default_rng(3)
    bounds = generator.uniform(0.1, 10.0, 20_000)
    found = estimate_efficiency(1.2 * bounds * generator.standard_normal(20_000), bounds)
    assert found.low < 1.2 < found.high
    assert found.high / found.low < 1.03


def test_the_interval_of_an_efficiency_covers_in_95_percent():
    errors = np.random.default_rng(4).standard_normal((2000, 12))
    found = [estimate_efficiency(row, np.ones(12)) for row in errors]
    covered = sum(item.low <= 1.0 <= item.high for item in found)
    # Binomial: 1900 +- 10 standard; four of them.
    assert abs(covered - 1900) < 40


COVERAGE = Configuration((Part.COVERAGE,), campaigns=21)


def make_found(errors, half_widths, bounds, lost=0):
    columns = {"errors": errors, "half_widths": half_widths, "bounds": bounds}
    return {"lost": lost, "outcomes": {"paper/contact_time": columns}}


@pytest.fixture
def results():
    """Two units of `published`: three results, one undetermined, one campaign lost; else none."""
    first = make_found([0.01, -0.01], [0.02, 0.005], [0.01, 0.01])
    second = make_found([None, 0.03], [None, None], [0.01, None], lost=1)
    units = plan_units(COVERAGE)
    empty = {"lost": 0, "outcomes": {}}
    found = dict.fromkeys((unit.name for unit in units), empty)
    key = list_cases(Part.COVERAGE)[0].key
    names = [unit.name for unit in units if unit.key == key]
    return summarize(COVERAGE, {**found, names[0]: first, names[1]: second})


def test_units_are_joined_and_the_undetermined_counted(results):
    (row,) = results.rows
    assert (row.value, row.estimator, row.quantity) == ("published", "paper", "contact_time")
    assert (row.campaigns, row.determined) == (21, 3)
    assert results.lost_campaigns == 1
    assert row.bias.bias == pytest.approx(0.01)
    # Two have an interval, one of them covers; two have a bound and are as large as it.
    assert row.coverage.value == 0.5
    assert row.efficiency.value == pytest.approx(1.0)


def test_json_and_csv_have_no_nan(results):
    content = results_to_json(results)
    text = json.dumps(content, allow_nan=False)
    assert json.loads(text) == content
    (row,) = csv.DictReader(io.StringIO(format_csv(content["rows"]).decode(), newline=""))
    assert float(row["bias_percent"]) == content["rows"][0]["bias_percent"]
    assert content["selection"] is None
    assert format_csv([{"a": None, "b": 1.5}]) == b"a,b\r\n,1.5\r\n"


def test_the_selection_has_a_row_for_each_fault_and_one_for_the_good_hits():
    rows = list_selection(SelectionCount(50, 1, {"overload": 4}, {"overload": 3}, {"weak": 1}))
    assert [(row["fault"], row["hits"], row["found"]) for row in rows] == [
        ("overload", 4, 3),
        ("nothing", 50, 1),
    ]
    assert rows[0]["found_percent"] == 75.0
    assert rows[0]["found_low_percent"] < 75.0 < rows[0]["found_high_percent"]


def make_row(part, value, estimator, quantity, *, coverage=math.nan, efficiency=math.nan, lost=0):
    return Row(
        part=part,
        axis="axis",
        value=value,
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
            for value in (0.939, 0.941, 0.959, 0.961)
        )
    )
    # The whole interval of two per cent has to lie inside.
    assert [goal.is_reached for goal in goals] == [False, True, True, False]
    assert goals[0].text == "93.9 % (92.9 to 94.9)"


def test_the_worst_noise_level_counts_for_the_efficiency():
    rows = [
        make_row(Part.EFFICIENCY, value, "identification", "stiffness", efficiency=ratio)
        for value, ratio in (("0.1 %", 1.0), ("1 %", 1.2), ("0.3 %", 1.02))
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


def test_faults_must_be_found_from_a_size_on_and_few_good_hits_lost():
    large, small = STEP.name(2.0), STEP.name(0.3)
    for detected, is_reached in ((1000, True), (996, False)):
        count = SelectionCount(8000, 20, {large: 1000, small: 1000}, {large: detected, small: 9})
        fault, good = judge(selection=count)
        assert (fault.is_reached, good.is_reached) == (is_reached, False)
        assert f"{large}: {detected} of 1000 found" in fault.subject
    (good,) = judge(selection=SelectionCount(8000, 2))
    assert good.is_reached
