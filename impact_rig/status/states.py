"""State of each node of a rig: a record for each message, with its names and numbers.

No physics is loaded.
"""

import math
from dataclasses import dataclass, field
from enum import IntEnum

from impact_rig.core.given.quantity import INTERNAL, NOT_NEGATIVE


class Step(IntEnum):
    """Steps of a campaign, numbered as in the message `CampaignState`."""

    JOINING = 0
    COUNTING = 1
    WAITING_FOR_SAMPLE = 2
    PAUSED = 3
    WAITING_FOR_HAMMER = 4
    STRIKING = 5
    DISARMING = 6
    COMPLETE = 7
    ENDED = 8


class Task(IntEnum):
    """Tasks of a person, numbered as in the message `CampaignState`."""

    NOTHING = 0
    MOUNT = 1
    PUT_BACK = 2
    LET_GO = 3
    ARM = 4
    RESUME = 5
    KEEP_AWAY = 6


@dataclass(frozen=True)
class SampleProgress:
    """Progress of one sample's hits."""

    sample: str
    accepted: int = 0
    rejected: int = 0


@dataclass(frozen=True)
class CampaignStatus:
    """State of a campaign."""

    state: Step = Step.ENDED
    message: str = ""  # what is lost, awaited, or ended it; empty while it runs
    task: Task = Task.NOTHING
    impacts: int = 0  # wanted hits of each sample
    counts: tuple[SampleProgress, ...] = ()  # in the order of the plan
    sample: str = ""  # under test
    mounted: str = ""  # last; empty: none yet
    # Of the task [s since the epoch]; NaN: there is no limit.
    until: float = field(default=math.nan, metadata=INTERNAL)
    number: int = 0  # grows with each change of what a person is told
    stamp: int = field(default=0, metadata=INTERNAL)  # [ns], by the campaign node's clock

    @property
    def is_running(self) -> bool:
        """Whether a campaign is under way."""
        return self.state not in (Step.COMPLETE, Step.ENDED)

    @property
    def is_paused(self) -> bool:
        """Whether something, or a person, keeps it from the next hit."""
        return self.state in (Step.PAUSED, Step.DISARMING)

    @property
    def is_looking(self) -> bool:
        """Whether it looks if it can go on, in a pause too."""
        return self.state in (Step.JOINING, Step.COUNTING)

    @property
    def progress(self) -> SampleProgress:
        """Progress of the sample under test."""
        none = SampleProgress(self.sample)
        return next((item for item in self.counts if item.sample == self.sample), none)


OPERATOR = "operator"
"""What holds a hammer that is released by hand, as the driver `manual` says."""


class HammerPlace(IntEnum):
    """Where the hammer is, numbered as in the message `HammerState`."""

    HELD = 0
    SWINGING = 1
    FAULT = 2
    AWAY = 3


class Disarming(IntEnum):
    """Causes of a disarming, numbered as in the message `HammerState`."""

    CAMPAIGN = 0
    LOSS = 1
    EMERGENCY_STOP = 2
    PERSON = 3


@dataclass(frozen=True)
class HammerStatus:
    """State of the hammer."""

    state: HammerPlace = HammerPlace.HELD
    armed: bool = False  # the operator's enable is given
    disarmed_by: Disarming = Disarming.CAMPAIGN  # also while it is given, and before it ever was
    message: str = ""
    holder: str = ""  # what holds it
    hammerless: bool = False  # no hammer hangs in it: a release strikes nothing
    sets_angle: bool = False  # the holder does, when it is asked to
    stopped_by: str = ""  # who called the stop that lasts, and from where
    lead_time: float = field(default=0.0, metadata=NOT_NEGATIVE)  # notice before it goes [s]
    number: int = 0  # grows with each change of what a person is told
    # Of the last change, and of the stop that lasts [s since the epoch]; NaN: there is none.
    since: float = field(default=math.nan, metadata=INTERNAL)
    stopped_at: float = field(default=math.nan, metadata=INTERNAL)
    stamp: int = field(default=0, metadata=INTERNAL)  # [ns], by the hammer node's clock

    @property
    def is_stopped(self) -> bool:
        """Whether an emergency stop lasts."""
        return self.disarmed_by is Disarming.EMERGENCY_STOP

    @property
    def needs_person(self) -> bool:
        """Whether only a person arms it: a person has stopped or disarmed it."""
        return self.disarmed_by in (Disarming.EMERGENCY_STOP, Disarming.PERSON)

    @property
    def is_by_hand(self) -> bool:
        """Whether a person holds and releases it."""
        return self.holder == OPERATOR

    @property
    def is_away(self) -> bool:
        """Whether a person must put it back."""
        return self.state is HammerPlace.AWAY


NO_HAMMER = HammerStatus(HammerPlace.FAULT, message="no hammer has published its state")


class Phase(IntEnum):
    """Phases of the accelerometers, numbered as in the message `AcquisitionState`."""

    IDLE = 0
    ARMED = 1
    FAULT = 2


@dataclass(frozen=True)
class AcquisitionStatus:
    """State of the accelerometers."""

    state: Phase = Phase.IDLE
    record: int = 0  # of the newest arming; 0: none yet
    sample: str = ""  # that the arming is for
    message: str = ""
    source: str = ""  # what delivers the accelerations
    hammerless: bool = False  # no hammer strikes anything: hits are computed, or read


@dataclass(frozen=True)
class RecorderStatus:
    """State of the recorder."""

    recording: bool = False
    uri: str = ""  # path on the recorder's host
    messages_lost: int = 0
    message: str = ""


class Level(IntEnum):
    """Health of a node; the numbers are those of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARNING = 1
    ERROR = 2
    STALE = 3

    @classmethod
    def _missing_(cls, _: object) -> "Level":
        """Count any other number as an error."""
        return cls.ERROR


@dataclass(frozen=True)
class NodeHealth:
    """The newest diagnostics of one node."""

    name: str
    level: Level = Level.OK
    message: str = ""
    values: tuple[tuple[str, str], ...] = ()  # names and texts of its figures
