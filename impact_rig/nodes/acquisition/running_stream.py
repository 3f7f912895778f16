"""Continuous mode: everything that a source delivers, published block by block."""

from typing import Any

from impact_rig_msgs.msg import StreamBlock

from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.devices.acceleration_source import AcquiredBlock
from impact_rig.nodes.acquisition.block_output import BlockOutput
from impact_rig.nodes.stream_messages import fill_stream_block, place_stream_block


class RunningStream(BlockOutput):
    """Publishes `StreamBlock`, armed or not; each has the label of the arming under way.

    The estimator finds the hit. An arming that ends without one, though the hammer has been let
    go, is ended by an empty block that says so, upon which the estimator rejects what has not
    come: exactly one verdict. The stream is ended by one of no arming, upon which the estimator
    rejects the hit that is cut off.

    Parameters
    ----------
    publisher : Publisher
        Of the messages.
    sampling_rate : float
        [Hz]
    block_size : int
        Points per message, at most.
    """

    def __init__(self, publisher: Any, sampling_rate: float, block_size: int) -> None:
        super().__init__(publisher, sampling_rate, block_size)
        self._label = NOT_ARMED
        # The same for all blocks, since it is sent before the next one comes.
        self._message = StreamBlock()

    def begin(self, label: HitLabel) -> None:
        """Let the next blocks carry the label of an arming."""
        self._label = label

    def end(self, *, is_awaited: bool) -> bool:
        """Let the next blocks belong to no arming; if a verdict is awaited, say that it ends."""
        is_told = is_awaited and self._label is not NOT_ARMED
        if is_told:
            self.publish_end(self._next_sample)
        self._label = NOT_ARMED
        return is_told

    def finish(self) -> None:
        """Say that the stream ends, if it has begun.

        Of a hit that is cut off there is no more to wait for.
        """
        if self._newest is not None:
            self._label = NOT_ARMED
            self.publish_end(self._next_sample)

    def make_message(self, block: AcquiredBlock) -> StreamBlock:
        """Return the message of a block."""
        message = self._message
        fill_stream_block(message, block.hammer, block.specimen, self._sampling_rate)
        place_stream_block(
            message, block.first_sample, self.find_stamp(block), self._label, last=block.last
        )
        return message
