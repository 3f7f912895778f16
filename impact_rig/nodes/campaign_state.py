"""What a campaign is doing, and what may follow: the states, their table, and its facts."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Any

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import Impact
from impact_rig_msgs.msg import RigSetup as RigSetupMessage
from rclpy.action.server import ServerGoalHandle

from impact_rig.core.setup import Sample
from impact_rig.recordings.messages import setup_from_msg


class State(IntEnum):
    """What a campaign does, numbered as in the feedback of the action `RunCampaign`."""

    JOINING = 0
    COUNTING = 1
    WAITING_FOR_SAMPLE = 2
    PAUSED = 3
    WAITING_FOR_HAMMER = 4
    STRIKING = 5
    DISARMING = 6
    COMPLETE = 7


TRANSITIONS: Mapping[State, tuple[State, ...]] = {
    State.JOINING: (State.COUNTING, State.PAUSED),
    State.COUNTING: (
        State.STRIKING,
        State.WAITING_FOR_SAMPLE,
        State.WAITING_FOR_HAMMER,
        State.PAUSED,
        State.DISARMING,
        State.COMPLETE,
    ),
    State.WAITING_FOR_SAMPLE: (State.COUNTING,),
    State.PAUSED: (State.JOINING,),
    State.WAITING_FOR_HAMMER: (State.COUNTING, State.DISARMING),
    State.STRIKING: (State.COUNTING, State.DISARMING),
    State.DISARMING: (State.JOINING,),
    State.COMPLETE: (),
}
"""From which state a campaign goes where. A fault, whatever it is, leads to DISARMING and back to
the top; an end with a reason is possible in every state."""


@dataclass
class Campaign:
    """A campaign that is under way, with its feedback."""

    handle: ServerGoalHandle
    setup: RigSetupMessage  # with id and plan: enough to go on with the campaign
    feedback: RunCampaign.Feedback = field(default_factory=RunCampaign.Feedback)
    stream_id: bytes = bytes(16)
    recording: str = ""
    has_armed: bool = False
    mounted: str = ""
    hit: dict[str, Any] = field(default_factory=dict)  # the next one's label
    newest_record: int = 0
    verdict: Impact = field(default_factory=Impact)
    failures: int = 0  # strikes in a row without an accepted hit [-]
    failure: str = ""  # of the last of them
    stands_since: float = math.inf  # no hit since [s], by the monotonic clock
    started: float = field(default_factory=time.monotonic)
    accepted_before: int = -1  # accepted hits at the first count [-]

    @cached_property
    def find_sample(self) -> Callable[[str], Sample]:
        """Finds a sample by its name."""
        return setup_from_msg(self.setup).samples.find

    def publish(self, **fields: Any) -> None:
        """Publish the feedback with some fields changed."""
        for name, value in fields.items():
            setattr(self.feedback, name, value)
        self.handle.publish_feedback(self.feedback)

    @property
    def is_cancelled(self) -> bool:
        """Whether the client has cancelled the campaign."""
        return bool(self.handle.is_cancel_requested)

    def estimate_time_left(self, accepted: int) -> float:
        """Return how long the rest takes at the speed so far [s]; NaN: not known."""
        if self.accepted_before < 0:
            self.accepted_before = accepted
        struck = accepted - self.accepted_before
        missing = len(self.setup.plan.samples) * self.setup.plan.impacts - accepted
        return (time.monotonic() - self.started) / struck * missing if struck else math.nan
