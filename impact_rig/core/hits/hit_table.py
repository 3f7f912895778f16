"""The verdicts of one sample's hits, without their traces, in little memory."""

from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Rejection
from impact_rig.core.hits.selection import QUANTITIES
from impact_rig.core.signals.record import FloatArray, HitLabel

LABELS = ("record", "impact", "attempt")
FIGURES = (
    "impact_time",
    "contact_time",
    "half_amplitude_width",
    "width_ratio",
    "hammer_peak",
    "specimen_peak",
)
COLUMNS = np.dtype(
    [("fate", np.int8)]
    + [(name, np.int64) for name in (*LABELS, "stamp")]
    + [(name, np.float64) for name in FIGURES]
)
"""What is kept of every hit, by the names of `HitLabel` and `JudgedHit`: 81 bytes."""
BLOCK_ROWS = 128
"""Rows of a block [-], our choice: 10 kB. Blocks stay where they are, however many there are: a
table that moves as it grows leaves holes in the memory, nearly as large as itself."""


class Fate(IntEnum):
    """What has become of a hit."""

    REJECTED = 0
    """By its verdict, or left out by hand."""
    BY_HAND = 1
    """In the mean by hand."""
    OPEN = 2
    """Accepted; its fellows may still leave it out."""
    SETTLED = 3
    """In the mean for good."""
    OUTLIER = 4
    """Left out for good: an outlier."""
    SURPLUS = 5
    """Left out for good: others are more consistent."""


class HitTable:
    """Verdicts by row, in the order of arrival.

    Parameters
    ----------
    sample : str
        That all hits are of.
    """

    def __init__(self, sample: str) -> None:
        self._sample = sample
        self._blocks: list[NDArray[np.void]] = []
        self._count = 0
        # Most hits have nothing against them.
        self._rejections: dict[int, tuple[Rejection, ...]] = {}
        self._overruled: dict[int, tuple[Rejection, ...]] = {}

    def __len__(self) -> int:
        """Return the number of hits."""
        return self._count

    def __getitem__(self, row: int) -> JudgedHit:
        """Return a hit with its verdict, without its traces."""
        values = self._find_row(row)
        figures: dict[str, Any] = {name: float(values[name]) for name in FIGURES}
        return JudgedHit(
            label=self._make_label(values),
            rejections=self._rejections.get(row, ()),
            stamp=int(values["stamp"]),
            overruled=self._overruled.get(row, ()),
            **figures,
        )

    @property
    def labels(self) -> Iterator[HitLabel]:
        """Of all hits."""
        return (self._make_label(self._find_row(row)) for row in range(self._count))

    @property
    def overruled(self) -> Iterator[int]:
        """Rows of the hits of which a person has set reasons aside."""
        return iter(self._overruled)

    def read_fate(self, row: int) -> Fate:
        """Return what has become of one hit."""
        return Fate(int(self._find_row(row)["fate"]))

    def have_fates(self, *fates: Fate) -> NDArray[np.bool_]:
        """Return which hits have one of these, shape (hits,)."""
        return np.isin(self._read_column("fate"), fates)

    def append(self, hit: JudgedHit, fate: Fate) -> int:
        """Add a hit; return its row."""
        row = self._count
        if row == BLOCK_ROWS * len(self._blocks):
            self._blocks.append(np.zeros(BLOCK_ROWS, COLUMNS))
        self._count += 1
        values = self._find_row(row)
        for name in LABELS:
            values[name] = getattr(hit.label, name)
        for name in ("stamp", *FIGURES):
            values[name] = getattr(hit, name)
        if hit.overruled:
            self._overruled[row] = hit.overruled
        self.settle(row, fate, hit.rejections)
        return row

    def settle(self, row: int, fate: Fate, rejections: tuple[Rejection, ...] = ()) -> None:
        """Say what has become of a hit, and what is against it."""
        self._find_row(row)["fate"] = fate
        if rejections:
            self._rejections[row] = rejections

    def read(self, name: str) -> FloatArray:
        """Return one of `FIGURES` of all hits, shape (hits,)."""
        return self._read_column(name)

    def read_figures(self) -> FloatArray:
        """Return what hits are compared by, shape (hits, quantities)."""
        return np.stack([self.read(item.attribute) for item in QUANTITIES], axis=1)

    def _read_column(self, name: str) -> NDArray[Any]:
        if not self._blocks:
            return np.zeros(0, COLUMNS[name])
        return np.concatenate([block[name] for block in self._blocks])[: self._count]

    def _find_row(self, row: int) -> np.void:
        block, place = divmod(row, BLOCK_ROWS)
        values: np.void = self._blocks[block][place]
        return values

    def _make_label(self, values: np.void) -> HitLabel:
        return HitLabel(self._sample, *(int(values[name]) for name in LABELS))
