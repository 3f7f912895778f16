"""One sample: its hits, their mean, the models, and what the models leave."""

import math
from collections.abc import Sequence

from impact_rig.reporting.figures.figure import ReportFigure
from impact_rig.reporting.figures.names import make_name
from impact_rig.reporting.figures.sample_panel import MODEL_NAMES, draw_sample_panel, make_scene
from impact_rig.reporting.figures.style import drawing_style
from impact_rig.reporting.figures.vector import render_panels
from impact_rig.reporting.figures.words import format_count, format_percent
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MEGA, MICRO, format_uncertain
from impact_rig.results.sample_traces import AlignedHit, SampleTraces


def draw_sample_figure(
    sample: SampleResults,
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    *,
    prefix: str = "",
) -> ReportFigure:
    """Draw the traces of one sample, hammer and sample apart, residuals below.

    Parameters
    ----------
    sample : SampleResults
        The numbers.
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean; hits of other samples are left out.
    prefix : str
        Put before the figure's name: a page with several campaigns needs one for each.

    Returns
    -------
    ReportFigure
        With the sample's tau_p, k2 and c2 in its title.
    """
    name = make_name(prefix, "sample", traces.name)
    own = tuple(hit for hit in hits if hit.label.sample == traces.name)
    with drawing_style():
        panels = [
            draw_sample_panel(make_scene(traces, own, channel))
            for channel in range(traces.mean.shape[0])
        ]
        svg = render_panels(name, panels)
    return ReportFigure(
        name,
        _make_title(sample),
        svg,
        _describe(sample, traces, len(own)),
        _explain(traces),
    )


def _make_title(sample: SampleResults) -> str:
    return f"{sample.name}: {', '.join(_list_numbers(sample))}"


def _list_numbers(sample: SampleResults) -> list[str]:
    """Return tau_p, k2 and c2 with their 95 % intervals, those that are known."""
    numbers = (
        ("τp", sample.contact_time_s, sample.contact_time_expanded_s, MICRO, 2, "µs"),
        ("k2", sample.stiffness_n_per_m, sample.stiffness_expanded_n_per_m, MEGA, 2, "MN/m"),
        (
            "c2",
            sample.damping_coefficient_n_s_per_m,
            sample.damping_coefficient_expanded_n_s_per_m,
            1.0,
            1,
            "N s/m",
        ),
    )
    return [
        f"{symbol} {format_uncertain(value * scale, expanded * scale, digits)} {unit}"
        for symbol, value, expanded, scale, digits, unit in numbers
        if math.isfinite(value)
    ]


def _describe(sample: SampleResults, traces: SampleTraces, hits: int) -> str:
    text = (
        f"Acceleration of hammer and sample over time for {sample.name}:"
        f" {format_count(hits, 'hit')} and their mean,"
        f" {', '.join(_list_numbers(sample))}."
    )
    peaks = [
        f"{peak:.0f} m/s² at the {whose}"
        for whose, peak in (
            ("hammer", sample.hammer_peak_m_per_s2),
            ("sample", sample.specimen_peak_m_per_s2),
        )
        if math.isfinite(peak)
    ]
    if peaks:
        text += f" The mean reaches {' and '.join(peaks)}."
    return text + "".join(
        f" Mean square error of the {MODEL_NAMES[model.model]}: hammer"
        f" {format_percent(model.mse_hammer_percent)}, sample"
        f" {format_percent(model.mse_sample_percent)}."
        for model in traces.models
    )


def _explain(traces: SampleTraces) -> str:
    text = (
        "Thin lines: the hits; bold: their mean; shaded: the contact, τp long; w50: the width at"
        " half amplitude. Time counts from the middle of the hammer pulse."
    )
    if math.isfinite(traces.first_peak_time) and math.isfinite(traces.second_peak_time):
        text += " U1, U2: the peaks of the log decrement."
    if traces.models:
        return text + " Below: measured less model, each model in its colour and dashes."
    return text + " No model could be laid over this sample."
