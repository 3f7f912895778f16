"""Truth of the virtual rig's hits, and its hits without nodes."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Self

from impact_rig.core.given.errors import check_count
from impact_rig.core.given.records import Block, HitLabel, Truth
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.overrules import NO_OVERRULES
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig

BLOCK_POINTS = 1000
"""Points of a block: a fault loses one of several blocks."""


def make_truth(hit: VirtualHit) -> Truth:
    """Return the truth of a hit."""
    model, contact = hit.model, hit.contact
    return Truth(
        model.contact_time,
        model.peak_force,
        float(model.impact_speed),
        stiffness=model.specimen.stiffness if contact is None else math.nan,
        damping_coefficient=model.specimen.damping_coefficient if contact is None else math.nan,
        exponent=math.nan if contact is None else contact.exponent,
        restitution=math.nan if contact is None else contact.restitution,
        faults=tuple(fault.value for fault in hit.faults),
    )


class VirtualCampaign:
    """Samples struck one after the other, each so many times; a source of hits for `analyze`.

    Raises
    ------
    ParameterError
        If there is no such sample, or `impacts` is no number of hits.
    """

    path, size, has_scale = Path("virtual rig"), 0, True
    hammer_unit: str | None = None
    warnings: tuple[str, ...] = ()
    overrules = NO_OVERRULES

    def __init__(
        self, rig: VirtualRig, setup: RigSetup, samples: Sequence[str], impacts: int
    ) -> None:
        check_count("impacts", impacts, 1)
        samples = [setup.samples.find(name).name for name in dict.fromkeys(samples)]
        labels = [
            HitLabel(name, place * impacts + impact, impact)
            for place, name in enumerate(samples)
            for impact in range(1, impacts + 1)
        ]
        hits = {label: rig.strike(label) for label in labels}
        self.setup = setup
        self.truths = {label: make_truth(hit) for label, hit in hits.items()}
        self.verdicts: dict[HitLabel, bool] = {}
        self._blocks = [block for hit in hits.values() for block in hit.split(BLOCK_POINTS, 0)]

    def events(self, _report: Any = None) -> Self:
        """Begin a reading: nothing has to be kept of it."""
        return self

    def __iter__(self) -> Iterator[RigSetup | Block]:
        """Yield the set-up and the hits."""
        yield self.setup
        yield from self._blocks
