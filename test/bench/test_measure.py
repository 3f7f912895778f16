"""The bench as a whole: figures and goals, parts that are run, recordings to measure with."""

import itertools
from pathlib import Path

import pytest

from bench import campaigns, measure
from bench.campaigns import Campaign, Campaigns
from bench.measure import (
    Extent,
    Figure,
    Part,
    at_least,
    at_most,
    compare_times,
    run_parts,
)  # fmt: skip
from bench.results import Change, compare_figure
from impact_rig.core.errors import RigError


@pytest.mark.parametrize(
    ("goal", "value", "is_reached"),
    [
        (at_most(2.0), 2.0, True),
        (at_most(2.0), 2.001, False),
        (at_least(1.7), 1.7, True),
        (at_least(1.7), 1.699, False),
        (at_most(2.0), float("nan"), False),
        (None, 1.0, None),
    ],
)
def test_the_median_decides_whether_a_goal_is_reached(goal, value, is_reached):
    assert Figure("ratio", (value,), goal=goal).is_reached is is_reached


def test_each_side_is_first_in_every_second_turn_after_a_call_that_does_not_count():
    called: list[str] = []
    ticks = itertools.count()
    ours, peers = compare_times(
        lambda: called.append("work"),
        lambda: called.append("peer"),
        repeats=3,
        calls=(1, 2),
        clock=lambda: float(next(ticks)),
    )
    first, second = ["work", "peer", "peer"], ["peer", "peer", "work"]
    assert called == ["work", "peer", *first, *second, *first]
    # A turn lasts one tick here, however many calls share it.
    assert (ours, peers) == ([1.0] * 3, [0.5] * 3)


@pytest.mark.parametrize(
    ("now", "before", "percent", "is_beyond_spread"),
    [
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), 0.0, False),
        ((2.0, 3.0, 4.0), (1.0, 2.0, 3.0), 50.0, False),
        ((4.0, 5.0, 6.0), (1.0, 2.0, 3.0), 150.0, True),
        ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), -60.0, True),
        ((-1.0, -1.0), (-2.0, -2.0), 50.0, True),
        ((5.0,), (1.0, 2.0, 3.0), 150.0, None),
        ((0.0,), (0.0,), 0.0, None),
    ],
)
def test_a_change_is_that_of_the_median_and_more_than_chance_where_quartiles_do_not_meet(
    now, before, percent, is_beyond_spread
):
    change = compare_figure(Figure("time", now), Figure("time", before))
    assert change == Change(pytest.approx(percent), is_beyond_spread)


def measure_well(bench):
    assert not list(bench.folder.iterdir())
    (bench.folder / "left.behind").touch()
    bench.report(1, 2)
    return (Figure("good", (1.0,), goal=at_most(2)), Figure("bad", (3.0,), goal=at_most(2)))


def fail(_):
    raise RigError("it cannot be measured here")


def miss(_):
    raise ModuleNotFoundError("No module", name="rclpy")


@pytest.fixture
def parts(monkeypatch):
    functions = {"well": measure_well, "fails": fail, "lacks": miss}
    monkeypatch.setattr(
        measure, "load_part", lambda name: Part(name, f"Title of {name}", functions[name], 1.0)
    )


@pytest.mark.usefixtures("parts")
def test_a_part_that_cannot_be_run_costs_no_other():
    results = run_parts(["fails", "lacks", "well"], Extent(), lambda *_: None)
    assert [len(part.figures) for part in results.parts] == [0, 0, 2]
    assert results.errors == (
        "fails: it cannot be measured here",
        "lacks: Python finds no module 'rclpy': see `impact-rig doctor`",
    )
    assert [figure.name for figure in results.missed] == ["bad"]


def test_a_campaign_is_run_once_for_all_parts(tmp_path, monkeypatch):
    folders: list[Path] = []

    def run(folder, _):
        folders.append(folder)
        if len(folders) == 2:
            raise RigError("the rig does not strike")
        return Campaign(folder / "session.mcap", 1.0)

    monkeypatch.setattr(campaigns, "run_campaign", run)
    made = Campaigns(tmp_path)
    first = made.take(1)
    assert made.take(1) == first
    with pytest.raises(RigError):
        made.take(2)
    # What a campaign that failed has left behind is in nobody's way.
    assert made.take(3)[:1] == first
    assert len(set(folders)) == len(folders) == 4
