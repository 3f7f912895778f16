"""The control sample from run to run, as one HTML page."""

from collections.abc import Sequence
from datetime import UTC, datetime
from statistics import fmean

import numpy as np

from impact_rig.core.records import IMPORTED, MEASURED
from impact_rig.present.picture import Curve, Look, Panel, Picture, Plot
from impact_rig.present.report.page import Document, Section
from impact_rig.results.numbers import CONTACT_TIME, STIFFNESS, Measurand
from impact_rig.results.palette import SERIES, format_hex
from impact_rig.results.trend import TrendPoint, tabulate_trend

HEIGHT = 130.0  # of a plot [pt]
MEAN_LOOK = Look(format_hex(SERIES[0]), width=1.0, dashes=(3.7, 1.6))
MOMENTS = 4  # that have a date on the abscissa
DAY = 86_400.0  # [s]


def make_trend_page(points: Sequence[TrendPoint]) -> Document:
    """Return the page: a table and a figure for each control sample."""
    samples = dict.fromkeys(point.sample for point in points)
    origins = dict.fromkeys(point.origin for point in points)
    sections = [
        Section(name, (table, _make_picture([it for it in points if it.sample == name])))
        for name, table in zip(samples, tabulate_trend(points), strict=True)
    ]
    return Document(
        title="The control sample from run to run",
        subtitle="",
        name=", ".join(samples),
        number="",
        banner=f"Origin: {', '.join(origins)}.",
        is_warning=any(kind not in (MEASURED, IMPORTED) for kind in origins),
        facts=(("Runs", str(len(points))), ("From", points[0].began), ("To", points[-1].began)),
        sections=tuple(sections),
    )


def _make_picture(points: Sequence[TrendPoint]) -> Picture:
    caption = "Bars: 95 % intervals, of which all runs share a part. Dashed: the runs' mean."
    panels = draw_trend(points, CONTACT_TIME), draw_trend(points, STIFFNESS)
    return Picture("Contact time and stiffness over time", caption, panels)


def draw_trend(points: Sequence[TrendPoint], item: Measurand) -> Panel:
    """Draw one quantity over the time of its runs."""
    known = [
        (datetime.fromisoformat(f"{point.began}Z").timestamp(), found)
        for point in points
        if (found := getattr(point, item.field)).is_known
    ]
    times = [time for time, _ in known]
    values = [item.scale * found.value for _, found in known]
    bars = [item.scale * found.expanded for _, found in known]
    colour = format_hex(SERIES[0])
    runs = Curve(times, values, Look(colour, width=0.0, marker="o"), y_bars=bars)
    mean = Curve(times, [fmean(values)] * len(values) if values else (), MEAN_LOOK)
    plot = Plot(
        (runs, mean),
        HEIGHT,
        x_label="first hit, UTC",
        y_label=f"{item.sample_symbol} [{item.unit}]",
        x_ticks=_name_times(times),
    )
    return Panel((plot,))


def _name_times(times: Sequence[float]) -> tuple[tuple[float, str], ...]:
    """Return moments at equal distances from the first to the last, with their dates."""
    if not times:
        return ()
    moments = sorted({*np.linspace(min(times), max(times), MOMENTS).tolist()})
    form = "%Y-%m-%d" if max(times) - min(times) > MOMENTS * DAY else "%m-%d %H:%M"
    return tuple((moment, f"{datetime.fromtimestamp(moment, UTC):{form}}") for moment in moments)
