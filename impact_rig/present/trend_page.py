"""The yearly routine on one HTML page: control sample and check mass by run, calibrations."""

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.core.given.records import IMPORTED, MEASURED
from impact_rig.core.given.setup import RigSetup
from impact_rig.present.picture import Picture, drawing_style, make_panel, make_picture
from impact_rig.present.report.page import Document, Section, drop_empty
from impact_rig.results.numbers import CONTACT_TIME, Measurand
from impact_rig.results.palette import SERIES, format_hex
from impact_rig.results.table import Table, list_table, make_text_column
from impact_rig.results.trend import FOLLOWED, TrendPoint, follow, tabulate_trend

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def make_trend_page(
    points: Sequence[TrendPoint], left_out: Sequence[str], setup: RigSetup, today: str
) -> Document:
    """Return the page: a table and control charts for each control sample, and calibrations.

    Parameters
    ----------
    setup : RigSetup
        Of the newest run: its sensors are listed.
    today : str
        Year-month-day, on which calibrations may be too old.
    """
    samples = dict.fromkeys(point.sample for point in points)
    origins = dict.fromkeys(point.origin for point in points)
    sections = [
        Section(name, (table, _make_picture([it for it in points if it.sample == name])))
        for name, table in zip(samples, tabulate_trend(points), strict=True)
    ]
    sections.append(Section("Calibrations", tuple(tabulate_sensors(setup, today))))
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
        sections=drop_empty(*sections),
        has_annex=False,
    )


def tabulate_sensors(setup: RigSetup, today: str) -> list[Table]:
    """Return the sensors with the dates of their calibrations, and which of them are too old."""
    sensors = setup.sensors
    columns = [
        make_text_column("Sensor", [sensor.channel for sensor in sensors]),
        make_text_column("Serial number", [sensor.serial_number for sensor in sensors]),
        make_text_column("Calibrated", [it.calibration_date or "not stated" for it in sensors]),
        make_text_column("To do", [it.describe_age(today) or "" for it in sensors]),
    ]
    return list_table(f"Sensors of the newest run, on {today}", columns)


def _make_picture(points: Sequence[TrendPoint]) -> Picture:
    caption = (
        "Bars: 95 % intervals. Grey: where a run lies that differs from the mean of the others by"
        " no more than chance."
    )
    panels = (draw_trend(points, item) for item in FOLLOWED)
    with drawing_style():
        return make_picture("Control charts over the time of the runs", caption, panels)


def draw_trend(points: Sequence[TrendPoint], item: Measurand = CONTACT_TIME) -> "Figure":
    """Draw the control chart of one quantity: its values over time, each with its limits."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

    panel = make_panel(1.75)
    (axes,) = panel.axes
    found = follow(points, item)
    quantities = [getattr(point, item.field) for point in points]
    times = np.array([date2num(datetime.fromisoformat(point.began)) for point in points])
    values = item.scale * np.array([it.value for it in quantities])
    bars = item.scale * np.nan_to_num([it.expanded for it in quantities])
    unit = f" [{item.unit}]" if item.unit else ""
    axes.set(ylabel=f"{item.sample_symbol}{unit}", xlabel="first hit, UTC")
    means = values / (1.0 + found.differences)
    axes.errorbar(
        times, means, yerr=np.abs(means) * found.limits, color="0.75", linestyle="none",
        elinewidth=6.0, marker="_", markeredgecolor="0.4",
    )  # fmt: skip
    colour = format_hex(SERIES[0])
    axes.errorbar(times, values, yerr=bars, color=colour, marker="o", linestyle="none")
    # An hour at least: runs may follow within a minute, to which their times are known.
    middle, half = (times[0] + times[-1]) / 2, max(0.55 * (times[-1] - times[0]), 1 / 48)
    axes.set_xlim(middle - half, middle + half)
    # With fewer ticks allowed some ranges would have none that fit.
    locator = AutoDateLocator(minticks=3, maxticks=7)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    return panel
