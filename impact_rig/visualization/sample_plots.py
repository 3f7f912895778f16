"""The plots of one sample: its hits laid over each other, their mean, the models."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from impact_rig.core.signals.record import FloatArray
from impact_rig.results.palette import (
    CONTACT,
    GREY,
    HAMMER,
    HAMMER_MODEL,
    PURPLE,
    SPECIMEN,
    SPECIMEN_MODEL,
    Colour,
)
from impact_rig.results.sample_traces import (
    DRIVEN,
    IDENTIFIED,
    PRINTED,
    AlignedHit,
    ModelTraces,
    SampleTraces,
)
from impact_rig.visualization import entities
from impact_rig.visualization.entities import BODIES, find_body
from impact_rig.visualization.entities import HAMMER as HAMMER_NAME
from impact_rig.visualization.plots import Line, Mark, PlotLog
from impact_rig.visualization.text import format_percent

MEASURED = {entities.HAMMER: HAMMER, entities.SPECIMEN: SPECIMEN}
"""Colours of what was measured, by body."""
CALCULATED = {entities.HAMMER: HAMMER_MODEL, entities.SPECIMEN: SPECIMEN_MODEL}
"""Colours of what a model says, by body."""
IDENTIFIED_COLOUR: Colour = PURPLE
"""Of the identified model, of either body."""
HIT_OPACITY = 90
"""Of one hit among many, of 255, our choice: ten over each other are nearly solid."""
HIT_WIDTH = 1.0
"""Line width of one hit among many [points]."""
MEASURED_WIDTH = 3.0
"""Line width of a mean trace [points], our choice: the model lies visibly on top."""
MODEL_WIDTH = 1.25
"""Line width of models and residuals [points]."""
CONTACT_WIDTH = 1.0
"""Line width of the contact window [points]."""
POINT_SIZE = 4.0
"""Size of what was read from the mean [points]."""
CONTACT_HEIGHT = 1.05
"""Height of the contact window over the mean's peak [-], our choice."""
EDGE = 1e-9
"""Width of its upright lines [s]: the resolution of the timeline."""


def draw_aligned_hits(plots: PlotLog, hits: Sequence[AlignedHit]) -> None:
    """Lay hits of one sample, of one sampling rate, over each other.

    They are on the same points of time, so they share an entity.
    """
    for body, row in zip(BODIES, range(2), strict=True):
        shown = [hit for hit in hits if hit.traces.shape[0] > row]
        if not shown:
            continue
        time, values = _join_hits(shown, row)
        line = Line("hits", (*MEASURED[body], HIT_OPACITY), HIT_WIDTH)
        family = (*find_body(shown[0].label.sample, body), entities.OVERLAY)
        plots.draw_lines(family, time, values, [line] * len(shown))


def _join_hits(hits: Sequence[AlignedHit], row: int) -> tuple[FloatArray, FloatArray]:
    rate = hits[0].sampling_rate
    starts = [round(hit.start_time * rate) for hit in hits]
    first = min(starts)
    ends = [start + hit.traces.shape[1] for start, hit in zip(starts, hits, strict=True)]
    values = np.full((max(ends) - first, len(hits)), np.nan, dtype=np.float32)
    for column, (start, end, hit) in enumerate(zip(starts, ends, hits, strict=True)):
        values[start - first : end - first, column] = hit.traces[row]
    return (first + np.arange(len(values))) / rate, values


def draw_sample(plots: PlotLog, traces: SampleTraces) -> None:
    """Draw mean, models, residuals and marks of a sample in place of the ones before."""
    for row, body in enumerate(BODIES[: traces.mean.shape[0]]):
        parent = find_body(traces.name, body)
        for part in (entities.CONTACT, entities.MODELS, entities.POINTS):
            plots.hide((*parent, part))
        _draw_models(plots, traces, row, DRIVEN, (DRIVEN, IDENTIFIED))
        _draw_models(plots, traces, row, PRINTED, (PRINTED,))
        _draw_contact(plots, traces, row)
    _draw_half_amplitude(plots, traces)
    _draw_peaks(plots, traces)


def _draw_models(
    plots: PlotLog, traces: SampleTraces, row: int, variant: str, names: Sequence[str]
) -> None:
    body = BODIES[row]
    found = [model for name in names if (model := traces.find_model(name)) is not None]
    title = "mean" if found else "mean (no model)"
    columns = [traces.mean[row]]
    lines = [Line(f"{body}, {title}", MEASURED[body], MEASURED_WIDTH)]
    for model in found:
        columns.append(model.traces[row])
        colour = IDENTIFIED_COLOUR if model.model == IDENTIFIED else CALCULATED[body]
        lines.append(Line(_name_model(model, body), colour, MODEL_WIDTH))
    if found:
        columns.append(traces.find_residual(found[0])[row])
        lines.append(Line(f"{body}, residual", GREY, MODEL_WIDTH))
    family = (*find_body(traces.name, body), entities.MODELS, variant)
    plots.draw_lines(family, traces.time, np.stack(columns, axis=1), lines)


def _name_model(model: ModelTraces, body: str) -> str:
    is_hammer = body == HAMMER_NAME
    error = model.mse_hammer_percent if is_hammer else model.mse_sample_percent
    kind = "identified model" if model.model == IDENTIFIED else "model"
    return f"{body}, {kind} (MSE {format_percent(error)} %)"


def _draw_contact(plots: PlotLog, traces: SampleTraces, row: int) -> None:
    if not math.isfinite(traces.contact_time):
        return
    half = traces.contact_time / 2
    top = CONTACT_HEIGHT * float(np.nanmax(np.abs(traces.mean[row])))
    time = np.array([-half - EDGE, -half, half, half + EDGE])
    values = np.array([[0.0], [top], [top], [0.0]])
    name = f"contact, {traces.contact_time * 1e6:.2f} µs"
    family = (*find_body(traces.name, BODIES[row]), entities.CONTACT)
    plots.draw_lines(family, time, values, [Line(name, CONTACT, CONTACT_WIDTH)])


def _draw_half_amplitude(plots: PlotLog, traces: SampleTraces) -> None:
    if not math.isfinite(traces.half_amplitude_width):
        return
    half = traces.half_amplitude_width / 2
    level = float(np.nanmax(traces.mean[0])) / 2
    name = f"half amplitude, {traces.half_amplitude_width * 1e6:.2f} µs wide"
    family = (*find_body(traces.name, entities.HAMMER), entities.POINTS)
    mark = Mark(name, CONTACT, "diamond", POINT_SIZE)
    plots.draw_points(family, np.array([-half, half]), np.full((2, 1), level), [mark])


def _draw_peaks(plots: PlotLog, traces: SampleTraces) -> None:
    if traces.mean.shape[0] < len(BODIES):
        return
    family = (*find_body(traces.name, entities.SPECIMEN), entities.POINTS)
    for name, time, marker in (
        ("U1", traces.first_peak_time, "up"),
        ("U2", traces.second_peak_time, "down"),
    ):
        if math.isfinite(time):
            height = float(np.interp(time, traces.time, traces.mean[1]))
            mark = Mark(f"{name}, {height:.1f} m/s²", CONTACT, marker, POINT_SIZE)
            plots.draw_points(family, np.array([time]), np.array([[height]]), [mark])
