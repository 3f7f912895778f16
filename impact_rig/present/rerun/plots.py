"""Lines and points over the time inside the hit, and the plots of one sample.

Traces are one entity with a column per line (five times smaller and faster than an entity per
line), as float32, with their peaks kept at any zoom. Rerun cannot delete logged data, so a new
drawing is a new entity. The replaced one is hidden and called "earlier"; a click in the legend
shows it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.given.records import FloatArray
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.entities import BODIES, HIT_TIME, Path, make_body_path
from impact_rig.present.rerun.viewers import import_rerun
from impact_rig.results.numbers import MICRO, format_error, format_quantity
from impact_rig.results.palette import (
    BLUE,
    CONTACT,
    GREY,
    HAMMER,
    HAMMER_MODEL,
    SPECIMEN,
    SPECIMEN_MODEL,
    VERMILION,
)
from impact_rig.results.traces import (
    DRIVEN,
    AlignedHit,
    Float32Array,
    LawCurves,
    SampleTraces,
    find_peak,
)

if TYPE_CHECKING:
    import rerun as rr

EARLIER = "earlier"
"""Name of all replaced lines."""
SENTENCE = "sentence"
"""Parent of lines that say something, below the family that they are about."""

OPAQUE = 255
"""Full opacity."""
Shade = tuple[int, int, int] | tuple[int, int, int, int]
"""Red, green, blue and perhaps opacity, 0 to 255."""


class Look(NamedTuple):
    """The look of one column. Those of one name share their entry in the legend."""

    name: str
    colour: Shade
    size: float  # width of a line, size of a mark [points]
    marker: str = ""  # of points; empty: a line


class PlotLog:
    """Draws into one Rerun recording.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._versions: Counter[Path] = Counter()
        self._shown: dict[Path, list[tuple[str, Sequence[Look]]]] = {}
        self._said: dict[Path, str] = {}  # by the family that shows nothing else

    def draw(
        self,
        family: Path,
        time: FloatArray,
        values: NDArray[Any],
        looks: Sequence[Look],
        *,
        keeps_peaks: bool = True,
    ) -> str:
        """Draw lines or points beside what the family shows already.

        Parameters
        ----------
        family : tuple of str
            Parent of the entity.
        time : ndarray, shape (n,)
            [s]
        values : ndarray, shape (n, columns)
            A NaN breaks its line, or has no point.
        looks : sequence of Look
            One per column: all lines, or all points.
        keeps_peaks : bool
            Where several points share a pixel, draw the lowest and the highest. Not for a few
            points whose order matters.

        Returns
        -------
        str
            Path of the entity.
        """
        path = self.add(family, looks, keeps_peaks=keeps_peaks)
        if time.size:
            nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
            indexes = [self._rr.TimeColumn(HIT_TIME, duration=nanoseconds)]
            self._stream.send_columns(path, indexes=indexes, columns=[make_scalars(values)])
        return path

    def add(self, family: Path, looks: Sequence[Look], *, keeps_peaks: bool = True) -> str:
        """Return the path of a new entity whose values the caller logs, on any timeline."""
        self._versions[family] += 1
        path = str(self._rr.new_entity_path([*family, str(self._versions[family])]))
        self._shown.setdefault(family, []).append((path, looks))
        names, shades, sizes, markers = (list(column) for column in zip(*looks, strict=True))
        if markers[0]:
            style = self._rr.SeriesPoints(
                names=names, colors=_pack(shades), markers=markers, marker_sizes=sizes
            )
        else:
            policy = "MinMax" if keeps_peaks else "Off"
            style = self._rr.SeriesLines(
                names=names, colors=_pack(shades), widths=sizes, aggregation_policy=policy
            )
        self._stream.log(path, style, static=True)
        return path

    def write(self, family: Path, sentence: str) -> None:
        """Say in a plot why it shows nothing: as the name of a line at zero."""
        if self._said.get(family) == sentence:
            return
        self.hide(family)
        self._said[family] = sentence
        line = Look(sentence, GREY, MEAN_WIDTH)
        place = (*family, SENTENCE)
        self.draw(place, np.array([0.0, MOMENT]), np.zeros((2, 1)), [line])

    def write_in_blanks(self, families: Iterable[Path], sentence: str) -> None:
        """Say it in the plots that show nothing."""
        for family in families:
            if family not in self._shown and family not in self._said:
                self.write(family, sentence)

    def hide(self, parent: Path = ()) -> None:
        """Hide all lines at or below `parent`; without it, all."""
        for family in [item for item in self._shown if item[: len(parent)] == parent]:
            self._said.pop(family[:-1], None)
            for path, looks in self._shown.pop(family):
                count = len(looks)
                archetype = self._rr.SeriesPoints if looks[0].marker else self._rr.SeriesLines
                hidden = archetype.from_fields(
                    visible_series=[False] * count,
                    names=[EARLIER] * count,
                    colors=_pack([GREY] * count),
                )
                self._stream.log(path, hidden, static=True)


def make_scalars(values: NDArray[Any]) -> rr.ComponentColumn:
    """Return rows of scalars, shape (n, columns), as Rerun takes them, in single precision."""
    sdk = import_rerun()
    rows, columns = values.shape
    descriptor = sdk.Scalars.descriptor_scalars()
    # Rerun's own class for scalars would make them twice as large.
    column: rr.ComponentColumn = sdk.ComponentColumn(
        descriptor,
        sdk.AnyBatchValue(descriptor, values.astype(np.float32).reshape(-1)),
        offsets=np.arange(0, rows * columns + 1, columns, dtype=np.int32),
    )
    return column


def _pack(shades: Sequence[Shade]) -> NDArray[np.uint32]:
    """Return colours as Rerun stores them; its own conversion takes longer than the logging."""
    return np.array(
        [int.from_bytes([*shade, OPAQUE][:4], "big") for shade in shades], dtype=np.uint32
    )


MEASURED = {entities.HAMMER: HAMMER, entities.SPECIMEN: SPECIMEN}
"""Colours of measured traces, by body."""
CALCULATED = {entities.HAMMER: HAMMER_MODEL, entities.SPECIMEN: SPECIMEN_MODEL}
"""Colours of models, by body."""
HIT_OPACITY = 90
"""Opacity of one hit among many, of 255; ten over each other are nearly solid."""
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
MOMENT = 0.2e-3
"""Length of the line whose name is a sentence [s]: as a contact, since hidden it has room too."""
THINNING = 2
"""Means and models are smooth: every second point is drawn, and the peaks."""


def draw_aligned_hits(plots: PlotLog, hits: Sequence[AlignedHit]) -> None:
    """Draw aligned hits of one sample and one sampling rate.

    They have the same points of time, so they share an entity.
    """
    for row, body in enumerate(BODIES):
        shown = [hit for hit in hits if hit.traces.shape[0] > row]
        if shown:
            time, values = _join_hits(shown, row)
            line = Look("each hit", (*MEASURED[body], HIT_OPACITY), HIT_WIDTH)
            family = (*make_body_path(shown[0].label.sample, body), entities.OVERLAY)
            plots.draw(family, time, values, [line] * len(shown))


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
    for row, body in enumerate(BODIES):
        parent = make_body_path(traces.name, body)
        if row == traces.mean.shape[0]:
            plots.write((*parent, entities.MODELS), "Nothing measured.")
            break
        columns, lines = _gather_lines(traces, row)
        _replace_lines(plots, (*parent, entities.MODELS), traces.time, columns, lines)
        plots.hide((*parent, entities.CONTACT))
        plots.hide((*parent, entities.POINTS))
        _draw_contact(plots, traces, row)
    _draw_points(plots, traces)


def _gather_lines(traces: SampleTraces, row: int) -> tuple[list[FloatArray], list[Look]]:
    """Return the lines of one body: its mean, the driven model, the residual."""
    body, model = BODIES[row], traces.find_model(DRIVEN)
    mean = traces.mean[row]
    if model is None:
        return [mean], [Look(f"{body}, mean (no model)", MEASURED[body], MEAN_WIDTH)]
    error = format_error(model.mse_percent[row])
    return [mean, model.traces[row], traces.compute_residual(model)[row]], [
        Look(f"{body}, mean", MEASURED[body], MEAN_WIDTH),
        Look(f"{body}, model (MSE {error} %)", CALCULATED[body], MODEL_WIDTH),
        Look(f"{body}, residual of the model", GREY, MODEL_WIDTH),
    ]


def _replace_lines(
    plots: PlotLog,
    family: Path,
    time: FloatArray,
    columns: Sequence[FloatArray],
    lines: Sequence[Look],
) -> None:
    """Draw smooth lines, every second point and the peaks; they replace older ones."""
    is_drawn = np.zeros(time.size, dtype=bool)
    is_drawn[::THINNING] = True
    for column in columns:
        is_drawn[np.argmax(np.nan_to_num(np.abs(column)))] = True
    rows = np.flatnonzero(is_drawn)
    values = np.stack([column[rows].astype(np.float32) for column in columns], axis=1)
    plots.hide(family)
    plots.draw(family, time[rows], values, lines)


def _draw_contact(plots: PlotLog, traces: SampleTraces, row: int) -> None:
    if not math.isfinite(traces.contact_time):
        return
    half = traces.contact_time / 2
    top = CONTACT_HEIGHT * find_peak(traces.mean[row])
    plots.draw(
        (*make_body_path(traces.name, BODIES[row]), entities.CONTACT),
        np.array([-half - EDGE, -half, half, half + EDGE]),
        np.array([[0.0], [top], [top], [0.0]]),
        [Look(f"contact, {traces.contact_time * MICRO:.2f} µs", CONTACT, CONTACT_WIDTH)],
        keeps_peaks=False,
    )


def _draw_points(plots: PlotLog, traces: SampleTraces) -> None:
    """Mark the width of the hammer pulse, and U1 and U2 of the sample."""
    points = traces.half_amplitude_points
    if points:
        times, levels = np.array(points).T
        name = f"half amplitude, {traces.half_amplitude_width * MICRO:.2f} µs wide"
        plots.draw(
            (*make_body_path(traces.name, entities.HAMMER), entities.POINTS),
            times,
            levels[:, np.newaxis],
            [Look(name, CONTACT, POINT_SIZE, "diamond")],
        )
    peaks = traces.peak_points
    if peaks:
        values = np.full((len(peaks), len(peaks)), np.nan)
        np.fill_diagonal(values, [height for *_, height in peaks])
        plots.draw(
            (*make_body_path(traces.name, entities.SPECIMEN), entities.POINTS),
            np.array([time for _, time, _ in peaks]),
            values,
            [
                Look(f"{name}, {height:.1f} m/s²", CONTACT, POINT_SIZE, PEAK_MARKERS[name])
                for name, _, height in peaks
            ],
        )


def draw_law(plots: PlotLog, sample: str, law: ContactLaw, curves: LawCurves | None) -> None:
    """Draw pulse, law and versed-sine, and both residuals; they replace older ones.

    Without `curves` the plots say why.
    """
    pulse = make_body_path(sample, entities.LAW)
    residual = make_body_path(sample, entities.LAW_RESIDUAL)
    if curves is None:
        why = "; ".join(note.explanation for note in law.notes)
        plots.write(pulse, f"No contact law is given{': ' * bool(why)}{why}.")
        plots.write(residual, "No residual, since no contact law is given.")
        return
    exponent, restitution = format_quantity(law.exponent, 3), format_quantity(law.restitution, 3)
    models = [
        Look(f"law, n = {exponent}, e = {restitution}", BLUE, MODEL_WIDTH),
        Look("versed-sine, lasting τp", VERMILION, MODEL_WIDTH),
    ]
    forces = [curves.law, curves.versed_sine]
    lines = [Look("mean", GREY, MEAN_WIDTH), *models]
    _replace_lines(plots, pulse, curves.time, [curves.measured, *forces], lines)
    left = [curves.measured - force for force in forces]
    _replace_lines(plots, residual, curves.time, left, models)
