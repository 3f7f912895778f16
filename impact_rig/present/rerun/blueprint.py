"""Layout of the view: tabs of plots, texts and drawings, apart from what is logged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from impact_rig.present.rerun import entities, paper_figures
from impact_rig.present.rerun.entities import BODIES, Path, make_body_path
from impact_rig.present.rerun.health import DISK, LEVELS, LOSSES, RATES
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.results.figure_rows import sort_as_figure_5
from impact_rig.results.numbers import show_unit

if TYPE_CHECKING:
    import rerun.blueprint as rrb

TAB_LAST_HIT = "Last hit"
TAB_SAMPLES = "Samples"
TAB_PRINTED = "Samples, model as printed"
TAB_LAW = "Contact law"
TAB_CAMPAIGN = "Campaign"
TAB_TRENDS = "Trends"
TAB_RESULTS = "Results"
TAB_HEALTH = "Rig health"
TABS = (
    TAB_LAST_HIT,
    TAB_SAMPLES,
    TAB_PRINTED,
    TAB_LAW,
    TAB_CAMPAIGN,
    TAB_TRENDS,
    TAB_RESULTS,
    TAB_HEALTH,
)
LARGEST_GRID_WIDTH = 4
"""Most plots side by side [-], our choice."""
BEFORE, AFTER = 1.0, 4.5
"""What plots of samples begin with, in longest contact times from the middle of the pulse [-], our
choice: some periods of the sample's decay."""
MARGIN = 0.03
"""What Figs. 3 and 4 show beside the shortest and longest pulse, parts of it [-], our choice."""
CASES = 3
"""Samples at once in Fig. 5 [-]: as in the paper."""
OVERVIEW = "All [m/s²]: hammer blue, sample orange, model on top, residual grey, contact green"
OVERVIEW_AS_PRINTED = "All [m/s²]: hammer blue, sample orange, model on top, residual grey"
LAYERS = (entities.CONTACT, entities.OVERLAY, entities.MODELS, entities.POINTS)
"""What is drawn of a body, from below."""
Legend = Literal["left", "right", "none"]
"""In which upper corner of a plot names stand."""
Range = tuple[float, float]
"""First and last time that a plot begins with [s]."""


def make_blueprint(
    sample_names: Sequence[str], contact_times: Sequence[float] = (), hammer_unit: str = "m/s^2"
) -> rrb.Blueprint:
    """Lay out the view for a sample set.

    Parameters
    ----------
    sample_names : sequence of str
        Plots for each sample, in this order; empty: no samples are known yet.
    contact_times : sequence of float
        Those that are expected [s], NaN where not known: plots begin with the part of the time in
        which something happens. Without any they begin with whole records.
    hammer_unit : str
        Of what the hammer's sensor measures.

    Returns
    -------
    rerun.blueprint.Blueprint
        Tabs: the last hit, the samples against both models, their contact laws, the paper's
        figures, trends over the hits, the results, the rig's health.

    Raises
    ------
    RigError
        If rerun-sdk is not installed.
    """
    layout = import_rerun().blueprint
    known = [time for time in contact_times if math.isfinite(time) and time > 0.0]
    decay = (-BEFORE * max(known), AFTER * max(known)) if known else None
    widths = ((1 - MARGIN) * min(known), (1 + MARGIN) * max(known)) if known else None
    return layout.Blueprint(
        layout.Tabs(
            _lay_out_last_hit(),
            _lay_out_samples(sample_names, decay),
            _lay_out_printed(sample_names, decay),
            _lay_out_laws(sample_names),
            _lay_out_campaign(sample_names, decay, widths),
            _lay_out_trends(hammer_unit),
            _lay_out_results(),
            _lay_out_health(),
            active_tab=0,
        ),
        # Plots need the time inside the hit; rerun would start with the wall clock.
        layout.TimePanel(timeline=entities.HIT_TIME, state="collapsed"),
        layout.BlueprintPanel(state="collapsed"),
        layout.SelectionPanel(state="collapsed"),
    )


def _lay_out_last_hit() -> rrb.Container:
    title = "Measured acceleration [m/s²] over the time in the record"
    return import_rerun().blueprint.Horizontal(
        _make_time_view(title, [entities.HITS]),
        _make_text_view("Verdict", entities.VERDICT),
        column_shares=[2, 1],
        name=TAB_LAST_HIT,
    )


def _lay_out_samples(names: Sequence[str], time_range: Range | None) -> rrb.Container:
    """Return a tab with an overview, and a tab for each sample with hammer, sample and values."""
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
            time_range,
            legend="none",
        )
        for name in names
    ]
    return import_rerun().blueprint.Tabs(
        _make_grid(OVERVIEW, cells),
        *(_lay_out_sample(name, time_range) for name in names),
        name=TAB_SAMPLES,
        active_tab=0,
    )


def _lay_out_sample(sample: str, time_range: Range | None) -> rrb.Container:
    layout = import_rerun().blueprint
    plots = [
        _make_time_view(
            f"{body} of {sample} [m/s²]",
            [(*make_body_path(sample, body), layer) for layer in LAYERS],
            time_range,
        )
        for body in BODIES
    ]
    return layout.Horizontal(
        layout.Vertical(*plots),
        _make_text_view("What was found", (*entities.SAMPLES, sample, entities.SUMMARY)),
        column_shares=[3, 2],
        name=sample,
    )


def _lay_out_printed(names: Sequence[str], time_range: Range | None) -> rrb.Container:
    """Return a tab with every sample against the model as printed, and a tab for each of them."""
    layout = import_rerun().blueprint

    def view(sample: str, heading: str, legend: Legend) -> rrb.TimeSeriesView:
        parent = (*entities.SAMPLES, sample, entities.AS_PRINTED)
        return _make_time_view(heading, [parent], time_range, legend=legend)

    return layout.Tabs(
        _make_grid(OVERVIEW_AS_PRINTED, [view(name, name, "none") for name in names]),
        *(layout.Vertical(view(name, f"{name} [m/s²]", "right"), name=name) for name in names),
        name=TAB_PRINTED,
        active_tab=0,
    )


def _lay_out_laws(names: Sequence[str]) -> rrb.Container:
    """Return a tab with a tab for each sample: pulse, what is left of it, loop."""
    layout = import_rerun().blueprint
    pages = [
        layout.Horizontal(
            layout.Vertical(
                _make_time_view(
                    f"Force on the hammer of {name} [N]", [make_body_path(name, entities.LAW)]
                ),
                _make_time_view(
                    f"What law and versed-sine leave of {name} [N]",
                    [make_body_path(name, entities.LAW_RESIDUAL)],
                    legend="none",
                ),
                row_shares=[2, 1],
            ),
            _make_drawing(
                f"Force [N] over indentation [µm] of {name}",
                make_body_path(name, entities.LOOP),
            ),
            column_shares=[3, 2],
            name=name,
        )
        for name in names
    ]
    return layout.Tabs(*pages, name=TAB_LAW)


def _make_grid(name: str, cells: Sequence[rrb.View]) -> rrb.Container:
    columns = min(LARGEST_GRID_WIDTH, math.ceil(math.sqrt(len(cells))))
    return import_rerun().blueprint.Grid(contents=cells, grid_columns=max(columns, 1), name=name)


def _lay_out_campaign(
    names: Sequence[str], time_range: Range | None, widths: Range | None
) -> rrb.Container:
    """Return a tab with Figs. 3 to 6."""
    layout = import_rerun().blueprint
    figure_3 = "Fig. 3, axes exchanged: relative mass [g] and pulse width τp"
    figure_4 = "Fig. 4: peak of the {} [m/s²] against pulse width τp"
    peaks = [
        _make_time_view(
            figure_4.format(whose), [(*entities.FIGURE_4, body)], widths, legend="none"
        )
        for whose, body in (("hammer", entities.HAMMER), ("samples", entities.SPECIMEN))
    ]
    return layout.Horizontal(
        layout.Vertical(
            _make_time_view(figure_3, [entities.FIGURE_3], widths, legend="left"),
            *peaks,
            row_shares=[8, 3, 3],
        ),
        layout.Vertical(
            _lay_out_figure_5(names, time_range),
            layout.Horizontal(
                *(
                    _make_drawing(
                        f"Fig. 6{letter}: mean square error, {whose}", (*entities.FIGURE_6, body)
                    )
                    for letter, whose, body in (
                        ("a", "hammer", entities.HAMMER),
                        ("b", "samples", entities.SPECIMEN),
                    )
                )
            ),
        ),
        name=TAB_CAMPAIGN,
    )


def _lay_out_figure_5(names: Sequence[str], time_range: Range | None) -> rrb.Container:
    layout = import_rerun().blueprint
    names = sort_as_figure_5(tuple(names))
    pages = [
        layout.Horizontal(
            *(
                _make_time_view(f"Fig. 5: {name}", [(*entities.FIGURE_5, name)], time_range)
                for name in cases
            ),
            name=" · ".join(cases),
        )
        for cases in (names[i : i + CASES] for i in range(0, len(names), CASES))
    ]
    return layout.Tabs(*pages, name="Fig. 5")


def _make_drawing(name: str, path: Path) -> rrb.Spatial2DView:
    """Return a view of what is drawn into a plane."""
    sdk = import_rerun()
    return sdk.blueprint.Spatial2DView(
        origin=sdk.new_entity_path(path),
        name=name,
        visual_bounds=sdk.blueprint.VisualBounds2D(
            x_range=[-paper_figures.LEFT, paper_figures.WIDTH + paper_figures.RIGHT],
            y_range=[-paper_figures.ABOVE, paper_figures.HEIGHT + paper_figures.BELOW],
        ),
    )


def _lay_out_trends(hammer_unit: str) -> rrb.Container:
    """Return a tab with contact time and peaks of each hit."""
    when = f"of each hit (timeline {entities.HIT} or {entities.WALL_CLOCK}, chosen below)"
    plots = [
        _make_time_view(f"{title} {when}", [(*entities.TRENDS, quantity)])
        for title, quantity in (
            ("Contact time τp [µs]", entities.CONTACT_TIME),
            (f"Peak of the hammer [{show_unit(hammer_unit)}]", entities.HAMMER_PEAK),
            ("Peak of the sample [m/s²]", entities.SPECIMEN_PEAK),
        )
    ]
    return import_rerun().blueprint.Vertical(*plots, name=TAB_TRENDS)


def _lay_out_results() -> rrb.Container:
    sdk = import_rerun()
    layout = sdk.blueprint
    columns = layout.TextLogColumns(
        timeline_columns=[layout.encodings.TimelineColumn(entities.HIT, visible=False)],
        text_log_columns=["LogLevel", "Body"],
    )
    verdicts = layout.TextLogView(
        origin=sdk.new_entity_path(entities.LOG), name="Verdicts", columns=columns
    )
    return layout.Vertical(
        _make_text_view("Measured and expected", entities.TABLES),
        verdicts,
        row_shares=[2, 1],
        name=TAB_RESULTS,
    )


def _lay_out_health() -> rrb.Container:
    sdk = import_rerun()
    layout = sdk.blueprint
    when = f"timeline {entities.WALL_CLOCK}"
    plots = [
        _make_time_view(f"{title} ({when})", [(*entities.HEALTH_HISTORY, kind)])
        for title, kind in (
            ("Rates [1/s]", RATES),
            ("Gaps, missing points, dropped, rejected", LOSSES),
            ("Room on the disk [GB]", DISK),
        )
    ]
    states = layout.StateTimelineView(
        origin=sdk.new_entity_path([*entities.HEALTH_HISTORY, LEVELS]),
        name=f"State of the nodes ({when})",
    )
    return layout.Horizontal(
        _make_text_view("Nodes", entities.HEALTH),
        layout.Vertical(states, *plots),
        name=TAB_HEALTH,
    )


def _make_text_view(name: str, path: Path) -> rrb.TextDocumentView:
    """Return a view of one document."""
    sdk = import_rerun()
    return sdk.blueprint.TextDocumentView(origin=sdk.new_entity_path(path), name=name)


def _make_time_view(
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
    return layout.TimeSeriesView(
        contents=[f"+ {sdk.new_entity_path(parent)}/**" for parent in parents],
        name=name,
        axis_x=_make_axis(time_range) if time_range else None,
        plot_legend=layout.PlotLegend(corner, visible=legend != "none"),
    )


@lru_cache
def _make_axis(time_range: Range) -> rrb.TimeAxis:
    """Return an axis; many plots share the few that there are, and each takes a millisecond."""
    sdk = import_rerun()
    start, end = (
        sdk.TimeRangeBoundary.absolute(seconds=round(moment, 9)) for moment in time_range
    )
    return sdk.blueprint.TimeAxis(view_range=sdk.TimeRange(start, end))
