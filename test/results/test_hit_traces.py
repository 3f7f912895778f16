"""Blocks joined to the traces of a record."""

from dataclasses import replace

import numpy as np

from impact_rig.core.records import Block, ChannelBlock, HitLabel
from impact_rig.results import hit_traces
from impact_rig.results.hit_traces import TraceAssembler

RATE = 2.5e6


def make_channel(counts):
    return ChannelBlock(np.asarray(counts, dtype=np.int32), 0.5, 2.0, 1000.0)


def make_block(first, counts, *, record=1, last=False, triggered=True):
    counts = np.asarray(counts)
    return Block(
        label=HitLabel("steel small", record=record),
        first_sample=first,
        sampling_rate=RATE,
        hammer=make_channel(counts),
        specimen=make_channel(-counts),
        triggered=triggered,
        last=last,
    )


def feed(*blocks):
    assembler = TraceAssembler()
    return [joined for block in blocks if (joined := assembler.feed(block)) is not None]


def test_a_record_comes_calibrated_with_its_last_block():
    (joined,) = feed(make_block(0, [10, 20]), make_block(2, [30], last=True))

    assert joined.label == HitLabel("steel small", record=1)
    assert joined.values.dtype == np.float32
    np.testing.assert_array_equal(joined.values, [[7, -3], [12, -8], [17, -13]])
    np.testing.assert_allclose(joined.time, np.arange(3) / RATE, rtol=1e-12)


def test_a_gap_breaks_the_line():
    (joined,) = feed(make_block(0, [1, 2]), make_block(4, [3], last=True))

    np.testing.assert_allclose(joined.time * RATE, [0, 1, 2, 4], rtol=1e-12)
    assert np.isnan(joined.values[2]).all()
    assert np.isfinite(joined.values[[0, 1, 3]]).all()


def test_a_record_without_its_end_is_dropped_when_the_next_begins():
    (joined,) = feed(make_block(0, [1, 2]), make_block(0, [3], record=2, last=True))

    assert joined.label.record == 2
    assert joined.values.shape == (1, 2)


def test_an_endless_record_does_not_fill_the_memory(monkeypatch):
    monkeypatch.setattr(hit_traces, "LARGEST_RECORD", 10)

    (joined,) = feed(*(make_block(4 * i, np.zeros(4), last=i == 9) for i in range(10)))

    assert joined.time.size == 12


def test_a_sample_that_was_not_measured_is_not_a_number():
    block = make_block(0, [10, 20], last=True)
    (joined,) = feed(replace(block, specimen=replace(block.specimen, output=np.empty(0))))

    np.testing.assert_array_equal(joined.values, [[7, np.nan], [12, np.nan]])
