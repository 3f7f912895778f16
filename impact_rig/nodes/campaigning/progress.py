"""Where a running campaign stands, and what its client hears of it."""

import math
import time
from dataclasses import dataclass, field
from typing import Any

from impact_rig_msgs.action import RunCampaign
from rclpy.action.server import ServerGoalHandle

from impact_rig.core.errors import RigError


class CancelledError(RigError):
    """The client asked the campaign to stop."""


@dataclass
class CampaignProgress:
    """Where a running campaign stands.

    Attributes
    ----------
    handle : ServerGoalHandle
        What the client asked for.
    samples : tuple of str
        Names, in their order.
    impacts : int
        Accepted hits wanted of each sample.
    attempts : int
        Rejected hits in a row before giving up.
    started : float
        By the monotonic clock [s].
    accepted : int
        Hits of all samples so far.
    feedback : RunCampaign.Feedback
        What the client heard last.
    """

    handle: ServerGoalHandle
    samples: tuple[str, ...]
    impacts: int
    attempts: int
    started: float = field(default_factory=time.monotonic)
    accepted: int = 0
    feedback: RunCampaign.Feedback = field(default_factory=RunCampaign.Feedback)

    def publish(self, **fields: Any) -> None:
        """Publish the feedback with some fields changed and the time left estimated anew."""
        for name, value in fields.items():
            setattr(self.feedback, name, value)
        elapsed = time.monotonic() - self.started
        missing = len(self.samples) * self.impacts - self.accepted
        self.feedback.time_left = elapsed / self.accepted * missing if self.accepted else math.nan
        self.handle.publish_feedback(self.feedback)

    def delay(self, pause: float) -> None:
        """Leave a pause [s] out of the speed that the time left is estimated by."""
        self.started += pause

    @property
    def is_cancelled(self) -> bool:
        """Whether the client has asked the campaign to stop."""
        return bool(self.handle.is_cancel_requested)

    def check_cancel(self) -> None:
        """Raise `CancelledError` if the client asked for it."""
        if self.is_cancelled:
            raise CancelledError("cancelled by the operator")
