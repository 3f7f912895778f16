"""Plots of hits as recorded, and the trend over the hits."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.results.campaign import HitResults
from impact_rig.results.hit_traces import HitTraces
from impact_rig.results.numbers import MICRO
from impact_rig.results.palette import CONTACT, GREY, HAMMER, SPECIMEN
from impact_rig.visualization import entities
from impact_rig.visualization.drawing.plots import Line, Mark, PlotLog, make_scalars
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun as rr

HIT_WIDTH = 1.5
"""Line width of the last hit [points], our choice."""
TREND_SIZE = 3.0
"""Size of one hit's point in a trend [points], our choice."""
LINES = (Line("hammer", HAMMER, HIT_WIDTH), Line("sample", SPECIMEN, HIT_WIDTH))
ACCEPTED = "accepted"
REJECTED = "rejected"
TRENDS = {
    entities.CONTACT_TIME: CONTACT,
    entities.HAMMER_PEAK: HAMMER,
    entities.SPECIMEN_PEAK: SPECIMEN,
}
"""Colours of the accepted hits, by quantity."""


def draw_last_hit(plots: PlotLog, traces: HitTraces) -> str:
    """Draw a record's traces in place of the last one's; return the entity's path."""
    plots.hide(entities.HITS)
    return plots.draw_lines(entities.HITS, traces.time, traces.values, LINES)


def draw_earlier_hits(plots: PlotLog, hits: Sequence[HitTraces]) -> None:
    """Draw records that another one has superseded already.

    Those with the same points of time share an entity: a row costs three times what a value does.
    """
    by_time = defaultdict(list)
    for hit in hits:
        if hit.time.size > 0:
            by_time[hit.time.tobytes()].append(hit)
    for group in by_time.values():
        values = np.concatenate([hit.values for hit in group], axis=1)
        plots.draw_hidden(entities.HITS, group[0].time, values)


class TrendLog:
    """Contact time and peaks of every hit, over the number of the hit and the time of day.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to.
    plots : PlotLog
        Of the same stream; what it hides is begun anew with the next hit.
    """

    def __init__(self, stream: rr.RecordingStream, plots: PlotLog) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._plots = plots
        self._paths: dict[str, str] = {}

    def begin(self) -> None:
        """Begin another campaign: the trends start anew."""
        self._plots.hide(entities.TRENDS)
        self._paths.clear()

    def log_hits(self, hits: Sequence[HitResults], stamps: Sequence[int]) -> None:
        """Add hits with their times, nanoseconds since the epoch."""
        values = np.array(
            [
                (hit.contact_time_s * MICRO, hit.hammer_peak_m_per_s2, hit.specimen_peak_m_per_s2)
                for hit in hits
            ]
        ).reshape(-1, len(TRENDS))
        accepted = np.array([hit.accepted for hit in hits], dtype=bool)
        rr = self._rr
        indexes = [
            rr.TimeColumn(entities.HIT, sequence=[hit.record for hit in hits]),
            rr.TimeColumn(entities.WALL_CLOCK, timestamp=np.array(stamps, "datetime64[ns]")),
        ]
        for quantity, column in zip(TRENDS, values.T, strict=True):
            rows = np.stack(
                [np.where(accepted, column, np.nan), np.where(accepted, np.nan, column)], axis=1
            )
            self._stream.send_columns(
                self._find_path(quantity), indexes=indexes, columns=[make_scalars(rows)]
            )

    def _find_path(self, quantity: str) -> str:
        if quantity not in self._paths:
            marks = [
                Mark(ACCEPTED, TRENDS[quantity], "circle", TREND_SIZE),
                Mark(REJECTED, GREY, "cross", TREND_SIZE),
            ]
            self._paths[quantity] = self._plots.add_points((*entities.TRENDS, quantity), marks)
        return self._paths[quantity]
