"""The contact law of one sample: its pulse, what it leaves, and its loop, as the report has them.

A loop is no function of time: it is drawn into a plane, as Fig. 6 is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.signals.record import FloatArray
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import make_body_path
from impact_rig.present.rerun.paper_figures import (
    HEIGHT,
    LIGHT,
    WIDTH,
    choose_ticks,
    draw_parts,
    make_labels,
    make_lines,
)
from impact_rig.present.rerun.plots import Line, PlotLog
from impact_rig.present.rerun.sample_plots import MEAN_WIDTH, MODEL_WIDTH, replace_lines
from impact_rig.results.law_curves import LawCurves
from impact_rig.results.numbers import MICRO, format_quantity
from impact_rig.results.palette import BLUE, GREY, VERMILION

if TYPE_CHECKING:
    import rerun as rr

TICK_GAP = 0.5
"""From the axes to the middle of their values [units of the plane], our choice."""
ABOVE_GRID = 21.0
"""Where loops are drawn: Rerun draws lines at 20 [-]."""
TOP_ROOM = 1.05
"""What the axes reach over the largest value [-], our choice."""


def draw_law(plots: PlotLog, sample: str, law: ContactLaw, curves: LawCurves | None) -> None:
    """Draw pulse, law and versed-sine, and what both leave, in place of the ones before.

    Parameters
    ----------
    plots : PlotLog
        Where to.
    sample : str
        Name.
    law : ContactLaw
        Its numbers stand in the legend.
    curves : LawCurves or None
        Of that law; None: there is none, and nothing is drawn.
    """
    pulse = make_body_path(sample, entities.LAW)
    residual = make_body_path(sample, entities.LAW_RESIDUAL)
    if curves is None:
        plots.hide(pulse)
        plots.hide(residual)
        return
    exponent, restitution = format_quantity(law.exponent, 3), format_quantity(law.restitution, 3)
    models = [
        Line(f"law, n = {exponent}, e = {restitution}", BLUE, MODEL_WIDTH),
        Line("versed-sine, lasting τp", VERMILION, MODEL_WIDTH),
    ]
    forces = [curves.law, curves.versed_sine]
    lines = [Line("mean", LIGHT, MEAN_WIDTH), *models]
    replace_lines(plots, pulse, curves.time, [curves.measured, *forces], lines)
    left = [curves.measured - force for force in forces]
    replace_lines(plots, residual, curves.time, left, models)


def draw_loop(stream: rr.RecordingStream, sample: str, curves: LawCurves | None) -> None:
    """Draw force over indentation, measured and as the law has it, in place of those before."""
    loops: list[FloatArray] = []
    grid: list[FloatArray] = []
    labels: list[tuple[float, float, str]] = []
    if curves is not None:
        measured = np.stack([curves.indentation * MICRO, curves.loop_force], axis=1)
        law = np.stack([curves.law_indentation * MICRO, curves.law_force], axis=1)
        deepest, largest = (TOP_ROOM * np.concatenate([measured, law]).max(axis=0)).tolist()

        def place(points: ArrayLike) -> FloatArray:
            # A plane's ordinate points down.
            return np.array([0.0, HEIGHT]) + np.asarray(points) * np.array(
                [WIDTH / deepest, -HEIGHT / largest]
            )

        loops = [place(measured), place(law)]
        for tick in choose_ticks(deepest):
            grid.append(place([(tick, 0.0), (tick, largest)]))
            labels.append((grid[-1][0, 0], HEIGHT + TICK_GAP, f"{tick:g} µm"))
        for tick in choose_ticks(largest):
            grid.append(place([(0.0, tick), (deepest, tick)]))
            labels.append((-2.0 * TICK_GAP, grid[-1][0, 1], f"{tick:g} N"))
    parts = {
        "grid": make_lines(grid, GREY, 1.0),
        "measured": make_lines(loops[:1], LIGHT, MEAN_WIDTH, order=ABOVE_GRID),
        "modelled": make_lines(loops[1:], BLUE, MODEL_WIDTH, order=ABOVE_GRID + 1.0),
        "names": make_labels(labels),
    }
    draw_parts(stream, make_body_path(sample, entities.LOOP), parts)
