"""What a rig says of itself, kept apart from ROS and from any display.

Displays read it: the page, the campaign in a terminal, and the view. Whoever listens to the rig
puts in what has come.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from statistics import fmean, stdev

from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import RigSetup
from impact_rig.results.campaign import HitResults


class Step(IntEnum):
    """What a campaign does, numbered as in its message."""

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
    """What is asked of a person, numbered as in the campaign's message."""

    NOTHING = 0
    MOUNT = 1
    PUT_BACK = 2
    LET_GO = 3
    ARM = 4
    RESUME = 5


@dataclass(frozen=True)
class SampleProgress:
    """How far the hits of one sample have come."""

    name: str
    accepted: int
    rejected: int


@dataclass(frozen=True)
class CampaignStatus:
    """What a campaign says of itself."""

    step: Step = Step.ENDED
    message: str = ""  # what is lost, awaited, or ended it; empty while it runs
    task: Task = Task.NOTHING
    until: float = math.nan  # of the task [s since the epoch]; NaN: there is no limit
    impacts: int = 0  # wanted hits of each sample
    samples: tuple[SampleProgress, ...] = ()  # in the order of the plan
    sample: str = ""  # under test
    mounted: str = ""  # last; empty: none yet

    @property
    def is_running(self) -> bool:
        """Whether a campaign is under way."""
        return self.step not in (Step.COMPLETE, Step.ENDED)

    @property
    def progress(self) -> SampleProgress:
        """Of the sample under test."""
        none = SampleProgress(self.sample, 0, 0)
        return next((item for item in self.samples if item.name == self.sample), none)


@dataclass(frozen=True)
class HammerStatus:
    """What the hammer says of itself."""

    place: str = "unknown"  # held, swinging, away, fault
    message: str = "no hammer has published its state"
    is_armed: bool = False
    is_stopped: bool = False  # by an emergency stop, until it is reset
    is_away: bool = False  # a person must put it back
    since: float = math.nan  # of the last change [s since the epoch]


@dataclass(frozen=True)
class RecorderStatus:
    """What the recorder says of itself."""

    is_recording: bool = False
    path: str = ""
    lost: int = 0  # messages
    message: str = ""


@dataclass
class RigStatus:
    """Everything that a rig has said of itself, the newest of each.

    A set-up of another campaign begins afresh.
    """

    setup: RigSetup | None = None
    campaign: CampaignStatus = field(default_factory=CampaignStatus)
    hammer: HammerStatus = field(default_factory=HammerStatus)
    recorder: RecorderStatus = field(default_factory=RecorderStatus)
    is_simulated: bool | None = None  # None: no accelerometers have reported
    source: str = ""  # what delivers the accelerations
    full_scale: float = 0.0  # of the hammer's channel [m/s^2]; 0: not known
    hits: dict[int, HitResults] = field(default_factory=dict)  # by record, in order of arrival
    estimates: dict[str, SampleEstimate] = field(default_factory=dict)
    overruled: dict[int, str] = field(default_factory=dict)  # by whom and why, by record
    nodes: Mapping[str, str] = field(default_factory=dict)  # what is wrong with each; "": nothing

    def begin(self, setup: RigSetup) -> None:
        """Begin afresh with the set-up of another campaign."""
        self.setup = setup
        self.hits, self.estimates, self.overruled = {}, {}, {}

    def add_hit(self, hit: HitResults) -> None:
        """Keep a hit with its newest verdict."""
        self.hits[hit.record] = hit

    @property
    def last_hit(self) -> HitResults | None:
        """The hit that was struck last."""
        return self.hits[max(self.hits)] if self.hits else None

    def compute_deviation(self, hit: HitResults) -> float:
        """Return how far the contact time lies from the others accepted, in their scatter [-].

        NaN: there are fewer than three others, or the hit has none.
        """
        others = [
            item.contact_time
            for item in self.hits.values()
            if item.sample == hit.sample and item.accepted and item.record != hit.record
        ]
        if len(others) < 3 or (scatter := stdev(others)) == 0.0:  # noqa: PLR2004 - see above
            return math.nan
        return (hit.contact_time - fmean(others)) / scatter

    def list_samples(self) -> tuple[SampleProgress, ...]:
        """Return the samples of the campaign, or before the first those of the set-up."""
        if self.campaign.samples or self.setup is None:
            return self.campaign.samples
        return tuple(SampleProgress(name, 0, 0) for name in self.setup.samples.names)

    def list_levels(self) -> tuple[tuple[str, float], ...]:
        """Return levels of the hammer's channel, by name [m/s^2]; empty: they are not known."""
        if self.setup is None or not self.full_scale:
            return ()
        analysis = self.setup.analysis
        levels = (
            ("least peak", analysis.minimum_peak),
            ("largest peak", analysis.maximum_peak),
        )
        return tuple((name, part * self.full_scale) for name, part in levels)
