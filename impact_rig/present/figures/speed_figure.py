"""Contact duration, force and restitution over the impact speed, and the power laws of it."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.estimation.speed_exponents import (
    ALL_SAMPLES,
    HERTZ_SPEED_EXPONENTS,
    SpeedExponents,
)
from impact_rig.core.quantity import Quantity
from impact_rig.present.figures.markup import ReportFigure, make_figure, make_name
from impact_rig.present.figures.panels import (
    INK,
    LONGEST_COLUMN,
    choose_looks,
    choose_marker,
    make_handle,
    make_panel,
    shorten_name,
    split_into_columns,
)
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MICRO, format_quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT = 170.0
"""Of the axes [pt]."""
TICKS = 8
"""Of an axis at most [-]: round numbers, which decades within a factor of ten have none of."""
CENTI = 100.0
SHOWN = (
    ("duration", "a) contact duration", "duration [µs]", MICRO),
    ("peak_force", "b) largest force", "force [N]", 1.0),
    ("restitution", "c) restitution", "e", 1.0),
)


def draw_speed_figure(results: Results) -> ReportFigure:
    """Draw what goes with the impact speed, a panel each, over logarithmic axes.

    Parameters
    ----------
    results : Results
        With speed exponents.
    """
    found = [item for item in results.speed_exponents if item.sample != ALL_SAMPLES]
    laws = {
        item.sample: [
            sample.contact_law
            for sample in results.samples
            if results.setup.samples.find(sample.name).body == item.sample
            and sample.contact_law.impact_speed.is_known
        ]
        for item in found
    }
    told = "; ".join(
        f"{item.sample}: τ as v^{_format(item.duration)}, Fmax as v^{_format(item.peak_force)},"
        f" e as v^{_format(item.restitution)}"
        for item in found
    )
    return make_figure(
        make_name("speed", "exponents"),
        "Contact over impact speed",
        lambda: [_draw_panel(found, laws, *shown) for shown in SHOWN],
        f"Duration, largest force and restitution over the impact speed. {told}.",
        "Both axes are logarithmic: a power of v is a straight line. Bars: 95 % intervals. Dotted:"
        " as a Hertz contact without loss would go.",
    )


def _format(exponent: Quantity) -> str:
    return format_quantity(exponent, 3)


def _draw_panel(
    found: Sequence[SpeedExponents],
    laws: dict[str, list[ContactLaw]],
    name: str,
    title: str,
    label: str,
    scale: float,
) -> "Figure":
    from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

    looks = choose_looks(list(laws))
    handles = []
    for place, item in enumerate(found):
        text = shorten_name(item.sample)
        if len(found) <= LONGEST_COLUMN:
            text += f": p = {_format(getattr(item, name))}"
        look = looks[item.sample]
        marker = {**choose_marker(place), "linestyle": look.dashes}
        handles.append(make_handle(text, color=look.colour, **marker))
    panel = make_panel([HEIGHT], split_into_columns(handles))
    (axes,) = panel.axes
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(TICKS))
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_locator(NullLocator())
    for place, item in enumerate(found):
        look = looks[item.sample]
        points = [(law.impact_speed, getattr(law, name)) for law in laws[item.sample]]
        speeds, values = ([point[axis].value for point in points] for axis in (0, 1))
        bars = axes.errorbar(
            [CENTI * speed for speed in speeds],
            [scale * value for value in values],
            xerr=[CENTI * point[0].expanded for point in points],
            yerr=[scale * point[1].expanded for point in points],
            color=look.colour,
            elinewidth=0.8,
            **choose_marker(place),
        )
        bars.lines[0].set_gid(f"point-{place + 1}")
        ends = [min(speeds), max(speeds)]
        middle = math.exp(sum(map(math.log, speeds)) / len(speeds))
        height = math.exp(sum(map(math.log, values)) / len(values))
        for exponent, line in (
            (getattr(item, name).value, {"color": look.colour, "linestyle": look.dashes}),
            (HERTZ_SPEED_EXPONENTS.get(name, math.nan), {"color": INK, "linestyle": ":"}),
        ):
            axes.plot(
                [CENTI * speed for speed in ends],
                [scale * height * (speed / middle) ** exponent for speed in ends],
                linewidth=1.0,
                **line,
            )
    axes.set(title=title, xlabel="impact speed [cm/s]", ylabel=label)
    return panel
