"""How the view is laid out, apart from what is logged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.visualization import entities
from impact_rig.visualization.drawing.health_log import DISK, LEVELS, LOSSES, RATES
from impact_rig.visualization.layout.campaign import lay_out_campaign, lay_out_trends
from impact_rig.visualization.layout.samples import lay_out_printed, lay_out_samples
from impact_rig.visualization.layout.views import make_text_view, make_time_view
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun.blueprint as rrb

TAB_LAST_HIT = "Last hit"
TAB_SAMPLES = "Samples"
TAB_PRINTED = "Samples, model as printed"
TAB_CAMPAIGN = "Campaign"
TAB_TRENDS = "Trends"
TAB_RESULTS = "Results"
TAB_HEALTH = "Rig health"
TABS = (
    TAB_LAST_HIT,
    TAB_SAMPLES,
    TAB_PRINTED,
    TAB_CAMPAIGN,
    TAB_TRENDS,
    TAB_RESULTS,
    TAB_HEALTH,
)


def make_blueprint(
    sample_names: Sequence[str], contact_times: Sequence[float] = ()
) -> rrb.Blueprint:
    """Lay out the view for a sample set.

    Parameters
    ----------
    sample_names : sequence of str
        Plots for each sample, in this order; empty: no samples are known yet.
    contact_times : sequence of float
        Those that are expected [s], NaN where not known: plots begin with the part of the time in
        which something happens. Without any they begin with whole records.

    Returns
    -------
    rerun.blueprint.Blueprint
        Tabs: the last hit, the samples against both models, the paper's figures, trends over the
        hits, the results, the rig's health.

    Raises
    ------
    RigError
        If rerun-sdk is not installed.
    """
    layout = import_rerun().blueprint
    tabs = layout.Tabs(
        _lay_out_last_hit(),
        lay_out_samples(TAB_SAMPLES, sample_names, contact_times),
        lay_out_printed(TAB_PRINTED, sample_names, contact_times),
        lay_out_campaign(TAB_CAMPAIGN, sample_names, contact_times),
        lay_out_trends(TAB_TRENDS),
        _lay_out_results(),
        _lay_out_health(),
        active_tab=0,
    )
    blueprint: rrb.Blueprint = layout.Blueprint(
        tabs,
        # Plots need the time inside the hit; rerun would start with the wall clock.
        layout.TimePanel(timeline=entities.HIT_TIME, state="collapsed"),
        layout.BlueprintPanel(state="collapsed"),
        layout.SelectionPanel(state="collapsed"),
    )
    return blueprint


def _lay_out_last_hit() -> rrb.Container:
    layout = import_rerun().blueprint
    tab: rrb.Container = layout.Horizontal(
        make_time_view(
            "Measured acceleration [m/s²] over the time in the record", [entities.HITS]
        ),
        make_text_view("Verdict", entities.VERDICT),
        column_shares=[2, 1],
        name=TAB_LAST_HIT,
    )
    return tab


def _lay_out_results() -> rrb.Container:
    sdk = import_rerun()
    layout = sdk.blueprint
    tab: rrb.Container = layout.Vertical(
        make_text_view("Measured and expected", entities.TABLES),
        layout.TextLogView(
            origin=sdk.new_entity_path(entities.LOG),
            name="Verdicts",
            columns=layout.TextLogColumns(
                timeline_columns=[layout.encodings.TimelineColumn(entities.HIT, visible=False)],
                text_log_columns=["LogLevel", "Body"],
            ),
        ),
        row_shares=[2, 1],
        name=TAB_RESULTS,
    )
    return tab


def _lay_out_health() -> rrb.Container:
    sdk = import_rerun()
    layout = sdk.blueprint
    when = f"timeline {entities.WALL_CLOCK}"
    tab: rrb.Container = layout.Horizontal(
        make_text_view("Nodes", entities.HEALTH),
        layout.Vertical(
            layout.StateTimelineView(
                origin=sdk.new_entity_path([*entities.HEALTH_HISTORY, LEVELS]),
                name=f"State of the nodes ({when})",
            ),
            make_time_view(f"Rates [1/s] ({when})", [(*entities.HEALTH_HISTORY, RATES)]),
            make_time_view(
                f"Gaps, missing points, dropped, rejected ({when})",
                [(*entities.HEALTH_HISTORY, LOSSES)],
            ),
            make_time_view(f"Room on the disk [GB] ({when})", [(*entities.HEALTH_HISTORY, DISK)]),
        ),
        name=TAB_HEALTH,
    )
    return tab
