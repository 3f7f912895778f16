"""Blocks and where their numbers come from: copied, read-only, and checked."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.given.errors import RigError, SignalError
from impact_rig.core.given.records import (
    IMPORTED,
    MEASURED,
    SIMULATED,
    Block,
    ChannelBlock,
    HitLabel,
    Origin,
    PackedRecord,
    Record,
    join_origins,
)

LABEL = HitLabel("steel", record=7)


def make_channel(count: int = 4, **changes: float) -> ChannelBlock:
    calibration = {"scale": 0.5, "offset": 0.0, "full_scale": 2000.0, **changes}
    return ChannelBlock(np.arange(count, dtype=np.int32), **calibration)


def test_what_blocks_and_traces_hold_is_their_own():
    counts = np.arange(4, dtype=np.int32)
    channel = ChannelBlock(counts, 0.5, 0.0, 2000.0)
    held = (channel.output, channel.acceleration)
    counts[0] = 99
    for array, kind in zip(held, (np.int32, np.float64), strict=True):
        assert (array.dtype, array[0]) == (kind, 0)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 99


@pytest.mark.parametrize(
    "counts", [np.ones(3, complex), np.ones(3, np.int64), np.ones((2, 3), int)]
)
def test_counts_that_would_be_bent_are_refused(counts):
    with pytest.raises(SignalError, match="one row of whole numbers of 32 bits at most"):
        ChannelBlock(counts, 1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "told"),
    [({"scale": 0.0}, "scale is 0.0"), ({"offset": np.inf}, "offset is inf")],
)
def test_an_impossible_calibration_is_refused(changes, told):
    with pytest.raises(RigError, match=told):
        make_channel(**changes)


def test_channels_of_a_block_are_equally_long():
    with pytest.raises(SignalError, match="record 7 has 4 hammer points and 5 sample points"):
        Block(100, 1e6, make_channel(4), make_channel(5), LABEL)


REAL, VIRTUAL = Origin(MEASURED, "digitizer 7"), Origin(SIMULATED, "virtual rig")


def test_hits_of_one_kind_are_told_by_their_sources():
    files = [Origin(IMPORTED, "csv file", f"hit_{number}.csv", "'a'") for number in (1, 2)]
    assert join_origins(files) == Origin(IMPORTED, "csv file")
    other = Origin(MEASURED, "digitizer 8")
    assert join_origins([REAL, REAL, other]) == Origin(MEASURED, "digitizer 7; digitizer 8")


def test_one_simulated_hit_among_measured_ones_is_not_lost():
    found = join_origins([REAL] * 9 + [VIRTUAL])
    assert str(found) == "mixed (measured (digitizer 7), simulated (virtual rig))"


def test_words_of_a_source_do_not_steer_a_terminal():
    assert Origin(MEASURED, "scope\x1b[2J\n").source == "scope?[2J?"


@pytest.mark.parametrize(
    "output", [np.array([-32768, 0, 40_000], np.int32), np.array([0.5, np.nan, -1e300])]
)
def test_a_packed_record_comes_back_bit_by_bit(output):
    channel = ChannelBlock(output, 0.25, -1.5, 512.0, overloaded=True)
    absent = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)
    for specimen in (channel, absent):
        record = Record(7, 2.5e6, channel, specimen, HitLabel("oak", 3), pulse_index=1)
        packed = PackedRecord.pack(record)
        found = packed.unpack()
        assert replace(found, hammer=channel, specimen=specimen) == record
        for one, other in zip(found.channels, record.channels, strict=True):
            assert one.output.dtype == other.output.dtype
            assert one.output.tobytes() == other.output.tobytes()
            assert (one.scale, one.offset, one.overloaded) == (0.25, -1.5, True)
