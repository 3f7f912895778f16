"""Layout of the samples: all beside each other, and each by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.visualization import entities
from impact_rig.visualization.entities import BODIES, Path, find_body
from impact_rig.visualization.layout.views import (
    Legend,
    Range,
    find_known,
    make_text_view,
    make_time_view,
)
from impact_rig.visualization.rerun_sdk import import_rerun

if TYPE_CHECKING:
    import rerun.blueprint as rrb

LARGEST_GRID_WIDTH = 4
"""Most plots side by side [-], our choice."""
BEFORE, AFTER = 1.0, 4.5
"""What plots begin with, in longest contact times from the middle of the pulse [-], our choice:
some periods of the sample's decay."""
OVERVIEW = "All [m/s²]: hammer blue, sample orange, model on top, residual grey, contact green"
OVERVIEW_AS_PRINTED = "All [m/s²]: hammer blue, sample orange, model on top, residual grey"
LAYERS = (entities.CONTACT, entities.OVERLAY, entities.MODELS, entities.POINTS)
"""What is drawn of a body, from below."""


def lay_out_samples(
    name: str, sample_names: Sequence[str], contact_times: Sequence[float]
) -> rrb.Container:
    """Return a tab with an overview, and a tab for each sample with hammer, sample and values."""
    layout = import_rerun().blueprint
    time_range = find_time_range(contact_times)
    cells = [
        make_time_view(
            sample,
            # One window of contact for both: that of the hammer.
            [
                (*find_body(sample, body), layer)
                for body in BODIES
                for layer in LAYERS
                if (body, layer) != (entities.SPECIMEN, entities.CONTACT)
            ],
            time_range,
            legend="none",
        )
        for sample in sample_names
    ]
    tab: rrb.Container = layout.Tabs(
        _make_grid(OVERVIEW, cells),
        *(_lay_out_sample(sample, time_range) for sample in sample_names),
        name=name,
        active_tab=0,
    )
    return tab


def lay_out_printed(
    title: str, sample_names: Sequence[str], contact_times: Sequence[float]
) -> rrb.Container:
    """Return a tab with every sample against the model as printed, and a tab for each of them."""
    time_range = find_time_range(contact_times)

    def view(sample: str, heading: str, legend: Legend) -> rrb.TimeSeriesView:
        parent = (*entities.SAMPLES, sample, entities.AS_PRINTED)
        return make_time_view(heading, [parent], time_range, legend=legend)

    layout = import_rerun().blueprint
    tab: rrb.Container = layout.Tabs(
        _make_grid(OVERVIEW_AS_PRINTED, [view(name, name, "none") for name in sample_names]),
        *(
            layout.Vertical(view(name, f"{name} [m/s²]", "right"), name=name)
            for name in sample_names
        ),
        name=title,
        active_tab=0,
    )
    return tab


def find_time_range(contact_times: Sequence[float]) -> Range | None:
    """Return what plots of samples begin with [s]; None: everything."""
    known = find_known(contact_times)
    return (-BEFORE * max(known), AFTER * max(known)) if known else None


def _lay_out_sample(sample: str, time_range: Range | None) -> rrb.Container:
    layout = import_rerun().blueprint

    def view(body: str) -> rrb.TimeSeriesView:
        parents: list[Path] = [(*find_body(sample, body), layer) for layer in LAYERS]
        return make_time_view(f"{body} of {sample} [m/s²]", parents, time_range)

    tab: rrb.Container = layout.Horizontal(
        layout.Vertical(*(view(body) for body in BODIES)),
        make_text_view("What was found", (*entities.SAMPLES, sample, entities.SUMMARY)),
        column_shares=[3, 2],
        name=sample,
    )
    return tab


def _make_grid(name: str, cells: Sequence[rrb.View]) -> rrb.Container:
    columns = min(LARGEST_GRID_WIDTH, math.ceil(math.sqrt(len(cells))))
    grid: rrb.Container = import_rerun().blueprint.Grid(
        contents=cells, grid_columns=max(columns, 1), name=name
    )
    return grid
