"""State of a rig, kept apart from ROS and from any display.

A node or client that listens to the rig fills it; the page, the campaign in a terminal and the
view show it.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from statistics import fmean, stdev
from typing import TYPE_CHECKING

from impact_rig.status.levels import InputLevel, InputLevels
from impact_rig.status.states import (
    NO_HAMMER,
    AcquisitionStatus,
    CampaignStatus,
    HammerStatus,
    Level,
    NodeHealth,
    RecorderStatus,
    SampleProgress,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from impact_rig.core.estimates.sample import SampleEstimate
    from impact_rig.core.given.setup import RigSetup
    from impact_rig.results.campaign import HitResults

MOST_NOTES = 20
"""How many notes are shown [-], the newest."""
PACE_HITS = 20
"""By how many hits the pace of a campaign is known [-], the newest."""
SILENCE = 5.0
"""How long a node that is not silent may take between two diagnostics [s]: five of its periods."""
STATE_SILENCE = 2.0
"""The same between two states of hammer or campaign, which come twice a second [s]."""
MOST_NODES = 64
"""How many nodes' diagnostics are kept [-], those that came last: anybody may publish some."""


@dataclass
class RigStatus:
    """Newest state of everything in a rig.

    A set-up of another campaign begins afresh.
    """

    namespace: str = "/"  # of the rig
    setup: RigSetup | None = None
    campaign: CampaignStatus = field(default_factory=CampaignStatus)
    hammer: HammerStatus = NO_HAMMER
    recorder: RecorderStatus = field(default_factory=RecorderStatus)
    acquisition: AcquisitionStatus | None = None  # None: no accelerometers have reported
    full_scales: tuple[float, ...] = ()  # of the channels [m/s^2]; 0, or none: not known
    levels: InputLevels = field(default_factory=InputLevels)
    # The newest that there were, with the largest peaks since the monitor began.
    held: tuple[InputLevel, ...] = ()
    notes: deque[str] = field(default_factory=lambda: deque(maxlen=MOST_NOTES))
    is_trial: bool = False  # the hits of the campaign do not count
    clock: Callable[[], float] = time.monotonic  # [s]
    # By `clock`: since when a stop from the page waits for the hammer's word; None: none waits.
    stop_asked_at: float | None = None
    hits: dict[int, HitResults] = field(default_factory=dict)  # by record, in order of arrival
    estimates: dict[str, SampleEstimate] = field(default_factory=dict)
    # Of the hammer in each hit [m/s], by record.
    speed_changes: dict[int, float] = field(default_factory=dict)
    # When the newest hits came, by `clock`.
    _struck: deque[float] = field(default_factory=lambda: deque(maxlen=PACE_HITS))
    _health: dict[str, tuple[NodeHealth, float]] = field(default_factory=dict)
    _back_at: float = -math.inf  # when a person last said so of the hammer, by `clock`
    _state_came: dict[str, float] = field(default_factory=dict)  # [s], by node

    def begin(self, setup: RigSetup | None, *, is_trial: bool = False) -> None:
        """Begin afresh with the set-up of another campaign."""
        self.setup, self.is_trial = setup, is_trial
        self.hits, self.estimates, self.speed_changes = {}, {}, {}
        self._struck.clear()

    def keep(
        self,
        status: CampaignStatus | HammerStatus | RecorderStatus | AcquisitionStatus | InputLevels,
    ) -> None:
        """Keep a node's newest state."""
        match status:
            case CampaignStatus():
                self.campaign, self._state_came["campaign"] = status, self.clock()
            case HammerStatus():
                if self.hammer.is_away and not status.is_away:
                    self._back_at = self.clock()
                self.hammer, self._state_came["hammer"] = status, self.clock()
            case RecorderStatus():
                self.recorder = status
            case AcquisitionStatus():
                self.acquisition = status
            case InputLevels():
                if status.channels:
                    before = self.held if self.levels.channels else status.channels
                    self.held = tuple(map(InputLevel.hold, status.channels, before))
                self.levels = status

    def add_hit(self, hit: HitResults) -> None:
        """Keep a hit with its newest verdict."""
        if hit.record not in self.hits:
            self._struck.append(self.clock())
        self.hits[hit.record] = hit

    def add_health(self, nodes: Iterable[NodeHealth]) -> bool:
        """Keep the diagnostics of the rig's nodes; return whether there are any."""
        prefix = self.namespace.rstrip("/") + "/"
        own = [
            replace(node, name=node.name.removeprefix(prefix))
            for node in nodes
            if node.name.startswith(prefix) and "/" not in node.name.removeprefix(prefix)
        ]
        for node in own:
            self._health.pop(node.name, None)
            self._health[node.name] = node, self.clock()
        while len(self._health) > MOST_NODES:
            del self._health[next(iter(self._health))]
        return bool(own)

    def list_silent(self) -> tuple[str, ...]:
        """Return the nodes that spoke and do not answer now, the one that matters most first."""
        now = self.clock()
        silent = {name for name, came in self._state_came.items() if now - came > STATE_SILENCE}
        silent |= {node.name for node in self.list_nodes() if node.level is Level.STALE}
        order = ("hammer", "campaign", "estimator", "recorder", "accelerometer")
        return tuple(name for name in order if name in silent)

    def list_nodes(self) -> tuple[NodeHealth, ...]:
        """Return the newest diagnostics, by the names of the nodes."""
        nodes = []
        for _, (node, came) in sorted(self._health.items()):
            silence = self.clock() - came
            message = f"silent for {silence:.0f} s; last: {node.message}"
            is_silent = silence >= SILENCE
            nodes.append(replace(node, level=Level.STALE, message=message) if is_silent else node)
        return tuple(nodes)

    @property
    def is_simulated(self) -> bool:
        """Whether no hammer strikes: hits are computed, and the holder swings nothing."""
        return bool(self.acquisition and self.acquisition.hammerless and self.hammer.hammerless)

    @property
    def full_scale(self) -> float:
        """Of the hammer's channel [m/s^2]; 0: not known."""
        return self.full_scales[0] if self.full_scales else 0.0

    @property
    def last_hit(self) -> HitResults | None:
        """The hit that was struck last."""
        return self.hits[max(self.hits)] if self.hits else None

    def compute_rest(self) -> float:
        """Return how long ago the last hit came [s]; infinite: none, or it is back since."""
        is_new = self._struck and self._struck[-1] >= self._back_at
        return self.clock() - self._struck[-1] if is_new else math.inf

    def compute_time_left(self) -> float:
        """Return how long the hits that are missing take at the pace so far [s]; NaN: unknown."""
        if len(self._struck) < 2 or not self.campaign.is_running:  # noqa: PLR2004 - one interval
            return math.nan
        pace = (self._struck[-1] - self._struck[0]) / (len(self._struck) - 1)
        wanted = self.campaign.impacts
        return pace * sum(max(0, wanted - item.accepted) for item in self.campaign.counts)

    def compute_deviation(self, hit: HitResults) -> float:
        """Return how far the contact time lies from the others accepted, in their scatter [-].

        NaN: there are fewer than three others, or the hit has none.
        """
        others = [
            item.contact_time
            for item in self.hits.values()
            if item.sample == hit.sample
            and item.accepted
            and item.record != hit.record
            and math.isfinite(item.contact_time)
        ]
        if len(others) < 3 or (scatter := stdev(others)) == 0.0:  # noqa: PLR2004 - see above
            return math.nan
        return (hit.contact_time - fmean(others)) / scatter

    def list_samples(self) -> tuple[SampleProgress, ...]:
        """Return the samples of the campaign, or before the first those of the set-up."""
        if self.campaign.counts or self.setup is None:
            return self.campaign.counts
        return tuple(SampleProgress(name) for name in self.setup.samples.names)

    def list_levels(self) -> tuple[tuple[str, float], ...]:
        """Return levels of the hammer's channel, by name [m/s^2]; empty: they are not known."""
        if self.setup is None or not self.full_scale:
            return ()
        analysis, whole = self.setup.analysis, self.full_scale
        least, largest = analysis.minimum_peak * whole, analysis.maximum_peak * whole
        levels = ("least peak", least), ("largest peak", largest)
        return levels if least else levels[1:]
