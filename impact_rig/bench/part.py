"""What a part of the bench is, and what it is given to work with."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from impact_rig.bench.figures import Figure

DEFAULT_SECONDS = 60.0
"""Of continuous recording [s]: as the goal has it."""
DEFAULT_KILLS = 50
"""Processes killed [-]: as the goal has it."""
DEFAULT_MUTATIONS = 2000
"""Damaged recordings [-]: as the goal has it."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    seconds : float
        Of continuous recording [s].
    kills : int
        Processes, or whole rigs, that are killed.
    mutations : int
        Damaged recordings that are read.
    repeats : int
        Measurements of each figure that is a time.
    seed : int
        Of what is drawn at random.
    """

    seconds: float = DEFAULT_SECONDS
    kills: int = DEFAULT_KILLS
    mutations: int = DEFAULT_MUTATIONS
    repeats: int = 7
    seed: int = 1


@dataclass(frozen=True)
class Bench:
    """What a part works with.

    Attributes
    ----------
    folder : Path
        Empty; it is removed afterwards.
    extent : Extent
        How much is measured.
    report : callable
        Takes done and all, of whatever the part counts.
    """

    folder: Path
    extent: Extent
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
    """

    name: str
    title: str
    measure: Callable[[Bench], tuple[Figure, ...]]
