"""Gaps in a stream of blocks: found, named, never bridged; and no hit vanishes in one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, ChannelBlock, HitLabel

# At the 1 MHz of these streams: 200 points of pre-trigger, 2000 of record.
SETTINGS = AnalysisSettings()
BEFORE, LENGTH = 200, 2000
Make = Callable[..., Any]


def remove(blocks: list[Block], first: int, last: int) -> list[Block]:
    """Take away the blocks between two points of the stream; the last block ends it still."""
    kept = [b for b in blocks if not first <= b.first_sample < last]
    return [*kept[:-1], replace(kept[-1], last=True)]


IMPACT = 6000


@given(start=st.integers(1, 1200), count=st.integers(1, 80))
@settings(max_examples=60)
def test_a_gap_in_the_window_is_named_and_one_outside_changes_no_bit(
    make_counts: Make, make_blocks: Make, start: int, count: int, detect: Make, describe: Make
) -> None:
    hammer = make_counts([(IMPACT, 900.0)], 12_000)
    blocks = make_blocks(hammer, hammer, [10])
    (intact,) = detect(blocks)
    low, high = 10 * start, min(10 * (start + count), 11_990)
    first = (intact.stamp - 1_000) // 1_000
    records = detect(remove(blocks, low, high)) if high > low else [intact]
    if high > low and low < first + LENGTH and high > first:
        assert records
        assert all(record.flaws for record in records)
        assert f"{high - low} points missing at point {low}" in records[0].flaws
    else:
        assert [describe(record) for record in records] == [describe(intact)]


@pytest.mark.parametrize("place", ["before", "behind"])
def test_a_gap_that_touches_the_window_from_outside_does_no_harm(
    make_counts: Make, make_blocks: Make, place: str, detect: Make, describe: Make
) -> None:
    hammer = make_counts([(IMPACT, 900.0)], 12_000)
    (intact,) = detect(make_blocks(hammer, hammer, [12_000]))
    first = (intact.stamp - 1_000) // 1_000
    edge = first if place == "before" else first + LENGTH
    low, high = (edge - 50, edge) if place == "before" else (edge, edge + 50)
    blocks = make_blocks(hammer, hammer, [low, 50, 12_000])
    assert (blocks[1].first_sample, blocks[2].first_sample) == (low, high)
    (record,) = detect([blocks[0], blocks[2]])
    assert describe(record) == describe(intact)


def test_a_hit_that_a_gap_cuts_off_is_handed_out_at_once(
    make_counts: Make, make_blocks: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 8000)
    blocks = make_blocks(hammer, hammer, [500])
    detector = ImpactDetector(SETTINGS)
    for block in blocks[:4]:
        assert detector.feed(block) == ()
    (record,) = detector.feed(blocks[6])
    assert record.flaws == ("1000 points missing at point 2000",)
    assert record.hammer.acceleration.size < LENGTH
    assert [item for block in blocks[7:] for item in detector.feed(block)] == []


def test_what_follows_the_gap_within_the_window_is_no_hit_of_its_own(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0), (2200, 700.0), (6000, 900.0)], 9000)
    blocks = make_blocks(hammer, hammer, [500])
    first, second = detect([*blocks[:3], *blocks[4:]])
    assert first.flaws == ("500 points missing at point 1500",)
    assert second.flaws == ()
    assert (second.stamp - 1_000) // 1_000 == pytest.approx(6000 - BEFORE, abs=25)


def test_a_lost_beginning_is_a_gap(make_counts: Make, make_blocks: Make, detect: Make) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    blocks = make_blocks(hammer, hammer, [900])
    (record,) = detect(blocks[1:])
    assert record.flaws == ("900 points missing at point 0",)


def test_a_pulse_lost_in_a_gap_leaves_a_record_that_names_the_gap(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    blocks = make_blocks(hammer, hammer, [500])
    (record,) = detect([blocks[0], blocks[1], *blocks[4:]])
    assert record.pulse_index is None
    assert record.flaws == ("1000 points missing at point 1000",)


def test_repeated_points_are_named(make_counts: Make, make_blocks: Make, detect: Make) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    blocks = make_blocks(hammer, hammer, [500])
    first, *others = detect([*blocks[:4], *blocks[3:]])
    assert first.flaws == ("500 points repeated at point 1500",)
    assert all(record.flaws for record in others)


def test_a_change_of_calibration_is_never_bridged(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    blocks = make_blocks(hammer, hammer, [1500])
    changed = [replace(b, hammer=replace(b.hammer, scale=0.5)) for b in blocks[1:]]
    record, *_ = detect([blocks[0], *changed])
    assert record.flaws == ("sampling rate, channels or calibration changed at point 1500",)
    assert record.hammer.acceleration.size < LENGTH


def test_a_hit_whose_arming_breaks_off_does_not_vanish(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    broken = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=1))[:4]
    whole = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=2))
    first, second = detect([*broken, *whole])
    assert (first.label.record, second.label.record) == (1, 2)
    assert first.flaws == ("the stream breaks off at point 2000",)
    assert second.flaws == ()


def test_an_arming_that_breaks_off_before_its_hit_is_named(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 5000)
    broken = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=1))[:1]
    channel = ChannelBlock(np.empty(0, np.int32), 1.0, 0.0, 2000.0)
    missed = Block(
        HitLabel("steel", record=2), 0, 1e6, channel, channel, triggered=False, last=True
    )
    first, second = detect([*broken, missed])
    assert first.pulse_index is None
    assert first.flaws == ("the stream breaks off at point 500",)
    assert (second.triggered, second.label.record) == (False, 2)


def test_a_break_behind_a_hit_that_was_complete_is_no_flaw(
    make_counts: Make, make_blocks: Make, detect: Make
) -> None:
    hammer = make_counts([(1000, 900.0)], 9000)
    broken = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=1))[:-1]
    whole = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=2))
    records = detect([*broken, *whole])
    assert [(item.label.record, item.flaws) for item in records] == [(1, ()), (2, ())]
