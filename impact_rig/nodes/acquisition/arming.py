"""One arming of the accelerometers, from the request to its end."""

import math
import time
from dataclasses import dataclass, replace

from impact_rig.core.signals.record import HitLabel


@dataclass(eq=False)
class Arming:
    """What executor and source thread know of an arming; each field is written by one of them.

    Attributes
    ----------
    label : HitLabel
        Which hit it is for.
    is_armed : bool
        The source has said so (executor).
    is_over : bool
        It has ended, however (executor).
    is_released : bool
        The hammer has been let go (executor).
    is_read : bool
        Its record is complete, or nothing came in time, which is about to be told (source thread).
    latest_contact : float
        When the hit must have come, by the monotonic clock [s]; infinite: it waits for ever
        (executor).
    """

    label: HitLabel
    is_armed: bool = False
    is_over: bool = False
    is_released: bool = False
    is_read: bool = False
    latest_contact: float = math.inf

    def release(self, longest_wait: float) -> None:
        """Note that the hammer has been let go; the hit comes within so many seconds, or never."""
        # In this order: who sees the deadline knows of the release.
        self.is_released = True
        self.latest_contact = time.monotonic() + longest_wait

    def is_for(self, label: HitLabel) -> bool:
        """Return whether the same was asked for, and may still be answered with this arming."""
        is_same = self.label == replace(label, record=self.label.record)
        return is_same and not self.is_released and not self.is_over
