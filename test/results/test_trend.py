"""The control sample from run to run."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import stdtrit

from impact_rig.core.estimates.checks import Checks
from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP, Sample
from impact_rig.results.batch import BatchCampaign
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import CONTACT_TIME
from impact_rig.results.trend import TrendPoint, follow, gather_trend, tabulate_trend

DAY = 86_400_000_000_000


def make_run(
    day: int,
    time: float,
    *,
    checked: float | None = None,
    accepted: int = 5,
    gain: float = 1.0,
    expanded: float = 2.0,
):
    """Return a campaign of a day, its control sample's contact time and U [us] and check [g]."""
    standard = expanded / 1.96
    numbers = PaperEstimate(
        contact_time=Quantity(time * 1e-6, standard * 1e-6, expanded * 1e-6),
        stiffness=Quantity(22.5e6, 1e5, 2e5),
    )
    samples, setup = [SampleEstimate(CONTROL_SAMPLE, accepted, 0, numbers)], PAPER_SETUP
    if checked is not None:
        mass = Sample("check mass", 0.15)
        setup = replace(setup, samples=setup.samples.with_check(mass))
        checks = Checks(traced_mass=Quantity(checked / 1e3, 4e-4, 8e-4), stated_mass=0.153)
        samples.insert(0, SampleEstimate(mass.name, 3, 0, checks=checks))
    hits = tuple(
        HitResults(
            CONTROL_SAMPLE, number, 1, number, True, hammer_peak=1e3, specimen_peak=9e2 * gain
        )
        for number in range(1, accepted + 1)
    )
    results = Results(setup, HammerEstimate(), tuple(samples), hits)
    return BatchCampaign(Path(f"runs/day{day}/session.mcap"), 1, results, began=day * DAY)


def tell(runs):
    """Return what is told of each quantity, and the marked runs."""
    (table,) = tabulate_trend(gather_trend(runs)[0])
    return table.notes[:3], [table.rows[place][0] for place in sorted(table.marked)]


def test_runs_are_in_the_order_of_time_with_their_differences_and_checks():
    points, _ = gather_trend([make_run(3, 212.0, checked=154.53), make_run(1, 210.0)])
    assert [point.began for point in points] == ["1970-01-02 00:00", "1970-01-04 00:00"]
    (table,) = tabulate_trend(points)
    assert table.caption == f"Control sample from run to run: {CONTROL_SAMPLE}"
    cells = {column.header: list(column.cells) for column in reversed(table.columns)}
    assert cells["Run"] == ["day1", "day3"]
    assert cells["Check [%]"] == ["-", "1.00 ± 0.52"]
    assert cells["By ISO 7626-1"] == ["", "passed"]
    # 2 us apart, each known to 2 us
    assert cells["En"] == ["-0.71", "0.71"]


def test_the_run_after_which_the_control_sample_changed_is_told():
    times = (212.2, 212.0, 212.1, 212.15)
    runs = [make_run(day, time, expanded=0.61) for day, time in enumerate(times)]
    (time, *_), marked = tell([*runs, make_run(4, 214.69, expanded=0.61)])
    assert "τp of day4 lies +1.2 % off the mean of the other runs" in time
    assert marked == ["day4"]
    (time, *_), marked = tell([*runs, make_run(4, 212.3, expanded=0.61)])
    assert "τp shows no change: one of 0.6 % in the last run would be told" in time
    assert not marked


@pytest.mark.parametrize(("step", "drawn"), [(0.0, 2000), (3.0, 500)])
def test_a_step_of_three_times_u_is_told_and_chance_is_not(step, drawn):
    # Five hits a run, whose scatter is all that there is: each U is itself an estimate.
    chance = np.random.default_rng(56)
    factor, told = float(stdtrit(4, 0.975)), 0
    for _ in range(drawn):
        hits = chance.normal(212.0, math.sqrt(5.0), (5, 5))
        hits[-1] += step * factor
        points = []
        for run, found in enumerate(hits):
            standard = found.std(ddof=1) / math.sqrt(5.0)
            time = Quantity(found.mean(), standard, factor * standard, degrees_of_freedom=4.0)
            points.append(TrendPoint(f"{run}", "steel", "", contact_time=time))
        found = follow(points, CONTACT_TIME)
        told += bool(found.changed) or found.drifts
    assert told <= 0.01 / 3 * drawn if step == 0.0 else told >= 0.9 * drawn


@pytest.mark.parametrize(("drift", "is_told"), [(0.01, False), (0.04, True)])
def test_a_gain_that_drifts_over_four_runs_is_told(drift, is_told):
    runs = [make_run(day, 212.0, gain=1.0 + drift * day / 3) for day in range(4)]
    (time, stiffness, gains), _ = tell(runs)
    assert "no change" in time
    assert "no change" in stiffness
    assert ("a2/a1 changes by +3.9 % from the first run" in gains) is is_told


@pytest.mark.parametrize(("accepted", "is_followed"), [(3, False), (4, True)])
def test_runs_whose_scatter_is_not_known_are_not_followed(accepted, is_followed):
    (time, *_), _ = tell([make_run(day, 212.0, accepted=accepted) for day in (1, 2)])
    assert ("it takes two runs with 4 hits" in time) is not is_followed


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
