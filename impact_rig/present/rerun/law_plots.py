"""The contact law of one sample: its pulse beside law and versed-sine, and both residuals."""

from __future__ import annotations

from impact_rig.core.contact_law import ContactLaw
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import make_body_path
from impact_rig.present.rerun.plots import Line, PlotLog
from impact_rig.present.rerun.sample_plots import MEAN_WIDTH, MODEL_WIDTH, replace_lines
from impact_rig.results.law_curves import LawCurves
from impact_rig.results.numbers import format_quantity
from impact_rig.results.palette import BLUE, GREY, VERMILION


def draw_law(plots: PlotLog, sample: str, law: ContactLaw, curves: LawCurves | None) -> None:
    """Draw pulse, law and versed-sine, and both residuals; they replace older ones.

    Without `curves` nothing is drawn.
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
    lines = [Line("mean", GREY, MEAN_WIDTH), *models]
    replace_lines(plots, pulse, curves.time, [curves.measured, *forces], lines)
    left = [curves.measured - force for force in forces]
    replace_lines(plots, residual, curves.time, left, models)
