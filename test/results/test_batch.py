"""Many recordings in one table."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.ringing import BY_FREE_DECAY, reach
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.quantity import BudgetLine, Quantity
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.results.batch import BatchCampaign, shorten_paths, tabulate_batch, tabulate_changes
from impact_rig.results.campaign import Results

TIMES = (144.61e-6, 144.93e-6, 145.22e-6)


def make_campaign(
    name: str,
    contact_time: float,
    number: int = 1,
    *,
    expanded: float = 0.3e-6,
    stiffness: float = 15.6e6,
) -> BatchCampaign:
    sample = SampleEstimate(
        "aluminium small",
        10,
        2,
        paper=PaperEstimate(
            contact_time=Quantity(contact_time, expanded=expanded),
            stiffness=Quantity(stiffness, expanded=0.4e6),
        ),
    )
    return BatchCampaign(Path(name), number, Results(PAPER_SETUP, HammerEstimate(), (sample,), ()))


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["runs/a/session.mcap", "runs/b/session.mcap"], ["a", "b"]),
        (["runs/a/session.mcap", "old/b.mcap"], ["runs/a/session.mcap", "old/b.mcap"]),
        (["x/a.mcap", "x/b.mcap"], ["a.mcap", "b.mcap"]),
        (["x/a.mcap", "x/a.mcap"], ["a.mcap", "a.mcap"]),
        (["/one/session.mcap", "/two/session.mcap"], ["one", "two"]),
    ],
)
def test_recordings_have_the_shortest_names_that_tell_them_apart(paths, names):
    assert shorten_paths(list(map(Path, paths))) == names


def test_each_row_has_recording_sample_hits_and_values_with_uncertainty():
    (table,) = tabulate_batch(
        [make_campaign("a.mcap", TIMES[0]), make_campaign("b.mcap", TIMES[1])]
    )
    first = ("a.mcap", "aluminium small", "10 of 12", "144.61 ± 0.30", "15.60 ± 0.40")
    assert table.rows[0] == first
    assert table.marked == {0, 1}


def test_of_two_runs_each_quantity_stands_with_its_difference_and_whether_it_changed():
    # By hand: 0.3, 0.4 and 0.5 are Pythagorean.
    first = make_campaign("a.mcap", 144.61e-6, expanded=0.3e-6)
    second = make_campaign("b.mcap", 145.21e-6, expanded=0.4e-6)
    (table,) = tabulate_changes(first, second)
    assert table.caption == "Changes from a.mcap to b.mcap"
    time, stiffness = table.rows
    values = ("144.61 ± 0.30", "145.21 ± 0.40", "0.60 ± 0.50", "1.20")
    assert time == ("aluminium small", "τp [µs]", *values)
    assert stiffness[-2:] == ("0.00 ± 0.57", "0.00")
    assert table.marked == {0}
    assert table.notes[0] == "1 of 2 values changed beyond their uncertainty."
    (back,) = tabulate_changes(second, first)
    assert (back.rows[0][-1], back.marked) == ("-1.20", {0})
    # How three hits scatter is hardly known, so nothing says that it changed.
    (sample,) = second.results.samples
    of_one = replace(second.results, samples=(replace(sample, impacts_accepted=3),))
    (table,) = tabulate_changes(first, replace(second, results=of_one))
    assert "En" not in [column.header for column in table.columns]
    assert table.marked == frozenset()


@pytest.mark.parametrize(("change", "marks"), [(0.9, 0), (1.1, 1)])
def test_what_one_method_gets_wrong_in_both_runs_hides_no_change(change, marks):
    def make(name: str, damping: float) -> BatchCampaign:
        line = BudgetLine("scatter", "A", 2.0, 1.0)
        found = Quantity(damping, 2.0, 4.524, degrees_of_freedom=9.0, budget=(line,))
        other = Quantity(560.0, 0.5, 1.0)
        paper = PaperEstimate(damping_coefficient=reach(found, other, BY_FREE_DECAY))
        sample = SampleEstimate("aluminium small", 10, 0, paper=paper)
        return BatchCampaign(Path(name), 1, Results(PAPER_SETUP, HammerEstimate(), (sample,), ()))

    # Both reach 560 N s/m, and scatter by U = 4.524, of ten hits.
    second = 480.0 + change * math.hypot(4.524, 4.524)
    (table,) = tabulate_changes(make("a", 480.0), make("b", second))
    assert len(table.marked) == marks


def test_the_hammer_is_compared_and_what_only_one_run_determined_is_not(results):
    (table,) = tabulate_changes(*[BatchCampaign(Path("a"), 1, results)] * 2)
    assert len(table.rows) == 12 * 3 + 2
    assert [row[0] for row in table.rows[-2:]] == ["hammer"] * 2
    lost = make_campaign("b", math.nan, stiffness=math.nan)
    other = BatchCampaign(Path("b"), 1, Results(PAPER_SETUP, HammerEstimate(), (), ()))
    for second in (lost, other):
        assert tabulate_changes(make_campaign("a", TIMES[0]), second) == []


def test_the_spread_of_three_recordings_is_the_standard_deviation():
    _, table = tabulate_batch([make_campaign(f"{time}.mcap", time) for time in TIMES])
    (row,) = table.rows
    mean, spread = np.mean(TIMES) * 1e6, 100 * np.std(TIMES, ddof=1) / np.mean(TIMES)
    assert row == ("aluminium small", "3", f"{mean:.2f}", f"{spread:.2f}", "15.60", "0.00")
