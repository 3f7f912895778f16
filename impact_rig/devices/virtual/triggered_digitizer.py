"""The virtual digitizer as a trigger drives it: one record for each arming, in its time."""

import threading
import time
from collections import deque

from impact_rig.core.signals.record import Block
from impact_rig.devices.acceleration_source import AcquiredBlock
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import VirtualHit

NANO = 1e-9


class TriggeredDigitizer:
    """Holds the record of a hit back until the hammer has struck.

    `lay` may come from another thread than the others.

    Parameters
    ----------
    block_size : int
        Points per block.
    """

    def __init__(self, block_size: int) -> None:
        self._block_size = block_size
        self._changed = threading.Condition()
        self._is_armed = False
        self._blocks: deque[Block] = deque()
        self._due = 0.0

    def arm(self) -> None:
        """Wait for one hit."""
        with self._changed:
            self._blocks.clear()
            self._is_armed = True

    def disarm(self) -> None:
        """Forget the hit."""
        with self._changed:
            self._blocks.clear()
            self._is_armed = False

    def lay(self, hit: VirtualHit, contact: float) -> None:
        """Let a hit trigger at a time of the monotonic clock [s]; unless its trigger is missed."""
        if Fault.MISSED_TRIGGER in hit.faults:
            return
        stamp = time.time_ns() + round((contact - time.monotonic()) / NANO)
        blocks = hit.split(self._block_size, stamp)
        with self._changed:
            if not self._is_armed:
                return
            self._is_armed = False
            self._blocks.extend(blocks)
            self._due = contact
            self._changed.notify()

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block of the record; None: it has not come within so many seconds."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                now = time.monotonic()
                if self._blocks and now >= self._due:
                    return _acquire(self._blocks.popleft())
                until = min(deadline, self._due) if self._blocks else deadline
                if now >= until:
                    return None
                self._changed.wait(until - now)


def _acquire(block: Block) -> AcquiredBlock:
    return AcquiredBlock(
        first_sample=block.first_sample,
        hammer=block.hammer,
        specimen=block.specimen,
        last=block.last,
        stamp=block.stamp,
    )
