"""Triggered mode: the record of each arming, published block by block."""

from typing import Any

from impact_rig_msgs.msg import AccelerationBlock

from impact_rig.core.signals.record import NOT_ARMED, Block, HitLabel
from impact_rig.devices.acceleration_source import AcquiredBlock
from impact_rig.nodes.acquisition.block_output import BlockOutput
from impact_rig.nodes.messages import block_to_msg


class HitBlocks(BlockOutput):
    """Publishes `AccelerationBlock`.

    However an arming ends, its record is whole or closed, so that exactly one verdict follows: a
    record that breaks off gets an empty last block behind the points that are missing, which the
    estimator sees as a gap; one of which nothing has come gets an empty block without a trigger,
    but only if the hammer has been let go. Of an arming that ends before that nothing is
    published, and there is no verdict.

    Parameters
    ----------
    publisher : Publisher
        Of the messages.
    sampling_rate : float
        [Hz]
    block_size : int
        Points per message, at most.
    record_points : int
        Of a whole record.
    """

    def __init__(
        self, publisher: Any, sampling_rate: float, block_size: int, record_points: int
    ) -> None:
        super().__init__(publisher, sampling_rate, block_size)
        self._record_points = record_points
        self._label = NOT_ARMED
        self._has_begun = False

    def begin(self, label: HitLabel) -> None:
        """Let what follows be the record of an arming."""
        self.restart()
        self._label, self._has_begun = label, False

    def end(self, *, is_awaited: bool) -> bool:
        """Close the record, if there is one or somebody waits for it; return whether it was."""
        if self._label is NOT_ARMED:
            return False
        has_begun = self._has_begun
        if has_begun:
            self.publish_end(max(self._record_points, self._next_sample))
        elif is_awaited:
            self.publish_end(0)
        self._label, self._has_begun = NOT_ARMED, False
        return has_begun or is_awaited

    def finish(self) -> None:
        """Say nothing: each record has said where it ends."""

    def publish(self, block: AcquiredBlock) -> None:
        """Publish a block of the record; its last one ends the arming."""
        self._has_begun = True
        super().publish(block)
        if block.last:
            self._label, self._has_begun = NOT_ARMED, False

    def make_message(self, block: AcquiredBlock) -> AccelerationBlock:
        """Return the message of a block."""
        return block_to_msg(
            Block(
                label=self._label,
                first_sample=block.first_sample,
                sampling_rate=self._sampling_rate,
                hammer=block.hammer,
                specimen=block.specimen,
                triggered=self._has_begun,
                last=block.last,
                stamp=self.find_stamp(block),
            )
        )
