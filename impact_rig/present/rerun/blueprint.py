"""Layout of the view: three tabs of plots and texts, apart from what is logged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import BODIES, Path, make_body_path
from impact_rig.present.rerun.viewers import import_rerun
from impact_rig.results.numbers import show_unit

if TYPE_CHECKING:
    import rerun.blueprint as rrb

TAB_HIT = "Hit"
TAB_SAMPLE = "Sample"
TAB_CAMPAIGN = "Campaign"
TABS = (TAB_HIT, TAB_SAMPLE, TAB_CAMPAIGN)
LARGEST_GRID_WIDTH = 4
"""Most plots side by side."""
BEFORE, AFTER = 1.0, 4.5
"""Time range that plots of samples show first, from the middle of the pulse, in longest contact
times [-]: some periods of the sample's decay."""
OVERVIEW = (
    "All [m/s²]: hammer blue, sample orange, model on top, contact green, residual grey"
    " (alone: no hit yet)"
)
LAYERS = (entities.CONTACT, entities.OVERLAY, entities.MODELS, entities.POINTS)
"""Layers of a body, from below."""


def make_blueprint(
    sample_names: Sequence[str],
    contact_times: Sequence[float] = (),
    hammer_unit: str = "m/s^2",
    last_record: int = 0,
) -> rrb.Blueprint:
    """Lay out the view: tabs of the last hit, the samples and the campaign.

    Parameters
    ----------
    sample_names : sequence of str
        Samples in the order of their plots; empty: not known yet.
    contact_times : sequence of float
        Expected contact times [s], NaN where unknown: they choose the range that plots show
        first. Without any, plots show whole records.
    hammer_unit : str
        Unit of the hammer's sensor.
    last_record : int
        The last of the campaign; 0: it is still to come.

    Raises
    ------
    RigError
        If rerun-sdk is not installed.
    """
    sdk = import_rerun()
    layout = sdk.blueprint
    known = [time for time in contact_times if math.isfinite(time) and time > 0.0]
    decay = None
    if known:
        ends = (round(part * max(known), 9) for part in (-BEFORE, AFTER))
        limits = (sdk.TimeRangeBoundary.absolute(seconds=end) for end in ends)
        decay = layout.TimeAxis(view_range=sdk.TimeRange(*limits))
    return layout.Blueprint(
        layout.Tabs(
            _lay_out_hit(),
            _lay_out_samples(sample_names, decay),
            _lay_out_campaign(hammer_unit, last_record),
            active_tab=0,
        ),
        # Plots need the time inside the hit; rerun would start with the wall clock.
        layout.TimePanel(
            timeline=entities.HIT_TIME,
            state="collapsed",
            play_state="paused",  # else plots of hits show the last half minute
        ),
        layout.BlueprintPanel(state="collapsed"),
        layout.SelectionPanel(state="collapsed"),
    )


def _lay_out_hit() -> rrb.Container:
    layout = import_rerun().blueprint
    title = "Measured acceleration [m/s²] over the time in the record"
    return layout.Horizontal(
        _make_time_view(title, [entities.HITS]),
        _make_text_view("Verdict", entities.VERDICT),
        column_shares=[2, 1],
        name=TAB_HIT,
    )


def _lay_out_samples(names: Sequence[str], time_axis: rrb.TimeAxis | None) -> rrb.Container:
    """Return a tab with an overview, and a tab for each sample."""
    cells = [
        _make_time_view(
            name,
            # One window of contact for both: that of the hammer.
            [
                (*make_body_path(name, body), layer)
                for body in BODIES
                for layer in LAYERS
                if (body, layer) != (entities.SPECIMEN, entities.CONTACT)
            ],
            time_axis,
            has_legend=False,
        )
        for name in names
    ]
    layout = import_rerun().blueprint
    columns = min(LARGEST_GRID_WIDTH, max(math.ceil(math.sqrt(len(cells))), 1))
    return layout.Tabs(
        layout.Grid(contents=cells, grid_columns=columns, name=OVERVIEW),
        *(_lay_out_sample(name, time_axis) for name in names),
        name=TAB_SAMPLE,
        active_tab=0,
    )


def _lay_out_sample(sample: str, time_axis: rrb.TimeAxis | None) -> rrb.Container:
    """Return a tab with hammer, sample, contact law and results."""
    layout = import_rerun().blueprint
    traces = [
        _make_time_view(
            f"{body} of {sample} [m/s²]",
            [(*make_body_path(sample, body), layer) for layer in LAYERS],
            time_axis,
        )
        for body in BODIES
    ]
    law = [
        _make_time_view(
            f"Force on the hammer of {sample} [N]", [make_body_path(sample, entities.LAW)]
        ),
        _make_time_view(
            f"Residual of {sample} [N]", [make_body_path(sample, entities.LAW_RESIDUAL)]
        ),
    ]
    return layout.Horizontal(
        layout.Vertical(*traces),
        layout.Vertical(*law, row_shares=[2, 1]),
        _make_text_view("Results", make_body_path(sample, entities.SUMMARY)),
        column_shares=[3, 2, 2],
        name=sample,
    )


def _lay_out_campaign(hammer_unit: str, last_record: int) -> rrb.Container:
    """Return a tab with tables, verdicts, and contact time and peaks of each hit."""
    sdk = import_rerun()
    layout = sdk.blueprint
    when = "of each hit (7 s: record 7; grey: rejected)"
    trends = [
        # A legend would lie over hits.
        _make_time_view(
            f"{title} {when}",
            [(*entities.TRENDS, quantity)],
            _show_records(last_record),
            has_legend=False,
        )
        for title, quantity in (
            ("Contact time τp [µs]", entities.CONTACT_TIME),
            (f"Peak of the hammer [{show_unit(hammer_unit)}]", entities.HAMMER_PEAK),
            ("Peak of the sample [m/s²]", entities.SPECIMEN_PEAK),
        )
    ]
    columns = layout.TextLogColumns(
        timeline_columns=[layout.encodings.TimelineColumn(entities.HIT, visible=False)],
        text_log_columns=["LogLevel", "Body"],
    )
    verdicts = layout.TextLogView(
        origin=sdk.new_entity_path(entities.LOG), name="Verdicts", columns=columns
    )
    return layout.Horizontal(
        layout.Vertical(
            _make_text_view("Measured and expected", entities.TABLES), verdicts, row_shares=[2, 1]
        ),
        layout.Vertical(*trends),
        column_shares=[3, 2],
        name=TAB_CAMPAIGN,
    )


def _show_records(last: int) -> rrb.TimeAxis:
    """Return an axis over all records, with room for the points of the outer ones.

    Where the last one is not known, it is the whole time line: else the minute at the cursor.
    """
    sdk = import_rerun()
    make = sdk.TimeRangeBoundary
    ends = [make.absolute(seconds=end) for end in (0.5, last + 0.5)] if last else [make.infinite()]
    return sdk.blueprint.TimeAxis(view_range=sdk.TimeRange(ends[0], ends[-1]))


def _make_text_view(name: str, path: Path) -> rrb.TextDocumentView:
    """Return a view of one document."""
    sdk = import_rerun()
    return sdk.blueprint.TextDocumentView(origin=sdk.new_entity_path(path), name=name)


def _make_time_view(
    name: str,
    parents: Sequence[Path],
    time_axis: rrb.TimeAxis | None = None,
    *,
    has_legend: bool = True,
) -> rrb.TimeSeriesView:
    """Return a plot over time of all entities below `parents`.

    It shows what `time_axis` says first, or its own lines as far as they last.
    """
    sdk = import_rerun()
    layout = sdk.blueprint
    return layout.TimeSeriesView(
        contents=[f"+ {sdk.new_entity_path(parent)}/**" for parent in parents],
        name=name,
        axis_x=time_axis,
        plot_legend=layout.PlotLegend(layout.Corner2D.RightTop, visible=has_legend),
    )
