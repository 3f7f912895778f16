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
COLUMNS: dict[str, type] = {
    "fate": np.int8,
    **dict.fromkeys((*LABELS, "stamp"), np.int64),
    **dict.fromkeys(FIGURES, np.float64),
}
"""What is kept of every hit, by the names of `HitLabel` and `JudgedHit`: 81 bytes."""
FIRST_SIZE = 16
"""Rows that there is room for at first [-]."""
ROOM_GROWTH = 1 / 8
"""Room that is added when it is used up, part of what there is [-], our choice: memory that is not
used yet is memory too."""


class Fate(IntEnum):
    """What has become of a hit."""

    REJECTED = 0
    """By its verdict, or left out by hand; rows that are not used yet have it, too."""
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

    Columns are given as long as there is room for rows, so that their size, and that of whatever
    is made of them, seldom changes: numpy keeps some memory of every small size that it was ever
    asked for.

    Parameters
    ----------
    sample : str
        That all hits are of.
    """

    def __init__(self, sample: str) -> None:
        self._sample = sample
        self._room = FIRST_SIZE
        self._columns: dict[str, NDArray[Any]] = {
            name: np.zeros(FIRST_SIZE, kind) for name, kind in COLUMNS.items()
        }
        self._count = 0
        # Most hits have nothing against them.
        self._rejections: dict[int, tuple[Rejection, ...]] = {}
        self._overruled: dict[int, tuple[Rejection, ...]] = {}

    def __len__(self) -> int:
        """Return the number of hits."""
        return self._count

    def __getitem__(self, row: int) -> JudgedHit:
        """Return a hit with its verdict, without its traces."""
        figures: dict[str, Any] = {name: float(self._columns[name][row]) for name in FIGURES}
        return JudgedHit(
            label=self._make_label(row),
            rejections=self._rejections.get(row, ()),
            stamp=int(self._columns["stamp"][row]),
            overruled=self._overruled.get(row, ()),
            **figures,
        )

    @property
    def labels(self) -> Iterator[HitLabel]:
        """Of all hits."""
        return map(self._make_label, range(self._count))

    def read_fate(self, row: int) -> Fate:
        """Return what has become of one hit."""
        return Fate(int(self._columns["fate"][row]))

    def have_fates(self, *fates: Fate) -> NDArray[np.bool_]:
        """Return which rows are hits that have one of these, shape (room,)."""
        column = self._columns["fate"]
        found: NDArray[np.bool_] = column == fates[0]
        for fate in fates[1:]:
            found |= column == fate
        return found

    def find_rows(self, *fates: Fate) -> NDArray[np.intp]:
        """Return the rows of the hits that have one of these."""
        return np.flatnonzero(self.have_fates(*fates))

    def append(self, hit: JudgedHit, fate: Fate) -> int:
        """Add a hit; return its row."""
        row = self._count
        if row == self._room:
            self._make_room()
        self._count += 1
        for name in LABELS:
            self._columns[name][row] = getattr(hit.label, name)
        for name in ("stamp", *FIGURES):
            self._columns[name][row] = getattr(hit, name)
        if hit.overruled:
            self._overruled[row] = hit.overruled
        self.settle(row, fate, hit.rejections)
        return row

    def _make_room(self) -> None:
        self._room += max(int(ROOM_GROWTH * self._room), FIRST_SIZE)
        for name, kind in COLUMNS.items():
            values, self._columns[name] = self._columns[name], np.zeros(self._room, kind)
            self._columns[name][: values.size] = values

    def settle(self, row: int, fate: Fate, rejections: tuple[Rejection, ...] = ()) -> None:
        """Say what has become of a hit, and what is against it."""
        self._columns["fate"][row] = fate
        if rejections:
            self._rejections[row] = rejections

    def read(self, name: str) -> FloatArray:
        """Return one of `FIGURES` of all rows, shape (room,)."""
        return self._columns[name]

    def read_figures(self, rows: NDArray[np.intp]) -> FloatArray:
        """Return what hits are compared by, shape (rows, quantities)."""
        return np.stack([self.read(item.attribute)[rows] for item in QUANTITIES], axis=1)

    def _make_label(self, row: int) -> HitLabel:
        return HitLabel(self._sample, *(int(self._columns[name][row]) for name in LABELS))
