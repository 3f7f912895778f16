"""Lines and points over the time inside the hit, and how they are replaced.

Traces are one entity with a column per line (five times smaller and faster than an entity per
line), as float32, with their peaks kept at any zoom. Rerun cannot take back what was logged on a
timeline; so a new drawing is a new entity, and the one that it replaces is hidden under
the one name "earlier", where a click in the legend shows it again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import FloatArray
from impact_rig.present.rerun.entities import HIT_TIME, Path
from impact_rig.present.rerun.viewers import import_rerun
from impact_rig.results.palette import GREY

if TYPE_CHECKING:
    import rerun as rr

EARLIER = "earlier"
"""Name of all replaced lines."""

OPAQUE = 255
"""Full opacity."""
Shade = tuple[int, int, int] | tuple[int, int, int, int]
"""Red, green, blue and perhaps opacity, 0 to 255."""


@dataclass(frozen=True)
class Line:
    """The look of one column. Lines of one name share their entry in the legend."""

    name: str
    colour: Shade
    width: float


@dataclass(frozen=True)
class Mark:
    """The look of one column of points."""

    name: str
    colour: Shade
    marker: str
    size: float


@dataclass(frozen=True)
class _Drawn:
    path: str
    count: int
    is_points: bool


class PlotLog:
    """Draws into one Rerun recording.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._versions: Counter[Path] = Counter()
        self._shown: dict[Path, list[_Drawn]] = {}

    def draw_lines(
        self,
        family: Path,
        time: FloatArray,
        values: NDArray[Any],
        lines: Sequence[Line],
        *,
        keeps_peaks: bool = True,
    ) -> str:
        """Draw lines beside what the family shows already.

        Parameters
        ----------
        family : tuple of str
            Parent of the entity.
        time : ndarray, shape (n,)
            [s]
        values : ndarray, shape (n, columns)
            A NaN breaks its line.
        lines : sequence of Line
            One per column.
        keeps_peaks : bool
            Where several points share a pixel, draw the lowest and the highest. Not for a few
            points whose order matters.

        Returns
        -------
        str
            Path of the entity.
        """
        path = self._add(family, len(lines), is_points=False)
        style = self._rr.SeriesLines(
            names=[line.name for line in lines],
            colors=_pack([line.colour for line in lines]),
            widths=[line.width for line in lines],
            aggregation_policy="MinMax" if keeps_peaks else "Off",
        )
        self._stream.log(path, style, static=True)
        self._send(path, time, values)
        return path

    def draw_points(
        self, family: Path, time: FloatArray, values: NDArray[Any], marks: Sequence[Mark]
    ) -> str:
        """Draw points; as `draw_lines`, but a NaN has no point."""
        path = self.add_points(family, marks)
        self._send(path, time, values)
        return path

    def add_points(self, family: Path, marks: Sequence[Mark]) -> str:
        """Return the path of a new entity whose points the caller logs, on any timeline."""
        path = self._add(family, len(marks), is_points=True)
        style = self._rr.SeriesPoints(
            names=[mark.name for mark in marks],
            colors=_pack([mark.colour for mark in marks]),
            markers=[mark.marker for mark in marks],
            marker_sizes=[mark.size for mark in marks],
        )
        self._stream.log(path, style, static=True)
        return path

    def hide(self, parent: Path = ()) -> None:
        """Hide all lines at or below `parent`; without it, all."""
        for family in [item for item in self._shown if item[: len(parent)] == parent]:
            for drawn in self._shown.pop(family):
                self._hide(drawn)

    def _hide(self, drawn: _Drawn) -> None:
        archetype = self._rr.SeriesPoints if drawn.is_points else self._rr.SeriesLines
        hidden = archetype.from_fields(
            visible_series=[False] * drawn.count,
            names=[EARLIER] * drawn.count,
            colors=_pack([GREY] * drawn.count),
        )
        self._stream.log(drawn.path, hidden, static=True)

    def _add(self, family: Path, count: int, *, is_points: bool) -> str:
        path = self._make_path(family)
        self._shown.setdefault(family, []).append(_Drawn(path, count, is_points))
        return path

    def _make_path(self, family: Path) -> str:
        self._versions[family] += 1
        return str(self._rr.new_entity_path([*family, str(self._versions[family])]))

    def _send(self, path: str, time: FloatArray, values: NDArray[Any]) -> None:
        if time.size == 0:
            return
        nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
        self._stream.send_columns(
            path,
            indexes=[self._rr.TimeColumn(HIT_TIME, duration=nanoseconds)],
            columns=[make_scalars(values)],
        )


def make_scalars(values: NDArray[Any]) -> rr.ComponentColumn:
    """Return rows of scalars, shape (n, columns), as Rerun takes them, in single precision."""
    sdk = import_rerun()
    rows, columns = values.shape
    descriptor = sdk.Scalars.descriptor_scalars()
    # Rerun's own class for scalars would make them twice as large.
    column: rr.ComponentColumn = sdk.ComponentColumn(
        descriptor,
        sdk.AnyBatchValue(descriptor, values.astype(np.float32).reshape(-1)),
        offsets=np.arange(0, rows * columns + 1, columns, dtype=np.int32),
    )
    return column


def _pack(shades: Sequence[Shade]) -> NDArray[np.uint32]:
    """Return colours as Rerun stores them; its own conversion takes longer than the logging."""
    return np.array(
        [int.from_bytes([*shade, OPAQUE][:4], "big") for shade in shades], dtype=np.uint32
    )
