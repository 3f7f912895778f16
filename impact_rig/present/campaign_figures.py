"""The campaign's figures: the paper's Figs. 3 to 6, and contacts over the impact speed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import fmean

import numpy as np

from impact_rig.core.equations import estimate_equivalent_mass
from impact_rig.core.quantity import Quantity
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.speed_exponents import (
    ALL_SAMPLES,
    HERTZ_SPEED_EXPONENTS,
    SpeedExponents,
)
from impact_rig.present.picture import (
    MARKERS,
    TICK,
    Curve,
    Look,
    Panel,
    Picture,
    Plot,
    Text,
    shorten_name,
    thin,
)
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import MICRO, format_error, format_quantity
from impact_rig.results.palette import SERIES, VERMILION, format_hex
from impact_rig.results.references import Reference, find_expected
from impact_rig.results.traces import DRIVEN, SampleTraces


@dataclass(frozen=True)
class Body:
    """What Figs. 4 and 6 show of hammer or samples; fields of its parts."""

    title: str
    peak: str
    error: str
    largest_error: float  # of the paper's Fig. 6, as its text gives it [%]


HAMMER = Body("a) hammer", "hammer_peak", "mse_hammer_percent", 0.25)
SAMPLES = Body("b) samples", "specimen_peak", "mse_sample_percent", 2.8)
BODIES = (HAMMER, SAMPLES)
GRAM = 1e3  # kilograms to grams
CASES = ("brass small", "steel medium", "aluminium large")
"""The three samples of the paper's Fig. 5, from top to bottom."""
HIGH, MIDDLE, ROW = 140.0, 66.0, 16.0
"""Heights of a plot, of one of three below each other, of a row of names [pt]."""
MODEL_LOOK = Look(format_hex(VERMILION))
MEASURED_LOOK = Look(width=1.0, dashes=(3.7, 1.6))
EXPECTED_LOOK = Look(width=0.0, marker="o", size=11.0, is_hollow=True)
BOUND_LOOK = Look(dashes=(4.4, 1.9))


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
        found.append(Picture(title, caption, (draw_widths(weighed),)))
    if rows:
        title = "Fig. 4. Maximum amplitude against pulse width"
        caption = (
            "Largest acceleration of the mean hit against the pulse width. The paper prints this"
            " figure without numbers: there is nothing to lay beside it."
        )
        found.append(Picture(title, caption, tuple(draw_peaks(rows, body) for body in BODIES)))
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
        panels = tuple(draw_responses(cases, channel) for channel in range(len(BODIES)))
        found.append(Picture(title, caption, panels))
    if rows:
        title = "Fig. 6. Mean square error between model and measurement"
        caption = (
            "Over the whole record, both traces normalised to their peak and shifted onto each"
            " other, as the paper has it. Dashed line: the largest value of the paper, which"
            " prints this figure without numbers. This measure is forgiving: a visibly wrong"
            " shape still gives 1 to 3 %."
        )
        found.append(Picture(title, caption, tuple(draw_errors(rows, body) for body in BODIES)))
    return found


def draw_widths(rows: Sequence[FigureRow]) -> Panel:
    """Draw tau_p over m_eq: hits, means and expected values."""
    materials = _list_materials(rows)
    ticks = [
        Curve(
            [row.relative_mass * GRAM] * len(row.contact_times),
            [MICRO * time for time in row.contact_times],
            replace(_choose_look(materials.index(row.material)), width=0.0, marker=TICK),
        )
        for row in rows
    ]
    means = _join_materials(
        rows,
        x=[row.relative_mass * GRAM for row in rows],
        y=[row.estimate.paper.contact_time.value * MICRO for row in rows],
        y_bars=[row.estimate.paper.contact_time.expanded * MICRO for row in rows],
    )
    expected = [row for row in rows if math.isfinite(row.reference.contact_time)]
    rings = Curve(
        [row.relative_mass * GRAM for row in expected],
        [row.reference.contact_time * MICRO for row in expected],
        EXPECTED_LOOK,
        "expected" * bool(expected),
    )
    plot = Plot(
        (*ticks, *means, rings),
        HIGH,
        x_label="relative mass m1 m2 / (m1 + m2) [g]",
        y_label="pulse width τp [µs]",
    )
    return Panel((plot,))


def draw_peaks(rows: Sequence[FigureRow], body: Body) -> Panel:
    """Draw the largest acceleration of a body's mean hits over tau_p."""
    curves = _join_materials(
        rows,
        x=[row.estimate.paper.contact_time.value * MICRO for row in rows],
        y=[getattr(row.estimate.paper, body.peak) for row in rows],
    )
    plot = Plot(
        tuple(curves),
        HIGH,
        title=body.title,
        x_label="pulse width τp [µs]",
        y_label="maximum amplitude [m/s²]",
        floor=0.0,
    )
    return Panel((plot,))


def _join_materials(
    rows: Sequence[FigureRow],
    *,
    x: Sequence[float],
    y: Sequence[float],
    y_bars: Sequence[float] = (),
) -> list[Curve]:
    """Join the points of each material, which has its colour and marker."""
    curves = []
    for number, material in enumerate(_list_materials(rows)):
        places = [place for place, row in enumerate(rows) if row.material == material]
        places.sort(key=x.__getitem__)
        curve = Curve(
            [x[place] for place in places],
            [y[place] for place in places],
            _choose_look(number),
            shorten_name(material),
            y_bars=[y_bars[place] for place in places] if y_bars else (),
        )
        curves.append(curve)
    return curves


def _choose_look(number: int) -> Look:
    """Return the look of one series: its colour and its marker."""
    colour = format_hex(SERIES[number % len(SERIES)])
    return Look(colour, width=0.8, marker=MARKERS[number % len(MARKERS)])


def _list_materials(rows: Sequence[FigureRow]) -> list[str]:
    return list(dict.fromkeys(row.material for row in rows))


def draw_responses(cases: Sequence[SampleTraces], channel: int) -> Panel:
    """Draw normalised model and mean hit of a body, sample below sample."""
    plots = []
    for sample in cases:
        measured, modelled = sample.normalise(channel)
        reach = sample.contact_time
        shown = (sample.time > -1.2 * reach) & (sample.time < 4.0 * reach)
        curves = []
        lines = (modelled, MODEL_LOOK, "model"), (measured, MEASURED_LOOK, "measured")
        for values, look, name in lines:
            if values is not None:
                places = np.flatnonzero(shown)[thin(values[shown])]
                curves.append(Curve(MICRO * sample.time[places], values[places], look, name))
        model = sample.find_model(DRIVEN)
        error = f"{format_error(model.mse_percent[channel])} %" if model else ""
        plot = Plot(
            tuple(curves),
            MIDDLE,
            y_label="a / peak",
            corner=(shorten_name(sample.name), f"MSE {error}"),
        )
        plots.append(plot)
    plots[0] = replace(plots[0], title=BODIES[channel].title)
    plots[-1] = replace(plots[-1], x_label="time from the middle of the pulse [µs]")
    return Panel(tuple(plots))


def draw_errors(rows: Sequence[FigureRow], body: Body) -> Panel:
    """Draw the mean square error of the force-driven model, and the paper's largest."""
    values = [getattr(row.estimate.errors, body.error) for row in rows]
    heights = [float(-place) for place in range(len(rows))]
    bound = [body.largest_error] * 2
    name = f"largest of the paper, {body.largest_error:g} %"
    plot = Plot(
        (
            Curve(values, heights, Look(format_hex(VERMILION), width=0.0, marker="o")),
            Curve(bound, [0.5, 0.5 - len(rows)], BOUND_LOOK, name),
        ),
        ROW * (1 + len(rows)),
        title=body.title,
        x_label="MSE [%]",
        texts=tuple(
            Text(value, height, f"{format_error(value)} %")
            for value, height in zip(values, heights, strict=True)
        ),
        y_ticks=tuple(
            (height, shorten_name(row.estimate.name))
            for height, row in zip(heights, rows, strict=True)
        ),
    )
    return Panel((plot,))


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
    return Picture(
        "Contact over impact speed",
        "Both axes are logarithmic: a power of v is a straight line, p its exponent. Bars: 95 %"
        " intervals. Dotted: a Hertz contact without loss.",
        tuple(draw_speed(results, *shown) for shown in SHOWN),
    )


def draw_speed(results: Results, name: str, title: str, label: str, scale: float) -> Panel:
    """Draw one quantity of the contact law over the impact speed, sample by sample."""
    curves: list[Curve] = []
    found = [item for item in results.speed_exponents if item.sample != ALL_SAMPLES]
    for place, item in enumerate(found):
        laws = [
            sample.contact_law
            for sample in results.samples
            if results.setup.samples.find(sample.name).body == item.sample
            and sample.contact_law.impact_speed.is_known
        ]
        points = [(law.impact_speed, getattr(law, name)) for law in laws]
        curves += _draw_series(_choose_look(place), item, name, points, scale)
    plot = Plot(
        tuple(curves),
        HIGH,
        title=title,
        x_label="impact speed [cm/s]",
        y_label=label,
        is_logarithmic=True,
    )
    return Panel((plot,))


def _draw_series(
    look: Look,
    item: SpeedExponents,
    name: str,
    points: list[tuple[Quantity, Quantity]],
    scale: float,
) -> list[Curve]:
    """Draw one sample's points, their power law and Hertz's, both through their middle."""
    exponent: Quantity = getattr(item, name)
    speeds = [CENTI * speed.value for speed, _ in points]
    values = [scale * value.value for _, value in points]
    series = Curve(
        speeds,
        values,
        replace(look, width=0.0),
        f"{shorten_name(item.sample)}: p = {format_quantity(exponent, 3)}",
        x_bars=[CENTI * speed.expanded for speed, _ in points],
        y_bars=[scale * value.expanded for _, value in points],
    )
    middle = math.exp(fmean(map(math.log, speeds)))
    height = math.exp(fmean(map(math.log, values)))
    ends = [min(speeds), max(speeds)]
    hertz = HERTZ_SPEED_EXPONENTS.get(name, math.nan)
    lines = [
        Curve(
            ends,
            [height * (speed / middle) ** power for speed in ends],
            Look(look.colour, width=1.0, dashes=dashes),
        )
        for power, dashes in ((exponent.value, ()), (hertz, (1.2, 1.8)))
    ]
    return [series, *lines]
