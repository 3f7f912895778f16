"""The impacts of a recorded stream that nobody found while it was recorded."""

from collections.abc import Iterator
from typing import Any

from rclpy.serialization import serialize_message

from impact_rig.core.signals.record import HitLabel
from impact_rig.core.signals.stream_cutter import StreamCutter
from impact_rig.nodes.messages import block_to_msg
from impact_rig.recording.interfaces.messages import setup_from_msg, stream_block_from_msg


class ReplayedStream:
    """Cuts impacts out of a running stream, to be published as `AccelerationBlock`.

    So a replay as fast as its subscribers take it waits for each hit, and not for a stream.
    """

    def __init__(self) -> None:
        self._cutter: StreamCutter | None = None

    def begin(self, setup: Any) -> None:
        """Take a set-up, decoded, which holds for the stream after it."""
        self._cutter = StreamCutter(setup_from_msg(setup).analysis)

    def cut(self, block: Any) -> Iterator[tuple[HitLabel, bool, bytes]]:
        """Take a block of the stream, decoded; yield the blocks of the hit that it completes.

        Yields
        ------
        label : HitLabel
            Of the hit.
        is_last : bool
            Whether the block ends it.
        data : bytes
            The block, serialised.
        """
        if self._cutter is None:
            return
        for cut in self._cutter.feed(stream_block_from_msg(block)):
            yield cut.label, cut.last, serialize_message(block_to_msg(cut))
