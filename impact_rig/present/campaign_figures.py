"""The campaign's figures: the paper's Figs. 3 to 6, and contacts over the impact speed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TYPE_CHECKING, Any

from impact_rig.core.estimates.equations import estimate_equivalent_mass
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import (
    ALL_SAMPLES,
    HERTZ_SPEED_EXPONENTS,
    SpeedExponents,
)
from impact_rig.core.given.quantity import Quantity
from impact_rig.present.picture import Picture, make_panel, make_picture, reuse_panel, shorten_name
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MICRO, format_error, format_quantity
from impact_rig.results.palette import SERIES, VERMILION, format_hex
from impact_rig.results.references import Reference, find_expected
from impact_rig.results.traces import DRIVEN, SampleTraces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureBody:
    """Fields that Figs. 4 and 6 show of hammer or samples."""

    title: str
    peak: str
    error: str
    largest_error: float  # of the paper's Fig. 6, as its text gives it [%]


HAMMER = FigureBody("a) hammer", "hammer_peak", "mse_hammer_percent", 0.25)
SAMPLES = FigureBody("b) samples", "specimen_peak", "mse_sample_percent", 2.8)
BODIES = (HAMMER, SAMPLES)
MARKERS = "s^oDvPX*"
RING: dict[str, Any] = {
    "color": "black", "linestyle": "none", "marker": "o", "markersize": 11.0,
    "markerfacecolor": "none", "markeredgewidth": 0.7,
}  # fmt: skip
GRAM = 1e3  # kilograms to grams
CASES = ("brass small", "steel medium", "aluminium large")
"""The three samples of the paper's Fig. 5, from top to bottom."""
HIGH, MIDDLE, ROW = 1.9, 0.9, 0.2
"""Heights of axes, of three below each other, and of a row of names [inch]."""


@dataclass(frozen=True)
class FigureRow:
    """One sample's place in the figures."""

    estimate: SampleEstimate
    material: str  # samples of one material share a colour
    relative_mass: float  # m1 m2 / (m1 + m2), equation (6a) [kg]; NaN: not known
    contact_times: tuple[float, ...]  # tau_p of every hit in the mean [s]
    reference: Reference


def make_figure_rows(results: Results) -> list[FigureRow]:
    """Return the samples as the figures show them, in the order of the results.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    rows = []
    samples = results.setup.samples
    for estimate in results.samples:
        name = estimate.name
        masses = results.setup.hammer_mass, samples.get_moving_mass(name)
        is_weighed = math.isfinite(sum(masses))
        times = (hit.contact_time for hit in results.select_accepted(name))
        row = FigureRow(
            estimate,
            material=samples.find(name).material or name,
            relative_mass=estimate_equivalent_mass(*masses) if is_weighed else math.nan,
            contact_times=tuple(filter(math.isfinite, times)),
            reference=find_expected(results, name),
        )
        rows.append(row)
    return rows


def make_contact_pictures(results: Results) -> list[Picture]:
    """Return Figs. 3 and 4; without data, neither."""
    rows = [row for row in make_figure_rows(results) if row.estimate.paper.contact_time.is_known]
    weighed = [row for row in rows if math.isfinite(row.relative_mass)]
    found = []
    if weighed:
        title = "Fig. 3. Pulse width against relative mass"
        caption = (
            "Each tick is one hit, the filled point the mean hit of a sample with its 95 %"
            " interval, the ring the value that the paper or the set-up gives."
        )
        found.append(make_picture(title, caption, [draw_widths(weighed)]))
    if rows:
        title = "Fig. 4. Maximum amplitude against pulse width"
        caption = (
            "Largest acceleration of the mean hit against the pulse width. The paper prints this"
            " figure without numbers: there is nothing to lay beside it."
        )
        panels = (draw_peaks(rows, body) for body in BODIES)
        found.append(make_picture(title, caption, panels))
    return found


def make_model_pictures(results: Results, samples: Sequence[SampleTraces]) -> list[Picture]:
    """Return Figs. 5 and 6; without data, neither.

    Parameters
    ----------
    results : Results
        Results of the campaign.
    samples : sequence of SampleTraces
        Mean hits and models; empty where only results are known.
    """
    modelled = {sample.name: sample for sample in samples if sample.find_model(DRIVEN)}
    names = [*(name for name in CASES if name in modelled), *modelled]
    cases = [modelled[name] for name in dict.fromkeys(names)][: len(CASES)]
    rows = [
        row
        for row in make_figure_rows(results)
        if math.isfinite(row.estimate.errors.mse_hammer_percent)
    ]
    found = []
    if cases:
        title = "Fig. 5. Model and measured response"
        caption = (
            "Solid: the force-driven model, with k and c by the paper's method; dashed: the mean"
            " hit. Both are normalised to their peak, and the model is shifted in time onto the"
            " measurement. MSE: mean square error over the record, as in Fig. 6."
        )
        panels = (draw_responses(cases, channel) for channel in range(len(BODIES)))
        found.append(make_picture(title, caption, panels))
    if rows:
        title = "Fig. 6. Mean square error between model and measurement"
        caption = (
            "Over the whole record, both traces normalised to their peak and shifted onto each"
            " other, as the paper has it. Dashed line: the largest value of the paper, which"
            " prints this figure without numbers. This measure is forgiving: a visibly wrong"
            " shape still gives 1 to 3 %."
        )
        found.append(make_picture(title, caption, (draw_errors(rows, body) for body in BODIES)))
    return found


def draw_widths(rows: Sequence[FigureRow]) -> "Figure":
    """Draw tau_p over m_eq: hits, means and expected values."""
    panel = reuse_panel(HIGH)
    (axes,) = panel.axes
    for place, row in enumerate(rows):
        mass = row.relative_mass * GRAM
        times = [MICRO * time for time in row.contact_times]
        colour = format_hex(SERIES[_list_materials(rows).index(row.material) % len(SERIES)])
        axes.plot([mass] * len(times), times, "_", color=colour, label=f"_hits {place}")
    _plot_materials(
        axes,
        rows,
        x=[row.relative_mass * GRAM for row in rows],
        y=[row.estimate.paper.contact_time.value * MICRO for row in rows],
        expanded=[row.estimate.paper.contact_time.expanded * MICRO for row in rows],
    )
    expected = [row for row in rows if math.isfinite(row.reference.contact_time)]
    if expected:
        masses = [row.relative_mass * GRAM for row in expected]
        times = [row.reference.contact_time * MICRO for row in expected]
        axes.plot(masses, times, **RING, label="expected")
    axes.set(xlabel="relative mass m1 m2 / (m1 + m2) [g]", ylabel="pulse width τp [µs]")
    panel.legend(loc="lower center", ncols=3)
    return panel


def draw_peaks(rows: Sequence[FigureRow], body: FigureBody) -> "Figure":
    """Draw the largest acceleration of a body's mean hits over tau_p."""
    panel = reuse_panel(HIGH)
    (axes,) = panel.axes
    _plot_materials(
        axes,
        rows,
        x=[row.estimate.paper.contact_time.value * MICRO for row in rows],
        y=[getattr(row.estimate.paper, body.peak) for row in rows],
    )
    axes.set_ylim(bottom=0.0)
    axes.set(title=body.title, xlabel="pulse width τp [µs]", ylabel="maximum amplitude [m/s²]")
    panel.legend(loc="lower center", ncols=3)
    return panel


def _plot_materials(
    axes: "Axes",
    rows: Sequence[FigureRow],
    *,
    x: Sequence[float],
    y: Sequence[float],
    expanded: Sequence[float] | None = None,
) -> None:
    """Join the points of each material, which has its colour and marker."""
    for number, material in enumerate(_list_materials(rows)):
        places = [place for place, row in enumerate(rows) if row.material == material]
        places.sort(key=x.__getitem__)
        axes.errorbar(
            [x[place] for place in places],
            [y[place] for place in places],
            yerr=[expanded[place] for place in places] if expanded else None,
            color=format_hex(SERIES[number % len(SERIES)]),
            marker=MARKERS[number % len(MARKERS)],
            markersize=5.0,
            linewidth=0.8,
            label=shorten_name(material),
        )


def _list_materials(rows: Sequence[FigureRow]) -> list[str]:
    return list(dict.fromkeys(row.material for row in rows))


def draw_responses(cases: Sequence[SampleTraces], channel: int) -> "Figure":
    """Draw normalised model and mean hit of a body, sample below sample."""
    panel = reuse_panel(*[MIDDLE] * len(cases))
    for axes, sample in zip(panel.axes, cases, strict=True):
        measured, modelled = sample.normalise(channel)
        periods = sample.time / sample.contact_time
        shown = (periods > -1.2) & (periods < 4.0)  # noqa: PLR2004 - what is drawn
        time = sample.time[shown] * MICRO
        if modelled is not None:
            axes.plot(time, modelled[shown], color=format_hex(VERMILION), label="model")
        axes.plot(time, measured[shown], "--", color="black", linewidth=1.0, label="measured")
        model = sample.find_model(DRIVEN)
        error = f"{format_error(model.mse_percent[channel])} %" if model else ""
        named = f"{shorten_name(sample.name)}\nMSE {error}"
        axes.text(0.99, 0.95, named, transform=axes.transAxes, ha="right", va="top")
        axes.set_ylabel("a / peak")
    panel.axes[0].set_title(BODIES[channel].title)
    panel.axes[-1].set_xlabel("time from the middle of the pulse [µs]")
    panel.legend(*panel.axes[0].get_legend_handles_labels(), loc="lower center", ncols=2)
    return panel


def draw_errors(rows: Sequence[FigureRow], body: FigureBody) -> "Figure":
    """Draw the mean square error of the force-driven model, and the paper's largest."""
    panel = reuse_panel(ROW * (1 + len(rows)), left=1.5)
    (axes,) = panel.axes
    values = [getattr(row.estimate.errors, body.error) for row in rows]
    bars = axes.barh(range(len(rows)), values, color=format_hex(VERMILION))
    axes.bar_label(bars, [f" {format_error(value)} %" for value in values], fontsize="small")
    axes.set_yticks(range(len(rows)), [shorten_name(row.estimate.name) for row in rows])
    axes.yaxis.set_inverted(True)
    bound = f"largest of the paper, {body.largest_error:g} %"
    axes.axvline(body.largest_error, color="black", linestyle="--", label=bound)
    axes.margins(x=0.15)
    axes.set(title=body.title, xlabel="MSE [%]")
    panel.legend(loc="lower center")
    return panel


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
        (draw_speed(results, *shown) for shown in SHOWN),
    )


def draw_speed(results: Results, name: str, title: str, label: str, scale: float) -> "Figure":
    """Draw one quantity of the contact law over the impact speed, sample by sample."""
    from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

    panel = make_panel(HIGH)
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
