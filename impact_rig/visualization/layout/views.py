"""The kinds of view that the layout is made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from impact_rig.visualization.entities import Path
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun.blueprint as rrb

Legend = Literal["left", "right", "none"]
"""In which upper corner of a plot names stand."""
Range = tuple[float, float]
"""First and last time that a plot begins with [s]."""


def make_time_view(
    name: str,
    parents: Sequence[Path],
    time_range: Range | None = None,
    *,
    legend: Legend = "right",
) -> rrb.TimeSeriesView:
    """Return a plot over time of everything below `parents`.

    Parameters
    ----------
    name : str
        Above it.
    parents : sequence of tuple of str
        Entity paths.
    time_range : tuple of float, optional
        What it begins with [s]; without one, everything.
    legend : str
        In which upper corner names stand.
    """
    sdk = import_rerun()
    layout = sdk.blueprint
    corner = layout.Corner2D.LeftTop if legend == "left" else layout.Corner2D.RightTop
    view: rrb.TimeSeriesView = layout.TimeSeriesView(
        contents=[f"+ {sdk.new_entity_path(parent)}/**" for parent in parents],
        name=name,
        axis_x=_make_axis(time_range) if time_range else None,
        plot_legend=layout.PlotLegend(corner, visible=legend != "none"),
    )
    return view


@lru_cache
def _make_axis(time_range: Range) -> rrb.TimeAxis:
    """Return an axis; many plots share the few that there are, and each takes a millisecond."""
    sdk = import_rerun()
    start, end = (
        sdk.TimeRangeBoundary.absolute(seconds=round(moment, 9)) for moment in time_range
    )
    axis: rrb.TimeAxis = sdk.blueprint.TimeAxis(view_range=sdk.TimeRange(start, end))
    return axis


def make_text_view(name: str, path: Path) -> rrb.TextDocumentView:
    """Return a view of one document."""
    sdk = import_rerun()
    view: rrb.TextDocumentView = sdk.blueprint.TextDocumentView(
        origin=sdk.new_entity_path(path), name=name
    )
    return view


def find_known(contact_times: Sequence[float]) -> list[float]:
    """Return the contact times that are known [s]."""
    return [time for time in contact_times if math.isfinite(time) and time > 0.0]
