"""The law of one contact: its pulse beside the measured one and a versed-sine, and its loop."""

from typing import TYPE_CHECKING, Any

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.present.figures.markup import ReportFigure, make_figure, make_name
from impact_rig.present.figures.panels import INK, make_handle, make_panel
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
    models = (("law", curves.law, LAW_LOOK), ("versed-sine", curves.versed_sine, VERSED_LOOK))
    handles = [
        make_handle("mean", **MEASURED_LOOK),
        *(make_handle(name, **look) for name, _, look in models),
    ]
    panel = make_panel(HEIGHTS, [handles])
    forces, residuals = panel.axes
    time = curves.time * MICRO
    forces.plot(time, curves.measured, **MEASURED_LOOK, gid="mean-1")
    residuals.axhline(0.0, color=INK, linewidth=0.8, alpha=0.5)
    for name, force, look in models:
        forces.plot(time, force, **look, gid=f"model-{name}")
        residuals.plot(time, curves.measured - force, **look, gid=f"residual-{name}")
    forces.set(title="a) pulse", ylabel="force [N]")
    residuals.set(
        xlim=(time[0], time[-1]),
        xlabel="time from the middle of the hammer pulse [µs]",
        ylabel="residual [N]",
    )
    return panel


def _draw_loop(curves: LawCurves) -> "Figure":
    handles = [make_handle("law", **LAW_LOOK)]
    if curves.indentation.size:
        handles.insert(0, make_handle("from both traces", **MEASURED_LOOK))
    panel = make_panel([sum(HEIGHTS)], [handles])
    (axes,) = panel.axes
    axes.plot(curves.indentation * MICRO, curves.loop_force, **MEASURED_LOOK, gid="loop-mean")
    axes.plot(curves.law_indentation * MICRO, curves.law_force, **LAW_LOOK, gid="loop-law")
    axes.set(title="b) force over indentation", xlabel="indentation [µm]", ylabel="force [N]")
    return panel
