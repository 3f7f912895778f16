"""What a part of the bench is, and what it is given to work with."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from impact_rig.bench.figures import Figure
from impact_rig.bench.recordings import Campaigns


@dataclass(frozen=True)
class Extent:
    """How much is measured: by default little, so that all parts together take five minutes.

    Attributes
    ----------
    demos : int
        Campaigns of the paper, each of 120 hits.
    seconds : float
        Of streaming at the highest rate [s].
    hits : int
        After which the memory of the nodes is looked at again.
    kills : int
        Processes, or whole rigs, that are killed.
    mutations : int
        Damaged recordings that are read.
    repeats : int
        Measurements of each figure that is a time.
    seed : int
        Of what is drawn at random.
    """

    demos: int = 2
    seconds: float = 20.0
    hits: int = 10_000
    kills: int = 2
    mutations: int = 60
    repeats: int = 7
    seed: int = 1


FULL = Extent(demos=5, seconds=60.0, hits=10_000, kills=50, mutations=2000)
"""What every goal asks for, or more: a quarter of an hour."""


@dataclass(frozen=True)
class Bench:
    """What a part works with.

    Attributes
    ----------
    folder : Path
        Empty; it is removed afterwards.
    extent : Extent
        How much is measured.
    campaigns : Campaigns
        To measure with; the same for all parts.
    report : callable
        Takes done and all, of whatever the part counts.
    """

    folder: Path
    extent: Extent
    campaigns: Campaigns
    report: Callable[[int, int], None]


@dataclass(frozen=True)
class Part:
    """One part of the bench.

    Attributes
    ----------
    name : str
        By which it is asked for.
    title : str
        What it measures, in one line.
    measure : callable
        Does it; raises `RigError` where it cannot be done.
    seconds : float
        That this takes on two cores, at the extent of `Extent()` [s].
    """

    name: str
    title: str
    measure: Callable[[Bench], tuple[Figure, ...]]
    seconds: float
