"""Contact duration, force and restitution over the impact speed, with their power laws."""

import math
from functools import partial
from statistics import fmean
from typing import TYPE_CHECKING

from impact_rig.core.quantity import Quantity
from impact_rig.core.speed_exponents import (
    ALL_SAMPLES,
    HERTZ_SPEED_EXPONENTS,
    SpeedExponents,
)
from impact_rig.present.figures.paper_figures import MARKERS
from impact_rig.present.figures.picture import Picture, make_panel, make_picture, shorten_name
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MICRO, format_quantity
from impact_rig.results.palette import SERIES, format_hex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CENTI = 100.0
SHOWN = (
    ("duration", "a) contact duration", "duration [µs]", MICRO),
    ("peak_force", "b) largest force", "force [N]", 1.0),
    ("restitution", "c) restitution", "e", 1.0),
)


def make_speed_picture(results: Results) -> Picture:
    """Draw the quantities that depend on the impact speed, a panel each, over logarithmic axes.

    Parameters
    ----------
    results : Results
        With speed exponents.
    """
    return make_picture(
        "Contact over impact speed",
        "Both axes are logarithmic: a power of v is a straight line, p its exponent. Bars: 95 %"
        " intervals. Dotted: a Hertz contact without loss.",
        [partial(draw_speed, results, *shown) for shown in SHOWN],
    )


def draw_speed(results: Results, name: str, title: str, label: str, scale: float) -> "Figure":
    """Draw one quantity of the contact law over the impact speed, sample by sample."""
    from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

    panel = make_panel(3.4)
    (axes,) = panel.axes
    axes.set(xscale="log", yscale="log", title=title, xlabel="impact speed [cm/s]", ylabel=label)
    for axis in (axes.xaxis, axes.yaxis):
        # Within a factor of ten a logarithmic axis labels no round number by itself.
        axis.set_major_locator(MaxNLocator(8))
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_locator(NullLocator())
    found = [item for item in results.speed_exponents if item.sample != ALL_SAMPLES]
    for place, item in enumerate(found):
        laws = [
            sample.contact_law
            for sample in results.samples
            if results.setup.samples.find(sample.name).body == item.sample
            and sample.contact_law.impact_speed.is_known
        ]
        points = [(law.impact_speed, getattr(law, name)) for law in laws]
        _draw_series(axes, place, item, name, points, scale)
    panel.legend(loc="lower center", ncols=2)
    return panel


def _draw_series(
    axes: "Axes",
    place: int,
    item: SpeedExponents,
    name: str,
    points: list[tuple[Quantity, Quantity]],
    scale: float,
) -> None:
    """Draw one sample's points, their power law and Hertz's, both through their middle."""
    colour = format_hex(SERIES[place % len(SERIES)])
    exponent: Quantity = getattr(item, name)
    speeds = [CENTI * speed.value for speed, _ in points]
    values = [scale * value.value for _, value in points]
    axes.errorbar(
        speeds,
        values,
        xerr=[CENTI * speed.expanded for speed, _ in points],
        yerr=[scale * value.expanded for _, value in points],
        color=colour,
        marker=MARKERS[place % len(MARKERS)],
        linestyle="none",
        label=f"{shorten_name(item.sample)}: p = {format_quantity(exponent, 3)}",
    )
    middle = math.exp(fmean(map(math.log, speeds)))
    height = math.exp(fmean(map(math.log, values)))
    ends = [min(speeds), max(speeds)]
    hertz = HERTZ_SPEED_EXPONENTS.get(name, math.nan)
    for power, look in ((exponent.value, "-"), (hertz, ":")):
        line = [height * (speed / middle) ** power for speed in ends]
        axes.plot(ends, line, look, color=colour, linewidth=1.0)
