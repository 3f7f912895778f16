"""How the view is laid out, apart from what is logged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.results.sample_traces import DRIVEN, PRINTED
from impact_rig.visualization import entities
from impact_rig.visualization.entities import BODIES, find_body
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun.blueprint as rrb

TAB_LAST_HIT = "Last hit"
TAB_SAMPLES = "Samples"
TAB_PRINTED = "Samples, model as printed"
TAB_RESULTS = "Results"
TAB_HEALTH = "Rig health"
TABS = (TAB_LAST_HIT, TAB_SAMPLES, TAB_PRINTED, TAB_RESULTS, TAB_HEALTH)

LARGEST_GRID_WIDTH = 4
"""Most plots side by side [-], our choice: a legend still fits into a quarter of a screen."""


def make_blueprint(sample_names: Sequence[str], active_tab: str = TAB_LAST_HIT) -> rrb.Blueprint:
    """Lay out the view for a sample set.

    Parameters
    ----------
    sample_names : sequence of str
        One plot per sample, in this order; empty: no samples are known yet.
    active_tab : str
        One of `TABS`.

    Returns
    -------
    rerun.blueprint.Blueprint
        Tabs: the last hit, the samples against both models, the results, the rig's health.

    Raises
    ------
    RigError
        If rerun-sdk is not installed.
    """
    layout = import_rerun().blueprint
    tabs = layout.Tabs(
        _make_last_hit(),
        _make_grid(TAB_SAMPLES, DRIVEN, sample_names),
        _make_grid(TAB_PRINTED, PRINTED, sample_names),
        _make_results(),
        layout.TextDocumentView(origin="/" + "/".join(entities.HEALTH), name=TAB_HEALTH),
        active_tab=TABS.index(active_tab),
    )
    blueprint: rrb.Blueprint = layout.Blueprint(
        tabs,
        # Plots need the time inside the hit; rerun would start with the wall clock.
        layout.TimePanel(timeline=entities.HIT_TIME, state="collapsed"),
        layout.BlueprintPanel(state="collapsed"),
        layout.SelectionPanel(state="collapsed"),
    )
    return blueprint


def _make_last_hit() -> rrb.Container:
    layout = import_rerun().blueprint
    tab: rrb.Container = layout.Horizontal(
        layout.TimeSeriesView(
            origin="/" + "/".join(entities.HITS),
            name="Measured acceleration [m/s²] over time in the record",
            plot_legend=layout.PlotLegend(layout.Corner2D.RightTop),
        ),
        layout.TextDocumentView(origin="/" + "/".join(entities.VERDICT), name="Verdict"),
        column_shares=[2, 1],
        name=TAB_LAST_HIT,
    )
    return tab


def _make_grid(name: str, variant: str, sample_names: Sequence[str]) -> rrb.Container:
    sdk = import_rerun()
    layout = sdk.blueprint
    columns = min(LARGEST_GRID_WIDTH, math.ceil(math.sqrt(len(sample_names))))
    tab: rrb.Container = layout.Grid(
        contents=[
            layout.TimeSeriesView(
                origin=sdk.new_entity_path([*entities.SAMPLES, sample]),
                contents=[
                    f"+ {sdk.new_entity_path([*find_body(sample, body), *part])}/**"
                    for body in BODIES
                    for part in (
                        (entities.CONTACT,),
                        (entities.OVERLAY,),
                        (entities.MODELS, variant),
                        (entities.POINTS,),
                    )
                ],
                name=sample,
                plot_legend=layout.PlotLegend(layout.Corner2D.RightTop),
            )
            for sample in sample_names
        ],
        grid_columns=max(columns, 1),
        name=name,
    )
    return tab


def _make_results() -> rrb.Container:
    layout = import_rerun().blueprint
    tab: rrb.Container = layout.Vertical(
        layout.TextDocumentView(
            origin="/" + "/".join(entities.TABLES), name="Measured and expected"
        ),
        layout.TextLogView(
            origin="/" + "/".join(entities.LOG),
            name="Verdicts",
            columns=layout.TextLogColumns(
                timeline_columns=[layout.encodings.TimelineColumn(entities.HIT, visible=False)],
                text_log_columns=["LogLevel", "Body"],
            ),
        ),
        row_shares=[1, 1],
        name=TAB_RESULTS,
    )
    return tab
