"""What the counts of one channel stand for."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.signals.record import ChannelBlock
from impact_rig.devices.streaming.sample_store import CountArray


@dataclass(frozen=True)
class CountScale:
    """Of one channel.

    Attributes
    ----------
    scale, offset : float
        Acceleration of one count, and at count 0 [m/s^2].
    full_scale : float
        Largest acceleration that the channel can show, either sign [m/s^2].
    lowest, highest : int
        Counts from which on the channel is overloaded.
    """

    scale: float
    full_scale: float
    lowest: int
    highest: int
    offset: float = 0.0

    def make_block(self, counts: CountArray) -> ChannelBlock:
        """Return counts, shape (n,), as a calibrated block."""
        return ChannelBlock(
            output=counts,
            scale=self.scale,
            offset=self.offset,
            full_scale=self.full_scale,
            overloaded=bool(
                counts.size and (counts.max() >= self.highest or counts.min() <= self.lowest)
            ),
        )


NOT_MEASURED = ChannelBlock(np.empty(0, np.int32), 1.0, 0.0, 0.0)
"""Of a sample without a channel."""
