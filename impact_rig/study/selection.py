"""Hits with and without faults: every fault found for the right reason, no good hit lost."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.rig import (
    FaultPlan,
    ScheduledFault,
    VirtualRig,
    VirtualRigSettings,
)
from impact_rig.study.campaigns import strike

SERIES_HITS = 12
"""Hits of a series [-], our choice: ten good ones are left on the average, as in a campaign."""
FAULT_PROBABILITY = 0.2
"""Of one fault at a hit [-]."""
BLOCK_SIZE = 500
"""Points per block [-], our choice: a lost block must leave others."""
PLANTS = (Plant.PUBLISHED, Plant.DYNAMICS, Plant.CONTACT)
RIGHT_REASONS = {
    Fault.DOUBLE_HIT: Reason.DOUBLE_HIT,
    Fault.OVERLOAD: Reason.OVERLOAD,
    Fault.WEAK_HIT: Reason.WEAK,
    Fault.MISSED_TRIGGER: Reason.NO_TRIGGER,
    Fault.DEAD_CHANNEL: Reason.DEAD_CHANNEL,
    Fault.LOST_BLOCK: Reason.GAP,
}


@dataclass(frozen=True)
class SelectionCount:
    """What became of the simulated hits.

    Attributes
    ----------
    good, good_rejected : int
        Hits without a fault, and those of them that were left out.
    faulty, detected : mapping of str to int
        Hits by fault, and those of them that were rejected for the right reason.
    false_reasons : mapping of str to int
        Why good hits were left out.
    """

    good: int = 0
    good_rejected: int = 0
    faulty: Mapping[str, int] = field(default_factory=dict)
    detected: Mapping[str, int] = field(default_factory=dict)
    false_reasons: Mapping[str, int] = field(default_factory=dict)

    @property
    def hits(self) -> int:
        """All of them."""
        return self.good + sum(self.faulty.values())

    def __add__(self, other: "SelectionCount") -> "SelectionCount":
        """Return the counts of both."""
        return SelectionCount(
            self.good + other.good,
            self.good_rejected + other.good_rejected,
            _add_counts(self.faulty, other.faulty),
            _add_counts(self.detected, other.detected),
            _add_counts(self.false_reasons, other.false_reasons),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the fields as plain values, what the constructor takes."""
        return asdict(self)


def _add_counts(first: Mapping[str, int], second: Mapping[str, int]) -> dict[str, int]:
    return dict(sorted((Counter(first) + Counter(second)).items()))


def simulate_series(setup: RigSetup, entropy: tuple[int, ...], number: int) -> SelectionCount:
    """Strike one series of hits with faults among them and count the verdicts.

    Parameters
    ----------
    setup : RigSetup
        Its samples take turns, and after each round the plants.
    entropy : tuple of int
        Of the random numbers; the series' number is added.
    number : int
        Of the series.
    """
    names = setup.samples.names
    sample = names[number % len(names)]
    plant = PLANTS[number // len(names) % len(PLANTS)]
    generator = np.random.default_rng(np.random.SeedSequence((*entropy, number)))
    scheduled = _draw_faults(generator)
    rig = VirtualRig(
        setup,
        VirtualRigSettings(
            plant=plant,
            seed=int(generator.integers(2**63)),
            faults=FaultPlan(scheduled=scheduled),
        ),
    )
    session = Session(setup)
    for impact in range(1, SERIES_HITS + 1):
        label = HitLabel(sample, impact, impact)
        strike(rig, session, label, BLOCK_SIZE, rig.settings.digitizer.sampling_rate)
    # Estimates select among all hits once more, when all have come.
    return count_verdicts(scheduled, session.get_selection(sample).left_out)


def _draw_faults(generator: np.random.Generator) -> tuple[ScheduledFault, ...]:
    faults = tuple(Fault)
    return tuple(
        ScheduledFault(faults[int(generator.integers(len(faults)))], impact)
        for impact in range(1, SERIES_HITS + 1)
        if generator.random() < FAULT_PROBABILITY
    )


def count_verdicts(
    scheduled: tuple[ScheduledFault, ...], rejected: tuple[JudgedHit, ...]
) -> SelectionCount:
    """Count what became of the hits of one series, given its faults and the rejected hits."""
    reasons: dict[int, set[Reason]] = {impact: set() for impact in range(1, SERIES_HITS + 1)}
    for hit in rejected:
        reasons[hit.label.impact].update(item.reason for item in hit.rejections)
    faults = {item.impact: item.fault for item in scheduled}
    good = [found for impact, found in reasons.items() if impact not in faults]
    return SelectionCount(
        good=len(good),
        good_rejected=sum(map(bool, good)),
        faulty=Counter(fault.value for fault in faults.values()),
        detected=Counter(
            fault.value
            for impact, fault in faults.items()
            if RIGHT_REASONS[fault] in reasons[impact]
        ),
        false_reasons=Counter(reason.value for found in good for reason in found),
    )
