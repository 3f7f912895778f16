"""Impacts cut out of a running stream: whole, labelled, with the gaps that the stream has.

Where a running stream begins, breaks off and ends: no hit there goes without a word.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import NOT_ARMED, Block, HitLabel
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.judging import judge_hit
from impact_rig.core.hit.stream import QUIET_LEAD, StreamCutter

from ..blocks import Counts, detect, make_blocks, make_counts

# At the 1 MHz of these streams: 200 points of pre-trigger, 2000 of record.
SETTINGS = AnalysisSettings()
BEFORE, LENGTH = 200, 2000
CUT = (QUIET_LEAD - 1) * BEFORE + LENGTH
FIRST, SECOND = HitLabel("steel", record=1), HitLabel("steel", record=2, impact=2)


def make_stream(
    counts: Counts,
    sizes: Iterable[int],
    armings: Sequence[tuple[int, int, HitLabel]] = (),
    **options: Any,
) -> list[Block]:
    """Cut counts into the blocks of a stream, with armings as (first, behind last, label)."""
    borders = {place for first, last, _ in armings for place in (first, last)}
    stream: list[Block] = []
    for block in make_blocks(counts, counts, sizes, **options):
        start, size = block.first_sample, block.hammer.output.size
        inner = sorted(place - start for place in borders if start < place < start + size)
        for low, high in zip([0, *inner], [*inner, size], strict=True):
            label, last = NOT_ARMED, False
            for first, stop, named in armings:
                if first <= start + low < stop:
                    label, last = named, start + high == stop
            stream.append(replace(block.cut(low, high), label=label, last=last))
    return stream


def cut(stream: Iterable[Block]) -> list[Block]:
    cutter = StreamCutter(SETTINGS)
    return [block for item in stream for block in cutter.feed(item)]


def describe(block: Block) -> tuple[Any, ...]:
    return (
        block.label,
        block.first_sample,
        block.triggered,
        block.last,
        block.stamp,
        block.hammer.output.tobytes(),
        block.specimen.output.tobytes(),
    )


def test_an_impact_of_an_arming_is_cut_out_with_its_pre_trigger():
    counts = make_counts([(7000, 900.0)], 20_000, noise=0.0, offset=0.0)
    # 3 % of full scale is 61.44 counts: reached where 900 sin^2 is.
    pulse = 7000 + int(np.ceil(np.arcsin(np.sqrt(61.44 / 900)) * 200 / np.pi))
    (block,) = cut(make_stream(counts, [2500], [(2500, 15_000, FIRST)]))
    start = pulse - QUIET_LEAD * BEFORE
    assert (block.label, block.first_sample, block.last, block.triggered) == (FIRST, 0, True, True)
    np.testing.assert_array_equal(block.hammer.output, counts[start : start + CUT])
    np.testing.assert_array_equal(block.specimen.output, counts[start : start + CUT])
    assert block.stamp == 1_000 + 1_000 * start
    (record,) = detect([block])
    assert (record.pulse_index, record.flaws) == (BEFORE, ())
    assert record.hammer.acceleration.size == LENGTH


@given(
    sizes=st.lists(st.integers(1, 4000), min_size=2, max_size=8).filter(lambda s: sum(s) > 800),
    steps=st.lists(st.integers(300, 3500), min_size=1, max_size=6),
    heights=st.lists(st.sampled_from([-1800.0, -400.0, 150.0, 900.0]), min_size=6, max_size=6),
    borders=st.lists(st.integers(1, 19_000), min_size=4, max_size=4, unique=True),
    lost=st.lists(st.tuples(st.integers(0, 19_000), st.integers(1, 3000)), max_size=2),
)
@settings(max_examples=80)
def test_splitting_the_stream_into_other_blocks_changes_no_bit(
    sizes, steps, heights, borders, lost
):
    counts = make_counts(zip(np.cumsum(steps), heights, strict=False), 20_000)
    a, b, c, d = sorted(borders)
    armings = [(a, b, FIRST), (c, d, SECOND)]

    def lose(stream: Iterable[Block]) -> list[Block]:
        """Take points away, wherever the blocks' borders are."""
        kept = list(stream)
        for low, count in lost:
            kept = [part for item in kept for part in remove(item, low, low + count)]
        return kept

    whole = cut(lose(make_stream(counts, [20_000], armings)))
    split = cut(lose(make_stream(counts, sizes, armings)))
    assert [describe(item) for item in split] == [describe(item) for item in whole]


def remove(block: Block, low: int, high: int) -> list[Block]:
    """Return what is left of a block without the points `low` up to `high` of the stream."""
    start, size = block.first_sample, block.hammer.output.size
    low, high = (min(max(place - start, 0), size) for place in (low, high))
    if low == high:
        return [block]
    return [part for part in (block.cut(0, low), block.cut(high, size)) if part.hammer.output.size]


def test_a_hit_is_handed_out_as_soon_as_its_window_has_come():
    cutter = StreamCutter(SETTINGS)
    stream = make_stream(make_counts([(5000, 900.0)], 9000), [500], [(500, 9000, FIRST)])
    handed_out = [item.first_sample for item in stream if cutter.feed(item)]
    # The window ends 1800 points behind the first tenth of the pulse.
    assert handed_out == [6500]


def test_the_first_impact_of_an_arming_is_its_hit_and_all_others_are_counted():
    counts = make_counts([(place, 900.0) for place in (3000, 9000, 12_000, 16_000)], 20_000)
    cutter = StreamCutter(SETTINGS)
    stream = make_stream(counts, [1000], [(8000, 15_000, FIRST)])
    (block,) = [block for item in stream for block in cutter.feed(item)]
    assert (block.stamp - 1_000) // 1_000 == pytest.approx(9000 - QUIET_LEAD * BEFORE, abs=25)
    assert block.label == FIRST
    assert cutter.flow.other_impacts == 3
    assert (cutter.flow.blocks, cutter.flow.points) == (20, 20_000)


def test_an_arming_that_ends_without_an_impact_says_so_by_an_empty_block():
    (block,) = cut(make_stream(make_counts([], 9000), [1000], [(2000, 6000, FIRST)]))
    assert (block.label, block.triggered, block.last) == (FIRST, False, True)
    assert block.hammer.output.size == block.first_sample == 0
    (record,) = detect([block])
    assert not record.triggered


@pytest.mark.parametrize("following", [NOT_ARMED, SECOND])
def test_each_impact_belongs_to_the_arming_it_falls_into(following):
    counts = make_counts([(3900, 900.0), (8000, 900.0)], 20_000)
    # The first one's window reaches into what follows its arming.
    stream = make_stream(counts, [1000], [(1000, 4100, FIRST), (4100, 15_000, following)])
    cuts = cut(replace(item, last=False) for item in stream)
    expected = [FIRST] if following == NOT_ARMED else [FIRST, SECOND]
    assert [(block.label, block.last) for block in cuts] == [(label, True) for label in expected]


def test_an_arming_whose_hammer_was_disarmed_has_no_hit_and_what_comes_after_it_is_no_ones():
    counts = make_counts([(8000, 900.0)], 20_000)
    armed, *rest = make_stream(counts, [4000, 16_000], [(0, 4000, FIRST)])
    (end,) = cut([replace(armed, disarmed="a stop"), *rest])
    assert (end.label, end.triggered, end.disarmed) == (FIRST, False, "a stop")
    (record,) = detect([end])
    (found,) = judge_hit(record, SETTINGS).rejections
    assert found.reason is Reason.DISARMED


class TestGap:
    """Points that never came: they stay away."""

    def lose(self, lost: tuple[int, int]) -> tuple[list[Block], StreamCutter]:
        """Cut a hit at point 8000 out of a stream that lacks some points."""
        counts = make_counts([(8000, 900.0)], 30_000)
        stream = make_stream(counts, [1000], [(2000, 25_000, FIRST)])
        cutter = StreamCutter(SETTINGS)
        parts = [part for item in stream for part in remove(item, *lost)]
        return [block for part in parts for block in cutter.feed(part)], cutter

    def test_inside_the_window_cuts_the_hit_off(self):
        cuts, cutter = self.lose((8500, 8900))
        begin, end = cuts
        start = (begin.stamp - 1_000) // 1_000
        assert (begin.first_sample, begin.hammer.output.size, begin.last) == (
            0, 8500 - start, False,
        )  # fmt: skip
        assert (end.first_sample, end.hammer.output.size, end.last) == (CUT, 0, True)
        assert (cutter.flow.gaps, cutter.flow.missing_points) == (1, 400)
        (record,) = detect(cuts)
        assert record.flaws

    def test_that_takes_the_whole_hit_is_named(self):
        cuts, _ = self.lose((7500, 12_000))
        (record,) = detect(cuts)
        assert record.flaws == ("4500 points missing at point 0",)


def test_only_what_a_hit_may_still_need_is_kept():
    cutter = StreamCutter(SETTINGS)
    counts = make_counts([(500_000, 900.0)], 1_000_000)
    for block in make_stream(counts, [1000], [(1000, 1_000_000, FIRST)]):
        cutter.feed(block)
        kept = len(cutter._segment._blocks)
        # A window is 2200 points, and begins and ends anywhere in a block.
        assert kept <= 4


def make_short_stream(counts: Counts, size: int = 1000, first: int = 0) -> list[Block]:
    """Cut counts into the blocks of a stream that is armed all the time."""
    return [
        replace(block, first_sample=block.first_sample + first, label=FIRST, last=False)
        for block in make_blocks(counts, counts, [size])
    ]


def end_arming(stream: list[Block]) -> Block:
    """Return the block that ends a stream, and holds nothing else."""
    size = stream[-1].hammer.output.size
    return replace(stream[-1].cut(size, size), last=True)


def end_stream(stream: list[Block]) -> Block:
    """Return the block that ends a stream."""
    return replace(end_arming(stream), label=NOT_ARMED)


@given(pulse=st.integers(-150, 150), first=st.sampled_from([0, 123_456]))
@settings(max_examples=25)
def test_a_hit_that_the_stream_begins_in_is_rejected_for_what_it_lacks(pulse, first):
    whole = make_counts([(200 + pulse, 900.0)], 9200)
    (record,) = detect(cut(make_short_stream(whole[200:], first=first)))
    assert record.label == FIRST
    assert "missing at point 0" in record.flaws[0]
    assert Reason.GAP in {item.reason for item in judge_hit(record, SETTINGS).rejections}


def test_a_stream_that_begins_in_a_hit_is_not_deaf_for_the_next_one():
    counts = make_counts([(0, 900.0), (6000, 900.0)], 12_000)
    stream = make_short_stream(counts)
    following = [replace(item, label=replace(FIRST, record=2)) for item in stream[4:]]
    first, second = detect(cut([*stream[:4], *following]))
    assert (first.label.record, second.label.record) == (1, 2)
    assert first.flaws
    assert second.flaws == ()


@pytest.mark.parametrize("behind", [0, 80, 160])
def test_a_hit_right_behind_a_gap_is_rejected_for_it(behind):
    # From 100 points before the gap's end to where its pre-trigger is nearly whole.
    counts = make_counts([(10_000 + behind - 100, 900.0)], 20_000)
    stream = make_short_stream(counts, size=500)
    (record,) = detect(cut([*stream[:16], *stream[20:], end_arming(stream)]))
    assert record.flaws


@pytest.mark.parametrize("arming_ends", [True, False])
def test_a_hit_that_the_end_of_the_stream_cuts_off_is_judged_at_once(arming_ends):
    stream = make_short_stream(make_counts([(5500, 900.0)], 6000))
    ends = [end_arming(stream)] if arming_ends else []
    cuts = cut([*stream, *ends, end_stream(stream)])
    assert [block.last for block in cuts] == [False, True]
    (record,) = detect(cuts)
    assert record.label == FIRST
    assert record.flaws[0].endswith(f"missing at point {cuts[0].hammer.output.size}")
