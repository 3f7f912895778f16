"""The control sample from run to run, as one HTML page."""

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from impact_rig.core.records import IMPORTED, MEASURED
from impact_rig.present.picture import Picture, drawing_style, make_panel, make_picture
from impact_rig.present.report.page import Document, Section
from impact_rig.results.numbers import CONTACT_TIME, STIFFNESS, Measurand
from impact_rig.results.palette import SERIES, format_hex
from impact_rig.results.trend import TrendPoint, tabulate_trend

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def make_trend_page(points: Sequence[TrendPoint], left_out: Sequence[str]) -> Document:
    """Return the page: a table and a figure for each control sample, and which runs have none."""
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
        facts=(
            ("Runs", str(len(points))),
            ("From", points[0].began),
            ("To", points[-1].began),
            *[("Left out", told) for told in left_out],
        ),
        sections=tuple(sections),
    )


def _make_picture(points: Sequence[TrendPoint]) -> Picture:
    caption = "Bars: 95 % intervals, of which all runs share a part. Dashed: the runs' mean."
    panels = (draw_trend(points, item) for item in (CONTACT_TIME, STIFFNESS))
    with drawing_style():
        return make_picture("Contact time and stiffness over time", caption, panels)


def draw_trend(points: Sequence[TrendPoint], item: Measurand) -> "Figure":
    """Draw one quantity over the time of its runs."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

    panel = make_panel(1.75)
    (axes,) = panel.axes
    known = [(point, found) for point in points if (found := getattr(point, item.field)).is_known]
    times = [date2num(datetime.fromisoformat(point.began)) for point, _ in known]
    values = [item.scale * found.value for _, found in known]
    bars = [item.scale * found.expanded for _, found in known]
    axes.set(ylabel=f"{item.sample_symbol} [{item.unit}]", xlabel="first hit, UTC")
    colour = format_hex(SERIES[0])
    axes.errorbar(times, values, yerr=bars, color=colour, marker="o", linestyle="none")
    if values:
        axes.axhline(sum(values) / len(values), color=colour, linestyle="--", linewidth=1.0)
        # An hour at least: runs may be of one minute, by which their times are told.
        middle, half = (times[0] + times[-1]) / 2, max(0.55 * (times[-1] - times[0]), 1 / 48)
        axes.set_xlim(middle - half, middle + half)
    # With fewer ticks allowed some ranges would have none that fit.
    locator = AutoDateLocator(minticks=3, maxticks=7)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    return panel
