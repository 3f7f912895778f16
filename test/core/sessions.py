"""A session of three samples, and hits to strike it with."""

from collections.abc import Callable

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet

SETUP = RigSetup(
    SampleSet((Sample("alike", 0.097), Sample("heavy", 0.297), Sample("third", 0.2)), "alike"),
    hammer_mass=0.1,
    impact_speed=0.08,
)
Strike = Callable[..., tuple[JudgedHit, ...]]


def strike_series(
    strike: Strike, session: Session, heights: list[float], sample: str = "alike", first: int = 1
) -> list[JudgedHit]:
    return [
        hit
        for record, height in enumerate(heights, start=first)
        for hit in strike(session, sample, record, height=height, place=500 + record % 7)
    ]
