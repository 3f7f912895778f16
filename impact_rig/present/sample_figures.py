"""One sample: its hits, their mean and the models; the law of its contact."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impact_rig.core.records import FloatArray
from impact_rig.present.picture import Curve, Look, Panel, Plot, Text, thin
from impact_rig.results.numbers import MICRO, format_count, format_error
from impact_rig.results.palette import BLUE, PURPLE, VERMILION, format_hex
from impact_rig.results.traces import (
    DRIVEN,
    PRINTED,
    AlignedHit,
    LawCurves,
    SampleTraces,
)

HAMMER = 0
TITLES = ("a) hammer", "b) sample")
MODEL_NAMES = {
    DRIVEN: "force-driven model",
    PRINTED: "model as printed",
}
LOOKS = {
    DRIVEN: Look(format_hex(VERMILION), dashes=(6.0, 1.8)),
    PRINTED: Look(format_hex(PURPLE), dashes=(6.0, 1.8, 1.2, 1.8)),
}
LAW_LOOK = Look(format_hex(BLUE), dashes=(1.2, 1.2))
HIT_LOOK = Look(width=0.7, opacity=0.3)
MEAN_LOOK = Look(width=1.6)
LOOP_LOOK = Look(width=2.6, opacity=0.35)
POINT_LOOK = Look(width=0.0, marker="o", size=6.0, is_hollow=True)
TALL, LOW = 100.0, 36.0
"""Heights of traces, and of the residuals below them [pt]."""

SAMPLE_CAPTION = (
    "In each figure, thin lines: the hits; bold: their mean; shaded: the contact, τp long; w50:"
    " the width at half amplitude; U1, U2: the peaks of the log decrement. Time counts from the"
    " middle of the hammer pulse. Below: measured less model, in its colour and dashes."
)
LOOP_CAPTION = (
    " Force over indentation follows from both traces and the law's impact speed; the loop's area"
    " is the energy lost."
)


def draw_sample(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    curves: LawCurves | None,
    *,
    with_printed: bool = True,
) -> tuple[Panel, ...]:
    """Draw the traces of one sample, hammer and sample apart, and the loop of its law.

    Parameters
    ----------
    traces : SampleTraces
        Mean hit and models.
    hits : sequence of AlignedHit
        Those of the mean.
    curves : LawCurves or None
        Of the contact law; None: there is none.
    with_printed : bool
        Whether the model as printed is drawn even where the driven one is nearer to the sample.
    """
    if not with_printed:
        traces = _leave_out_printed(traces)
    panels = [draw_channel(traces, hits, place, curves) for place in range(len(traces.mean))]
    if curves is not None and curves.indentation.size:
        panels.append(draw_law_loop(curves))
    return tuple(panels)


def _leave_out_printed(traces: SampleTraces) -> SampleTraces:
    """Return traces without the model as printed, where the driven one is nearer to the sample."""
    driven, printed = traces.find_model(DRIVEN), traces.find_model(PRINTED)
    if driven is None or printed is None or printed.mse_percent[-1] < driven.mse_percent[-1]:
        return traces
    return replace(traces, models=tuple(item for item in traces.models if item is not printed))


def draw_channel(
    traces: SampleTraces,
    hits: Sequence[AlignedHit],
    channel: int,
    curves: LawCurves | None = None,
) -> Panel:
    """Draw traces above and residuals below, on one time axis; the law on the hammer's."""
    law = curves if channel == HAMMER else None
    start = -1.2 * traces.contact_time
    stop = np.nanmax([4.0 * traces.contact_time, 1.2 * traces.second_peak_time])

    def make_curve(time: FloatArray, values: FloatArray, look: Look, name: str = "") -> Curve:
        first, end = np.searchsorted(time, (start, stop)).tolist()
        places = first + thin(values[first:end])
        return Curve(MICRO * time[places], values[places], look, name)

    name = format_count(len(hits), "hit")
    upper = [make_curve(hit.time, hit.traces[channel], HIT_LOOK, name) for hit in hits]
    upper.append(make_curve(traces.time, traces.mean[channel], MEAN_LOOK, "mean"))
    lower = []
    for model in traces.models:
        look, left = LOOKS[model.model], traces.compute_residual(model)[channel]
        name = f"{MODEL_NAMES[model.model]}, MSE {format_error(model.mse_percent[channel])} %"
        upper.append(make_curve(traces.time, model.traces[channel], look, name))
        lower.append(make_curve(traces.time, left, look))
    if law is not None:
        left = np.interp(law.time, traces.time, traces.mean[HAMMER]) - law.acceleration
        upper.append(make_curve(law.time, law.acceleration, LAW_LOOK, "contact law"))
        lower.append(make_curve(law.time, left, LAW_LOOK))
    points = _list_points(traces, channel)
    marks = [Curve([x for x, *_ in points], [y for _, y, _ in points], POINT_LOOK)]
    half = 0.5 * MICRO * traces.contact_time
    plot = Plot(
        (*upper, *marks),
        TALL if lower else TALL + LOW,
        title=TITLES[channel],
        y_label="a [m/s²]",
        texts=tuple(Text(*point) for point in points),
        band=(-half, half),
    )
    residual = Plot(tuple(lower), LOW, y_label="residual", band=plot.band)
    plots = (plot, residual) if lower else (plot,)
    label = "time from the middle of the hammer pulse [µs]"
    return Panel((*plots[:-1], replace(plots[-1], x_label=label)))


def _list_points(traces: SampleTraces, channel: int) -> list[tuple[float, float, str]]:
    """Return the ends of the hammer pulse's width, or the sample's U1 and U2, with their names."""
    if channel != HAMMER:
        return [(MICRO * time, level, name) for name, time, level in traces.peak_points]
    names = ("", f"w50 {traces.half_amplitude_width * MICRO:.1f} µs")
    ends = zip(traces.half_amplitude_points, names, strict=False)
    return [(MICRO * time, level, name) for (time, level), name in ends]


def draw_law_loop(curves: LawCurves) -> Panel:
    """Draw force over indentation."""
    law = Curve(curves.law_indentation * MICRO, curves.law_force, LAW_LOOK, "law")
    measured = Curve(curves.indentation * MICRO, curves.loop_force, LOOP_LOOK, "from both traces")
    plot = Plot(
        (measured, law),
        TALL + LOW,
        title="c) force over indentation",
        x_label="indentation [µm]",
        y_label="force [N]",
    )
    return Panel((plot,))
