"""Blocks, traces and records: copied, read-only, and checked."""

import numpy as np
import pytest

from impact_rig.core.errors import RigError, SignalError
from impact_rig.core.records import Block, ChannelBlock, HitLabel, Trace

LABEL = HitLabel("steel", record=7)


def make_channel(count: int = 4, **changes: float) -> ChannelBlock:
    calibration = {"scale": 0.5, "offset": 0.0, "full_scale": 2000.0, **changes}
    return ChannelBlock(np.arange(count, dtype=np.int32), **calibration)


def test_what_blocks_and_traces_hold_is_their_own():
    counts = np.arange(4, dtype=np.int32)
    held = (ChannelBlock(counts, 0.5, 0.0, 2000.0).output, Trace(counts).acceleration)
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
    ("changes", "message"),
    [
        ({"scale": 0.0}, "scale is 0.0 m/s^2 per unit: it must not be zero"),
        ({"scale": np.nan}, "scale is nan"),
        ({"offset": np.inf}, "offset is inf"),
        ({"full_scale": -1.0}, "full scale is -1.0 m/s^2"),
    ],
)
def test_an_impossible_calibration_is_refused(changes, message):
    with pytest.raises(RigError) as error:
        make_channel(**changes)
    assert message in str(error.value)


def test_channels_of_a_block_are_equally_long():
    with pytest.raises(SignalError) as error:
        Block(100, 1e6, make_channel(4), make_channel(5), LABEL)
    assert str(error.value) == (
        "block at point 100 of record 7 has 4 hammer points and 5 sample points: both channels"
        " must be equally long"
    )


def test_what_is_read_only_already_is_not_copied():
    counts, values = np.arange(4, dtype=np.int32), np.arange(4.0)
    for array in (counts, values):
        array.setflags(write=False)
    assert ChannelBlock(counts, 0.5, 0.0, 2000.0).output is counts
    assert Trace(values).acceleration is values
