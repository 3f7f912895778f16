"""Blocks of a running stream as messages."""

from impact_rig_msgs.msg import StreamBlock

from impact_rig.core.signals.record import ChannelBlock, HitLabel
from impact_rig.nodes.messages import fill_channel_msg, stamp_to_msg


def stream_block_to_msg(
    hammer: ChannelBlock, specimen: ChannelBlock, sampling_rate: float
) -> StreamBlock:
    """Return both channels over a block as a message, without its place in a stream."""
    message = StreamBlock()
    fill_stream_block(message, hammer, specimen, sampling_rate)
    return message


def fill_stream_block(
    message: StreamBlock, hammer: ChannelBlock, specimen: ChannelBlock, sampling_rate: float
) -> None:
    """Let a message hold both channels over another block; see `fill_channel_msg`."""
    message.sampling_rate = sampling_rate
    fill_channel_msg(message.hammer, hammer)
    fill_channel_msg(message.specimen, specimen)


def place_stream_block(
    message: StreamBlock, first_sample: int, stamp: int, label: HitLabel, *, last: bool
) -> None:
    """Say where in the stream a block lies, when its first point was taken, and what it is of."""
    message.header.stamp = stamp_to_msg(stamp)
    message.first_sample = first_sample
    message.record = label.record
    message.sample = label.sample
    message.impact = label.impact
    message.attempt = label.attempt
    message.last = last
