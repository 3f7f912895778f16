"""Where a running stream begins, breaks off and ends: no hit there goes without a word."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from impact_rig.core.hits.hit import judge_hit
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import NOT_ARMED, Block, HitLabel, Record
from impact_rig.core.signals.stream_cutter import QUIET_LEAD, StreamCutter

# At the 1 MHz of these streams: 200 points of pre-trigger, 2000 of record.
SETTINGS = AnalysisSettings()
BEFORE = 200
HIT = HitLabel("steel", record=1)
Make = Callable[..., Any]
Counts = NDArray[np.int32]


@pytest.fixture(scope="module")
def make_stream(make_blocks: Make) -> Make:
    """Cut counts into the blocks of a stream that is armed all the time."""

    def make(counts: Counts, size: int = 1000, first: int = 0) -> list[Block]:
        return [
            replace(block, first_sample=block.first_sample + first, label=HIT, last=False)
            for block in make_blocks(counts, counts, [size])
        ]

    return make


def end_arming(stream: list[Block]) -> Block:
    """Return the block that ends the arming of a stream, and holds nothing else."""
    final = stream[-1]
    return replace(
        final,
        first_sample=final.first_sample + final.hammer.output.size,
        hammer=replace(final.hammer, output=final.hammer.output[:0]),
        specimen=replace(final.specimen, output=final.specimen.output[:0]),
        last=True,
    )


def end_stream(stream: list[Block]) -> Block:
    """Return the block that ends a stream."""
    return replace(end_arming(stream), label=NOT_ARMED)


def cut(stream: Iterable[Block]) -> list[Block]:
    cutter = StreamCutter(SETTINGS)
    return [block for item in stream for block in cutter.feed(item)]


def judge(cuts: Iterable[Block]) -> list[Record]:
    """Take the cuts as a session does."""
    detector = ImpactDetector(SETTINGS)
    return [record for block in cuts for record in detector.feed(block)]


def find_reasons(record: Record) -> set[Reason]:
    return {rejection.reason for rejection in judge_hit(record, SETTINGS).rejections}


@given(pulse=st.integers(-150, 150), first=st.sampled_from([0, 123_456]))
@settings(max_examples=60)
def test_a_hit_that_the_stream_begins_in_is_rejected_for_what_it_lacks(
    make_counts: Make, make_stream: Make, pulse: int, first: int
) -> None:
    whole = make_counts([(200 + pulse, 900.0)], 9200)
    (record,) = judge(cut(make_stream(whole[200:], first=first)))
    assert record.label == HIT
    assert "missing at point 0" in record.flaws[0]
    assert Reason.GAP in find_reasons(record)


def test_a_hit_right_behind_a_whole_pre_trigger_is_a_good_one(
    make_counts: Make, make_stream: Make
) -> None:
    (record,) = judge(cut(make_stream(make_counts([(QUIET_LEAD * BEFORE, 900.0)], 9000))))
    assert record.flaws == ()
    assert find_reasons(record) == set()


def test_a_stream_that_begins_in_a_hit_is_not_deaf_for_the_next_one(
    make_counts: Make, make_stream: Make
) -> None:
    counts = make_counts([(0, 900.0), (6000, 900.0)], 12_000)
    stream = make_stream(counts)
    following = [replace(item, label=replace(HIT, record=2)) for item in stream[4:]]
    first, second = judge(cut([*stream[:4], *following]))
    assert (first.label.record, second.label.record) == (1, 2)
    assert first.flaws
    assert find_reasons(second) == set()


def test_a_hit_between_the_beginning_of_a_stream_and_a_gap_is_judged(
    make_counts: Make, make_stream: Make
) -> None:
    stream = make_stream(make_counts([(300, 900.0)], 30_000), size=500)
    (record,) = judge(cut([*stream[:2], *stream[20:], end_arming(stream)]))
    assert Reason.GAP in find_reasons(record)


@pytest.mark.parametrize("size", [1, 40, 120])
def test_of_a_few_points_before_a_gap_no_baseline_is_kept(
    make_counts: Make, make_stream: Make, size: int
) -> None:
    # They lie on the top of a pulse; what follows is quiet.
    stream = make_stream(make_counts([(0, 900.0)], 60_000), size=1000)
    top = make_stream(np.full(size, 900, np.int32))
    cutter = StreamCutter(SETTINGS)
    cuts = [block for item in [*top, *stream[3:]] for block in cutter.feed(item)]
    assert cuts == []
    assert cutter.flow.other_impacts == 0


@pytest.mark.parametrize("behind", range(0, 180, 20))
def test_a_hit_right_behind_a_gap_is_rejected_for_it(
    make_counts: Make, make_stream: Make, behind: int
) -> None:
    # From 100 points before the gap's end to where its pre-trigger is nearly whole.
    counts = make_counts([(10_000 + behind - 100, 900.0)], 20_000)
    stream = make_stream(counts, size=500)
    (record,) = judge(cut([*stream[:16], *stream[20:], end_arming(stream)]))
    assert Reason.GAP in find_reasons(record)


@pytest.mark.parametrize("arming_ends", [True, False])
def test_a_hit_that_the_end_of_the_stream_cuts_off_is_judged_at_once(
    make_counts: Make, make_stream: Make, arming_ends: bool
) -> None:
    stream = make_stream(make_counts([(5500, 900.0)], 6000))
    ends = [end_arming(stream)] if arming_ends else []
    cuts = cut([*stream, *ends, end_stream(stream)])
    assert [block.last for block in cuts] == [False, True]
    (record,) = judge(cuts)
    assert record.label == HIT
    assert record.flaws[0].endswith(f"missing at point {cuts[0].hammer.output.size}")
    assert Reason.GAP in find_reasons(record)


def test_a_hit_within_a_stream_shorter_than_a_record_is_judged(
    make_counts: Make, make_stream: Make
) -> None:
    stream = make_stream(make_counts([(700, 900.0)], 1000), size=100)
    (record,) = judge(cut([*stream, end_stream(stream)]))
    assert Reason.GAP in find_reasons(record)


def test_a_whole_hit_is_handed_out_once_though_the_stream_ends(
    make_counts: Make, make_stream: Make
) -> None:
    stream = make_stream(make_counts([(3000, 900.0)], 9000))
    (record,) = judge(cut([*stream, end_arming(stream), end_stream(stream)]))
    assert record.flaws == ()


def test_the_end_of_an_arming_may_be_told_behind_that_of_the_stream(
    make_counts: Make, make_stream: Make
) -> None:
    found = make_stream(make_counts([(5500, 900.0)], 6000))
    (record,) = judge(cut([*found, end_stream(found), end_arming(found)]))
    assert Reason.GAP in find_reasons(record)
    quiet = make_stream(make_counts([], 6000))
    (record,) = judge(cut([*quiet, end_stream(quiet), end_arming(quiet)]))
    assert find_reasons(record) == {Reason.NO_TRIGGER}


def test_a_stream_that_ends_leaves_nothing_of_an_arming_that_nobody_waits_for(
    make_counts: Make, make_stream: Make
) -> None:
    stream = make_stream(make_counts([], 6000))
    anew = [replace(item, label=NOT_ARMED) for item in stream]
    assert cut([*stream, end_stream(stream), *anew]) == []


def test_a_stream_that_begins_anew_behind_its_end_is_searched_like_the_first(
    make_counts: Make, make_stream: Make
) -> None:
    stream = make_stream(make_counts([(5500, 900.0)], 6000))
    anew = [
        replace(item, label=replace(HIT, record=2))
        for item in make_stream(make_counts([(3000, 900.0)], 9000))
    ]
    first, second = judge(cut([*stream, end_stream(stream), *anew]))
    assert Reason.GAP in find_reasons(first)
    assert find_reasons(second) == set()
    assert second.label.record == 2


def test_the_end_of_an_arming_shows_no_channel_and_changes_none(
    make_counts: Make, make_stream: Make
) -> None:
    # The sample is not measured: only a block with points tells that.
    counts = make_counts([], 6000)
    stream = [
        replace(item, specimen=replace(item.specimen, output=item.specimen.output[:0]))
        for item in make_stream(counts)
    ]
    cutter = StreamCutter(SETTINGS)
    following = [replace(item, label=NOT_ARMED) for item in make_stream(counts, first=6000)]
    following = [
        replace(item, specimen=replace(item.specimen, output=item.specimen.output[:0]))
        for item in following
    ]
    blocks = [*stream, end_arming(stream), *following]
    (block,) = [block for item in blocks for block in cutter.feed(item)]
    assert not block.triggered
    assert cutter.flow.gaps == 0
