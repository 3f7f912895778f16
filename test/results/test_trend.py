"""The control sample from run to run."""

from dataclasses import replace
from pathlib import Path

import pytest

from impact_rig.core.checks import Checks
from impact_rig.core.paper_estimate import PaperEstimate
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.quantity import Quantity
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import CONTROL_SAMPLE, PAPER_SETUP, Sample
from impact_rig.results.batch import BatchCampaign
from impact_rig.results.campaign import Results
from impact_rig.results.trend import gather_trend, tabulate_trend

DAY = 86_400_000_000_000


def make_run(day: int, time: float, *, checked: float | None = None, accepted: int = 5):
    """Return a campaign of a day, its control sample's contact time [us] and its check [g]."""
    numbers = PaperEstimate(
        contact_time=Quantity(time * 1e-6, 1e-6, 2e-6), stiffness=Quantity(22.5e6, 1e5, 2e5)
    )
    samples, setup = [SampleEstimate(CONTROL_SAMPLE, accepted, 0, numbers)], PAPER_SETUP
    if checked is not None:
        mass = Sample("check mass", 0.15)
        setup = replace(setup, samples=setup.samples.with_check(mass))
        checks = Checks(traced_mass=Quantity(checked / 1e3), stated_mass=0.153)
        samples.insert(0, SampleEstimate(mass.name, 3, 0, checks=checks))
    results = Results(setup, HammerEstimate(), tuple(samples), ())
    return BatchCampaign(Path(f"runs/day{day}/session.mcap"), 1, results, began=day * DAY)


def test_runs_are_in_the_order_of_time_with_their_differences_and_checks():
    points, _ = gather_trend([make_run(3, 212.0, checked=154.53), make_run(1, 210.0)])
    assert [point.began for point in points] == ["1970-01-02 00:00", "1970-01-04 00:00"]
    (table,) = tabulate_trend(points)
    assert table.caption == f"Control sample from run to run: {CONTROL_SAMPLE}"
    cells = {column.header: list(column.cells) for column in table.columns}
    assert cells["Run"] == ["day1", "day3"]
    assert cells["Check [%]"][1] == "1.00"
    assert table.columns[4].cells == ["-0.47", "0.47"]
    assert "of 2 runs shows no trend, it takes 5" in table.notes[0]


@pytest.mark.parametrize(
    ("drift", "told"), [(0.0, "τp shows no trend"), (1.0, "τp changes by +2.3 % from the first")]
)
def test_a_control_sample_that_drifts_is_told_from_one_that_scatters(drift, told):
    scatter = (0.1, -0.2, 0.15, -0.1, 0.05, 0.0)
    runs = [make_run(day, 212.0 + drift * day + part) for day, part in enumerate(scatter)]
    (table,) = tabulate_trend(gather_trend(runs)[0])
    assert told in table.notes[0]


def test_a_run_without_a_hit_on_its_control_sample_is_left_out_and_named():
    none, missed = make_run(1, 210.0), make_run(2, 210.0, accepted=0)
    samples = replace(PAPER_SETUP.samples, control_sample="")
    setup = replace(PAPER_SETUP, samples=samples)
    none = replace(none, results=replace(none.results, setup=setup))
    points, left_out = gather_trend([none, missed, make_run(3, 210.0)])
    assert [point.run for point in points] == ["day3"]
    assert left_out == (
        "day1: it has no control sample",
        f"day2: no accepted hit on {CONTROL_SAMPLE}",
    )
