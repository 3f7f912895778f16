"""One contact as it was measured, as its law has it, and as engines show it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.present.figures.markup import ReportFigure, make_figure, make_name
from impact_rig.present.figures.panels import (
    INK,
    choose_looks,
    drawing_style,
    make_handle,
    make_panel,
)
from impact_rig.present.figures.trace_span import cut_trace
from impact_rig.results.numbers import MICRO
from impact_rig.results.sample_traces import SampleTraces
from impact_rig.simulators.check import EngineCheck
from impact_rig.simulators.contact import Contact
from impact_rig.simulators.tables import format_step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT = 170.0
"""Of the axes [pt]."""
POINTS = 401
"""Of the law's pulse [-]."""
SHOWN = 0.8
"""Before and after the middle of the pulse [contact durations], our choice."""
RESOLUTION = 200
"""Of a picture [dpi]."""
MEASURED_LOOK: dict[str, Any] = {"color": INK, "linewidth": 2.6, "alpha": 0.35}
LAW_LOOK: dict[str, Any] = {"color": INK, "linewidth": 1.0}

Pulse = tuple[str, FloatArray, FloatArray, dict[str, Any]]
"""Label, time from the middle [us], force [N] and look of one line."""


def draw_simulators_figure(
    checks: Sequence[EngineCheck], traces: SampleTraces | None
) -> ReportFigure:
    """Draw the pulse of one contact in every engine.

    Parameters
    ----------
    checks : sequence of EngineCheck
        At least one, all of one contact.
    traces : SampleTraces, optional
        The measured mean of that contact.
    """
    contact = checks[0].parameters.contact
    forces = ", ".join(
        f"{check.finest.peak_force:.1f} N in {check.parameters.engine.title}" for check in checks
    )
    return make_figure(
        make_name("simulators", contact.sample),
        f"{contact.sample} in simulators",
        lambda: [_draw_panel(checks, traces)],
        f"Contact force over time. It reaches {contact.peak_force:.1f} N in the contact law"
        f" identified, {forces}.",
        "Laid over each other at the middle of the width at half amplitude. The measured pulse has"
        " been through the low-pass.",
    )


def save_simulators_figure(
    path: Path, suffix: str, checks: Sequence[EngineCheck], traces: SampleTraces | None
) -> None:
    """Write the figure as a file of its own, on white: suffix .svg, .png or .pdf."""
    with drawing_style():
        panel = _draw_panel(checks, traces)
        panel.savefig(path, format=suffix.lstrip("."), dpi=RESOLUTION, facecolor="white")


def _draw_panel(checks: Sequence[EngineCheck], traces: SampleTraces | None) -> "Figure":
    contact = checks[0].parameters.contact
    pulses = [
        *([] if traces is None else [_show_measured(contact, traces)]),
        _show_law(contact),
        *_show_engines(checks),
    ]
    handles = [make_handle(label, **look) for label, _, _, look in pulses]
    panel = make_panel([HEIGHT], [handles])
    (axes,) = panel.axes
    half = SHOWN * contact.duration * MICRO
    for _, time, force, look in pulses:
        axes.plot(*cut_trace(time, force, -half, half), **look)
    axes.set(
        title=f"{contact.sample}, {1e3 * contact.speed:.1f} mm/s",
        xlim=(-half, half),
        xlabel="time from the middle of the pulse [µs]",
        ylabel="force [N]",
    )
    return panel


def _show_measured(contact: Contact, traces: SampleTraces) -> Pulse:
    hammer = traces.mean[0]
    force = contact.hammer_mass * hammer * np.sign(hammer[np.argmax(np.abs(hammer))])
    return "measured", *_centre(traces.time, force), MEASURED_LOOK


def _show_law(contact: Contact) -> Pulse:
    time = np.linspace(-0.5, 1.5, POINTS) * contact.duration
    label = f"contact law, n = {contact.exponent:.2f}"
    return label, *_centre(time, contact.compute_force(time)), LAW_LOOK


def _show_engines(checks: Sequence[EngineCheck]) -> list[Pulse]:
    titles = [check.parameters.engine.title for check in checks]
    looks = choose_looks(titles)
    return [
        (
            f"{title}, steps of {format_step(check.finest.step)}",
            *_centre(check.finest.time, check.finest.force),
            {"color": looks[title].colour, "linestyle": looks[title].dashes, "linewidth": 1.4},
        )
        for title, check in zip(titles, checks, strict=True)
    ]


def _centre(time: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return time from the middle of the width at half amplitude [us], and the force."""
    high = np.flatnonzero(force > 0.5 * force.max())
    return (time - 0.5 * (time[high[0]] + time[high[-1]])) * MICRO, force
