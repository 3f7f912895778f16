"""The head of a block is read from its bytes as ROS 2 itself serialises it."""

from array import array

import pytest
from impact_rig_msgs.msg import AccelerationBlock, Channel, StreamBlock
from rclpy.serialization import serialize_message

from impact_rig.core.signals.record import HitLabel
from impact_rig.recording.interfaces.block_heads import read_block_head, read_stream_head

KINDS = [(AccelerationBlock, read_block_head), (StreamBlock, read_stream_head)]


@pytest.mark.parametrize(("kind", "read"), KINDS)
@pytest.mark.parametrize("frame", ["", "rig", "hall 3"])
@pytest.mark.parametrize("sample", ["", "a", "steel", "Prüfkörper, groß"])
def test_all_fields_are_found_wherever_they_are_aligned(kind, read, frame, sample):
    message = kind(
        record=7, sample=sample, impact=3, attempt=2, first_sample=2**40 + 1,
        sampling_rate=2.5e6, last=True,
    )  # fmt: skip
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = 1_700_000_000, 123_456_789
    message.hammer = Channel(counts=array("i", range(11)))
    head = read(serialize_message(message))
    assert head.label == HitLabel(sample, 7, 3, 2)
    assert (head.first_sample, head.points, head.last) == (2**40 + 1, 11, True)
    assert head.stamp == 1_700_000_000_123_456_789


@pytest.mark.parametrize(("kind", "read"), KINDS)
def test_numbers_of_any_other_source_are_counted_as_points(kind, read):
    message = kind(hammer=Channel(values=array("d", [0.5] * 9)), last=False)
    head = read(serialize_message(message))
    assert (head.points, head.last) == (9, False)
