"""From the columns of the units to rows, JSON and CSV."""

import csv
import io
import json

import pytest

from impact_rig.study.cases import Configuration, Part, list_cases
from impact_rig.study.files import format_csv, list_selection, results_to_json
from impact_rig.study.results import summarize
from impact_rig.study.selection import SelectionCount
from impact_rig.study.units import plan_units

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
    assert (content["selection"], content["speed"]) == (None, None)


def test_an_empty_cell_is_what_is_not_determined():
    assert format_csv([{"a": None, "b": 1.5}]) == b"a,b\r\n,1.5\r\n"


def test_the_selection_has_a_row_for_each_fault_and_one_for_the_good_hits():
    rows = list_selection(SelectionCount(50, 1, {"overload": 4}, {"overload": 3}, {"weak": 1}))
    assert [(row["fault"], row["hits"], row["rejected"]) for row in rows] == [
        ("overload", 4, 3),
        ("none", 50, 1),
    ]
    assert rows[0]["rejected_percent"] == 75.0
    assert rows[0]["rejected_low_percent"] < 75.0 < rows[0]["rejected_high_percent"]
