"""The head of a block is read from its bytes as other libraries write them."""

import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import Block, ChannelBlock, HitLabel
from impact_rig.recording.interfaces.block_heads import read_block_head
from impact_rig.recording.interfaces.message_encoder import MessageEncoder


def encode(sample="brass, small", counts=5, *, numbers=False, last=False):
    """Return a block as rosbags serialises it."""
    output = np.arange(counts, dtype=np.float64 if numbers else np.int32)
    block = Block(
        label=HitLabel(sample, 7, 3, 2),
        first_sample=2**40 + 1,
        sampling_rate=2.5e6,
        hammer=ChannelBlock(output, 1.0, 0.0, 1e4),
        specimen=ChannelBlock(output, 1.0, 0.0, 1e4),
        last=last,
        stamp=1_700_000_000_123_456_789,
    )
    return bytes(MessageEncoder().encode_block(block))


# The text before them decides where the numbers are aligned.
@pytest.mark.parametrize("sample", ["", "a", "ab", "abc", "abcd", "abcde", "Prüfkörper", "x" * 99])
@pytest.mark.parametrize("last", [False, True])
def test_all_fields_are_found_wherever_they_are_aligned(sample, last):
    head = read_block_head(encode(sample, last=last))
    assert head.label == HitLabel(sample, 7, 3, 2)
    assert (head.first_sample, head.points, head.last) == (2**40 + 1, 5, last)
    assert head.stamp == 1_700_000_000_123_456_789


@pytest.mark.parametrize("numbers", [False, True])
@pytest.mark.parametrize("points", [0, 1, 1000])
def test_points_are_counted_whether_counts_or_numbers(numbers, points):
    assert read_block_head(encode(counts=points, numbers=numbers)).points == points


@pytest.mark.parametrize("length", [0, 1, 4, 11, 30, 60])
def test_a_block_that_is_cut_off_is_refused(length):
    with pytest.raises(FileError, match=f"a block of {length} byte is cut off"):
        read_block_head(encode()[:length])
