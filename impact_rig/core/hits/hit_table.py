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
FIRST_SIZE = 16
"""Rows that are there at first [-]; they double as they are used up."""


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
        self._rows = np.zeros(FIRST_SIZE, COLUMNS)
        self._count = 0
        # Most hits have nothing against them.
        self._rejections: dict[int, tuple[Rejection, ...]] = {}
        self._overruled: dict[int, tuple[Rejection, ...]] = {}

    def __len__(self) -> int:
        """Return the number of hits."""
        return self._count

    def __getitem__(self, row: int) -> JudgedHit:
        """Return a hit with its verdict, without its traces."""
        figures: dict[str, Any] = {name: float(self._rows[name][row]) for name in FIGURES}
        return JudgedHit(
            label=self._make_label(row),
            rejections=self._rejections.get(row, ()),
            stamp=int(self._rows["stamp"][row]),
            overruled=self._overruled.get(row, ()),
            **figures,
        )

    @property
    def labels(self) -> Iterator[HitLabel]:
        """Of all hits."""
        return map(self._make_label, range(self._count))

    @property
    def fates(self) -> NDArray[np.int8]:
        """Of all hits, shape (hits,)."""
        return self._rows["fate"][: self._count]

    def append(self, hit: JudgedHit, fate: Fate) -> int:
        """Add a hit; return its row."""
        row = self._count
        if row == len(self._rows):
            rows, self._rows = self._rows, np.zeros(2 * row, COLUMNS)
            self._rows[:row] = rows
        self._count += 1
        values = self._rows[row]
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
        self._rows["fate"][row] = fate
        if rejections:
            self._rejections[row] = rejections

    def read(self, name: str) -> FloatArray:
        """Return one of `FIGURES` of all hits, shape (hits,)."""
        return self._rows[name][: self._count]

    def read_figures(self, rows: NDArray[np.intp]) -> FloatArray:
        """Return what hits are compared by, shape (rows, quantities)."""
        return np.stack([self.read(item.attribute)[rows] for item in QUANTITIES], axis=1)

    def _make_label(self, row: int) -> HitLabel:
        return HitLabel(self._sample, *(int(self._rows[name][row]) for name in LABELS))
