"""The plots of one sample: its aligned hits, their mean, the models, the contact law."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.records import FloatArray
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import BODIES, Path, make_body_path
from impact_rig.present.rerun.plots import Line, Mark, PlotLog
from impact_rig.results.numbers import MICRO, format_error, format_quantity
from impact_rig.results.palette import (
    BLUE,
    CONTACT,
    GREY,
    HAMMER,
    HAMMER_MODEL,
    PURPLE,
    SPECIMEN,
    SPECIMEN_MODEL,
    VERMILION,
)
from impact_rig.results.traces import (
    DRIVEN,
    IDENTIFIED,
    AlignedHit,
    Float32Array,
    LawCurves,
    ModelTraces,
    SampleTraces,
    find_peak,
)

MEASURED = {entities.HAMMER: HAMMER, entities.SPECIMEN: SPECIMEN}
"""Colours of measured traces, by body."""
CALCULATED = {entities.HAMMER: HAMMER_MODEL, entities.SPECIMEN: SPECIMEN_MODEL}
"""Colours of models, by body; the identified model is `PURPLE`."""
HIT_OPACITY = 90
"""Of one hit among many, of 255; ten over each other are nearly solid."""
HIT_WIDTH = 1.0
"""Line width of one hit among many [points]."""
MEAN_WIDTH = 3.5
"""Line width of a mean trace [points]: the models lie visibly on top."""
MODEL_WIDTH = 1.5
"""Line width of models and residuals [points]."""
CONTACT_WIDTH = 1.0
"""Line width of the contact window [points]."""
POINT_SIZE = 5.0
"""Size of marks on the mean [points]."""
CONTACT_HEIGHT = 1.1
"""Height of the contact window over the mean's peak [-]."""
PEAK_MARKERS = {"U1": "up", "U2": "down"}
EDGE = 1e-9
"""Width of the window's upright lines [s]: the resolution of the timeline."""
THINNING = 2
"""Of means and models, which are smooth, every second point is drawn, and the peaks."""


def draw_aligned_hits(plots: PlotLog, hits: Sequence[AlignedHit]) -> None:
    """Draw aligned hits of one sample and one sampling rate.

    They have the same points of time, so they share an entity.
    """
    for row, body in enumerate(BODIES):
        shown = [hit for hit in hits if hit.traces.shape[0] > row]
        if shown:
            time, values = _join_hits(shown, row)
            line = Line("each hit", (*MEASURED[body], HIT_OPACITY), HIT_WIDTH)
            family = (*make_body_path(shown[0].label.sample, body), entities.OVERLAY)
            plots.draw_lines(family, time, values, [line] * len(shown))


def _join_hits(hits: Sequence[AlignedHit], row: int) -> tuple[FloatArray, Float32Array]:
    rate = hits[0].sampling_rate
    starts = [round(hit.start_time * rate) for hit in hits]
    first = min(starts)
    ends = [start + hit.traces.shape[1] for start, hit in zip(starts, hits, strict=True)]
    values = np.full((max(ends) - first, len(hits)), np.nan, dtype=np.float32)
    for column, (start, end, hit) in enumerate(zip(starts, ends, hits, strict=True)):
        values[start - first : end - first, column] = hit.traces[row]
    return (first + np.arange(len(values))) / rate, values


def draw_sample(plots: PlotLog, traces: SampleTraces) -> None:
    """Draw mean, models, residuals and marks of a sample; they replace older ones."""
    bodies = BODIES[: traces.mean.shape[0]]
    for row, body in enumerate(bodies):
        parent = make_body_path(traces.name, body)
        columns, lines = _gather_lines(traces, row, (DRIVEN, IDENTIFIED))
        _replace_lines(plots, (*parent, entities.MODELS), traces.time, columns, lines)
        plots.hide((*parent, entities.CONTACT))
        plots.hide((*parent, entities.POINTS))
        _draw_contact(plots, traces, row)
    _draw_points(plots, traces)


def _gather_lines(
    traces: SampleTraces, row: int, models: Sequence[str]
) -> tuple[list[FloatArray], list[Line]]:
    """Return the lines of one body: the mean, its models, the residual."""
    body = BODIES[row]
    found = [model for name in models if (model := traces.find_model(name)) is not None]
    columns = [traces.mean[row]]
    name = f"{body}, mean" if found else f"{body}, mean (no model)"
    lines = [Line(name, MEASURED[body], MEAN_WIDTH)]
    # The last is drawn on top: the first model, which the paper's figures show.
    for model in reversed(found):
        columns.append(model.traces[row])
        colour = PURPLE if model.model == IDENTIFIED else CALCULATED[body]
        lines.append(Line(_name_model(model, row), colour, MODEL_WIDTH))
    if found:
        columns.append(traces.compute_residual(found[0])[row])
        lines.append(Line(f"{body}, residual of the model", GREY, MODEL_WIDTH))
    return columns, lines


def _name_model(model: ModelTraces, row: int) -> str:
    kind = "identified model" if model.model == IDENTIFIED else "model"
    return f"{BODIES[row]}, {kind} (MSE {format_error(model.mse_percent[row])} %)"


def _replace_lines(
    plots: PlotLog,
    family: Path,
    time: FloatArray,
    columns: Sequence[FloatArray],
    lines: Sequence[Line],
) -> None:
    """Draw smooth lines, every second point and the peaks; they replace older ones."""
    is_drawn = np.zeros(time.size, dtype=bool)
    is_drawn[::THINNING] = True
    for column in columns:
        is_drawn[np.argmax(np.nan_to_num(np.abs(column)))] = True
    rows = np.flatnonzero(is_drawn)
    values = np.stack([column[rows].astype(np.float32) for column in columns], axis=1)
    plots.hide(family)
    plots.draw_lines(family, time[rows], values, lines)


def _draw_contact(plots: PlotLog, traces: SampleTraces, row: int) -> None:
    if not math.isfinite(traces.contact_time):
        return
    half = traces.contact_time / 2
    top = CONTACT_HEIGHT * find_peak(traces.mean[row])
    plots.draw_lines(
        (*make_body_path(traces.name, BODIES[row]), entities.CONTACT),
        np.array([-half - EDGE, -half, half, half + EDGE]),
        np.array([[0.0], [top], [top], [0.0]]),
        [Line(f"contact, {traces.contact_time * MICRO:.2f} µs", CONTACT, CONTACT_WIDTH)],
        keeps_peaks=False,
    )


def _draw_points(plots: PlotLog, traces: SampleTraces) -> None:
    """Mark the width of the hammer pulse, and U1 and U2 of the sample."""
    points = traces.half_amplitude_points
    if points:
        times, levels = np.array(points).T
        name = f"half amplitude, {traces.half_amplitude_width * MICRO:.2f} µs wide"
        plots.draw_points(
            (*make_body_path(traces.name, entities.HAMMER), entities.POINTS),
            times,
            levels[:, np.newaxis],
            [Mark(name, CONTACT, "diamond", POINT_SIZE)],
        )
    peaks = traces.peak_points
    if peaks:
        values = np.full((len(peaks), len(peaks)), np.nan)
        np.fill_diagonal(values, [height for *_, height in peaks])
        plots.draw_points(
            (*make_body_path(traces.name, entities.SPECIMEN), entities.POINTS),
            np.array([time for _, time, _ in peaks]),
            values,
            [
                Mark(f"{name}, {height:.1f} m/s²", CONTACT, PEAK_MARKERS[name], POINT_SIZE)
                for name, _, height in peaks
            ],
        )


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
    _replace_lines(plots, pulse, curves.time, [curves.measured, *forces], lines)
    left = [curves.measured - force for force in forces]
    _replace_lines(plots, residual, curves.time, left, models)
