"""The law of one contact: its pulse beside the measured one and a versed-sine, and its loop."""

from typing import TYPE_CHECKING, Any

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.present.figures.decimation import decimate_trace
from impact_rig.present.figures.markup import ReportFigure, make_figure, make_name
from impact_rig.present.figures.panels import INK, make_panel
from impact_rig.results.law_curves import LawCurves
from impact_rig.results.numbers import MICRO, format_quantity
from impact_rig.results.palette import BLUE, VERMILION, format_hex

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHTS = (140.0, 68.0)
"""Of the axes of forces and of residuals [pt]."""
MEASURED_LOOK: dict[str, Any] = {"color": INK, "linewidth": 2.6, "alpha": 0.35}
LAW_LOOK: dict[str, Any] = {"color": format_hex(BLUE), "linewidth": 1.2}
VERSED_LOOK: dict[str, Any] = {
    "color": format_hex(VERMILION),
    "linestyle": (0, (5, 1.5)),
    "linewidth": 1.2,
}


def draw_law_figure(sample: SampleEstimate, curves: LawCurves) -> ReportFigure:
    """Draw pulse, residuals and force-indentation loop of one contact.

    Parameters
    ----------
    sample : SampleEstimate
        With its contact law.
    curves : LawCurves
        Of that law.
    """
    law = sample.contact_law
    exponent, restitution = format_quantity(law.exponent, 3), format_quantity(law.restitution, 3)
    return make_figure(
        make_name("law", sample.name),
        f"{sample.name}: contact law, n = {exponent}, e = {restitution}",
        lambda: [_draw_pulse(curves), _draw_loop(curves)],
        f"Force over time and over indentation. The contact lasts"
        f" {format_quantity(law.duration, 1, MICRO)} µs and reaches"
        f" {law.peak_force.value:.1f} N and {law.peak_indentation.value * MICRO:.2f} µm; the law"
        f" leaves {law.residual_percent:.2f} % of the peak.",
        "Law and versed-sine, of τp and the measured height, have been through the low-pass. The"
        " measured loop follows from both traces and the law's impact speed; its area is the"
        " energy lost.",
    )


def _draw_pulse(curves: LawCurves) -> "Figure":
    from matplotlib.lines import Line2D

    models = (("law", curves.law, LAW_LOOK), ("versed-sine", curves.versed_sine, VERSED_LOOK))
    handles = [
        Line2D([], [], **MEASURED_LOOK, label="mean"),
        *(Line2D([], [], **look, label=name) for name, _, look in models),
    ]
    panel = make_panel(HEIGHTS, [handles])
    forces, residuals = panel.axes
    time = curves.time * MICRO
    forces.plot(*decimate_trace(time, curves.measured), **MEASURED_LOOK, gid="mean-1")
    residuals.axhline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for name, force, look in models:
        forces.plot(*decimate_trace(time, force), **look, gid=f"model-{name}")
        left = decimate_trace(time, curves.measured - force)
        residuals.plot(*left, **look, gid=f"residual-{name}")
    forces.set(title="a) pulse", ylabel="force [N]")
    residuals.set(
        xlim=(time[0], time[-1]),
        xlabel="time from the middle of the hammer pulse [µs]",
        ylabel="residual [N]",
    )
    return panel


def _draw_loop(curves: LawCurves) -> "Figure":
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **LAW_LOOK, label="law")]
    if curves.indentation.size:
        handles.insert(0, Line2D([], [], **MEASURED_LOOK, label="from both traces"))
    panel = make_panel([sum(HEIGHTS)], [handles])
    (axes,) = panel.axes
    axes.plot(curves.indentation * MICRO, curves.loop_force, **MEASURED_LOOK, gid="loop-mean")
    axes.plot(curves.law_indentation * MICRO, curves.law_force, **LAW_LOOK, gid="loop-law")
    axes.set(title="b) force over indentation", xlabel="indentation [µm]", ylabel="force [N]")
    return panel
