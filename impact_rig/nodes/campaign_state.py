"""A campaign that is under way: where it may go, its state, and what ends or holds it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignState, Impact
from impact_rig_msgs.msg import RigSetup as RigSetupMessage
from rclpy.action.server import ServerGoalHandle

from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.core.given.setup import Sample
from impact_rig.nodes.acts import NumberedState
from impact_rig.recordings.fields import NO_ID
from impact_rig.recordings.messages import setup_from_msg
from impact_rig.status.states import Step, Task

TRANSITIONS: Mapping[Step, tuple[Step, ...]] = {
    Step.JOINING: (Step.COUNTING, Step.PAUSED),
    Step.COUNTING: (
        Step.STRIKING,
        Step.WAITING_FOR_SAMPLE,
        Step.WAITING_FOR_HAMMER,
        Step.PAUSED,
        Step.COMPLETE,
    ),
    Step.WAITING_FOR_SAMPLE: (Step.COUNTING,),
    Step.PAUSED: (Step.JOINING,),
    Step.WAITING_FOR_HAMMER: (Step.COUNTING, Step.PAUSED),
    Step.STRIKING: (Step.COUNTING, Step.DISARMING),
    Step.DISARMING: (Step.JOINING,),
    Step.COMPLETE: (),
    Step.ENDED: (),
}
"""From which state a campaign goes where. A fault in a strike leads to DISARMING, any other to
PAUSED, and both lead back to the top; ENDED, with a reason, is possible in every state."""


@dataclass
class Campaign:
    """A campaign that is under way, with its state."""

    handle: ServerGoalHandle
    setup: RigSetupMessage  # with id and plan: enough to go on with the campaign
    told: NumberedState  # publishes it
    state: CampaignState = field(default_factory=CampaignState)
    stream_id: bytes = NO_ID
    recording: str = ""
    has_joined: bool = False  # every node took part once
    # Until when a person's word that the hammer may go counts [s], by the monotonic clock. That of
    # the start counts until every node has joined.
    arms_until: float = math.inf
    seen: int = 0  # number of the hammer's state at that word
    hit: dict[str, Any] = field(default_factory=dict)  # the next one's label
    newest_record: int = 0
    awaited: int = 0  # record of the newest release, which gets a verdict
    verdict: Impact = field(default_factory=Impact)
    failures: int = 0  # strikes in a row without an accepted hit [-]
    failure: str = ""  # of the last of them
    blind: int = 0  # of them the last ones in a row that showed nothing [-]
    stands_since: float = math.inf  # no hit since [s], by the monotonic clock
    stumbled_at: float = math.inf  # when the newest strike failed [s], by the same; inf: not
    is_announced: bool = False  # who listens knows its id, or could not be asked
    held_for: str = ""  # why it stands until a person lets it go on; empty: it does not
    is_superseded: bool = False  # another client goes on with it

    @cached_property
    def find_sample(self) -> Callable[[str], Sample]:
        """Finds a sample by its name."""
        return setup_from_msg(self.setup).samples.find

    def change(self, **fields: Any) -> None:
        """Change fields of the state, which are published with what follows from them."""
        for name, value in fields.items():
            setattr(self.state, name, value)

    def publish(self, **fields: Any) -> None:
        """Publish the state with some fields changed."""
        self.change(**fields)
        told = {name: getattr(self.state, name) for name in FIELDS}
        self.state.number = self.told.count(told)
        if self.is_announced:
            self.told.publish(**told)
        self.handle.publish_feedback(RunCampaign.Feedback(campaign=self.state))

    @property
    def is_held(self) -> bool:
        """Whether it stands until a person lets it go on."""
        return bool(self.held_for)

    @property
    def is_to_end(self) -> bool:
        """Whether nothing is waited for any more."""
        return self.handle.is_cancel_requested or self.is_superseded


FIELDS = [
    name
    for name in CampaignState.get_fields_and_field_types()
    if name not in ("header", "campaign_id", "number")
]
"""Fields of the state that differ from message to message."""


class ArmingError(DeviceError):
    """The campaign pauses until a person has armed the hammer."""


class HeldError(DeviceError):
    """The campaign pauses because a person wants it."""


class EndError(RigError):
    """The campaign ends here, with a reason."""


TASKS: Mapping[Step, Task] = {
    Step.WAITING_FOR_SAMPLE: Task.MOUNT,
    Step.WAITING_FOR_HAMMER: Task.PUT_BACK,
}
"""Task of a person in a state."""
TASKS_IN_PAUSE: Mapping[type[DeviceError], Task] = {
    ArmingError: Task.ARM,
    HeldError: Task.RESUME,
}
"""Task of a person in a pause, by its cause."""


def tell(fields: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what a person is told by a campaign's state: not that it looks if it can go on."""
    state = fields.get("state", Step.ENDED)
    is_end = state in (Step.COMPLETE, Step.ENDED)
    names = ("task", "message", "sample", "mounted")
    return (is_end or state == Step.STRIKING, is_end, *(fields.get(name) for name in names))
