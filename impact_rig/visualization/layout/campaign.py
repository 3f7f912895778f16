"""Layout of the paper's figures and of the trends over the hits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.results.figure_rows import sort_as_figure_5
from impact_rig.visualization import entities
from impact_rig.visualization.drawing import bars
from impact_rig.visualization.layout.samples import find_time_range
from impact_rig.visualization.layout.views import Range, find_known, make_time_view
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun.blueprint as rrb

MARGIN = 0.03
"""What Figs. 3 and 4 show beside the shortest and longest pulse, parts of it [-], our choice."""
CASES = 3
"""Samples at once in Fig. 5 [-]: as in the paper."""


def lay_out_campaign(
    name: str, sample_names: Sequence[str], contact_times: Sequence[float]
) -> rrb.Container:
    """Return a tab with Figs. 3 to 6."""
    layout = import_rerun().blueprint
    width_range = _find_width_range(contact_times)
    tab: rrb.Container = layout.Horizontal(
        layout.Vertical(
            make_time_view(
                "Fig. 3, axes exchanged: relative mass [g] and pulse width τp",
                [entities.FIGURE_3],
                width_range,
                legend="left",
            ),
            make_time_view(
                "Fig. 4: peak of the hammer [m/s²] against pulse width τp",
                [(*entities.FIGURE_4, entities.HAMMER)],
                width_range,
                legend="none",
            ),
            make_time_view(
                "Fig. 4: peak of the samples [m/s²] against pulse width τp",
                [(*entities.FIGURE_4, entities.SPECIMEN)],
                width_range,
                legend="none",
            ),
            row_shares=[8, 3, 3],
        ),
        layout.Vertical(
            _lay_out_figure_5(sample_names, find_time_range(contact_times)),
            layout.Horizontal(
                _make_bars("Fig. 6a: mean square error, hammer", entities.HAMMER),
                _make_bars("Fig. 6b: mean square error, samples", entities.SPECIMEN),
            ),
        ),
        name=name,
    )
    return tab


def lay_out_trends(name: str) -> rrb.Container:
    """Return a tab with contact time and peaks of each hit."""
    when = f"of each hit (timeline {entities.HIT} or {entities.WALL_CLOCK}, chosen below)"
    tab: rrb.Container = import_rerun().blueprint.Vertical(
        *(
            make_time_view(f"{title} {when}", [(*entities.TRENDS, quantity)])
            for title, quantity in (
                ("Contact time τp [µs]", entities.CONTACT_TIME),
                ("Peak of the hammer [m/s²]", entities.HAMMER_PEAK),
                ("Peak of the sample [m/s²]", entities.SPECIMEN_PEAK),
            )
        ),
        name=name,
    )
    return tab


def _find_width_range(contact_times: Sequence[float]) -> Range | None:
    known = find_known(contact_times)
    return ((1 - MARGIN) * min(known), (1 + MARGIN) * max(known)) if known else None


def _lay_out_figure_5(sample_names: Sequence[str], time_range: Range | None) -> rrb.Container:
    layout = import_rerun().blueprint
    names = sort_as_figure_5(tuple(sample_names))
    pages = [
        layout.Horizontal(
            *(
                make_time_view(f"Fig. 5: {sample}", [(*entities.FIGURE_5, sample)], time_range)
                for sample in cases
            ),
            name=" · ".join(cases),
        )
        for cases in (names[i : i + CASES] for i in range(0, len(names), CASES))
    ]
    figure: rrb.Container = layout.Tabs(*pages, name="Fig. 5")
    return figure


def _make_bars(name: str, body: str) -> rrb.Spatial2DView:
    sdk = import_rerun()
    view: rrb.Spatial2DView = sdk.blueprint.Spatial2DView(
        origin=sdk.new_entity_path([*entities.FIGURE_6, body]),
        name=name,
        visual_bounds=sdk.blueprint.VisualBounds2D(
            x_range=[-bars.LEFT, bars.WIDTH + bars.RIGHT],
            y_range=[-bars.ABOVE, bars.HEIGHT + bars.BELOW],
        ),
    )
    return view
