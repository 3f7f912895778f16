"""Several runs beside each other: pulse width, stiffness and damping of each sample."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impact_rig.present.figures import panels
from impact_rig.present.figures.markup import (
    ReportFigure,
    make_figure,
    make_missing_figure,
    make_name,
)
from impact_rig.present.figures.panels import INK
from impact_rig.results.campaign import Results
from impact_rig.results.comparison import SAMPLE_MEASURANDS, Measurand
from impact_rig.results.numbers import compute_difference, format_count, format_uncertain

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RUN_HEIGHT = 9.0
SAMPLE_ROOM = 9.0
"""Of one run's bar, and what is left between samples [pt]."""
LONGEST_RUN = 42
"""Characters of a run's name in the legend [-]: the width of a panel."""
LINEAR_RANGE = 1.0
LARGEST_LINEAR = 20.0
"""Differences up to which their axis is linear if any is larger than the second [%], our choice:
one sample that is quite another does not hide the others."""
ROOM = 2.0
"""End of a logarithmic axis over the largest difference [-]."""
CAPTION = (
    "a) Values with their 95 % intervals. b) The same as difference from the first run, in percent"
    " of its value. Each run has its colour and marker."
)


@dataclass(frozen=True)
class _Bar:
    """One run's value of one sample, with the half-width of its 95 % interval; NaN: unknown."""

    run: int
    sample: str
    value: float
    expanded: float


def draw_comparison_figure(runs: Sequence[tuple[str, Results]]) -> tuple[ReportFigure, ...]:
    """Draw tau_p, k2 and c2 of each sample by run, with 95 % bars.

    Parameters
    ----------
    runs : sequence of (str, Results)
        Name and results of each; the first is the one that the others are held against.

    Returns
    -------
    tuple of ReportFigure
        One for each measurand. One for which there is nothing to draw has an empty `svg`, and
        its caption says why.
    """
    names = [name for name, _ in runs]
    return tuple(
        _draw_measurand(item, names, _collect_bars(item, runs)) for item in SAMPLE_MEASURANDS
    )


def _collect_bars(measurand: Measurand, runs: Sequence[tuple[str, Results]]) -> list[_Bar]:
    found = [
        (run, sample.name, measurand.read(sample))
        for run, (_, results) in enumerate(runs)
        for sample in results.samples
    ]
    scale = measurand.scale
    return [
        _Bar(run, name, value.value * scale, value.expanded * scale)
        for run, name, value in found
        if value.is_known
    ]


def _draw_measurand(
    measurand: Measurand, runs: Sequence[str], bars: Sequence[_Bar]
) -> ReportFigure:
    symbol, name = measurand.sample_symbol, make_name(f"comparison {measurand.name}")
    title = f"{measurand.name.capitalize()} by run"
    if not bars:
        return make_missing_figure(name, title, f"No run has {symbol} of any sample.")
    differences = _relate_to_first(bars)

    def draw() -> "Iterator[Figure]":
        yield _draw_panel("a) values", f"{symbol} [{measurand.unit}]", runs, bars, "value")
        if differences:
            label = f"difference of {symbol} from the first run [%]"
            panel = _draw_panel("b) less the first run", label, runs, differences, "difference")
            _scale_differences(panel.axes[0], [bar.value for bar in differences])
            yield panel

    alternative = _describe(measurand, runs, bars, differences)
    return make_figure(name, title, lambda: list(draw()), alternative, CAPTION)


def _relate_to_first(bars: Sequence[_Bar]) -> list[_Bar]:
    """Return values and bars as percent of the first run's value, where that has one."""
    first = {bar.sample: bar.value for bar in bars if bar.run == 0}
    return [
        _Bar(
            bar.run,
            bar.sample,
            compute_difference(bar.value, first[bar.sample]),
            100.0 * bar.expanded / abs(first[bar.sample]),
        )
        for bar in bars
        if first.get(bar.sample)
    ]


def _draw_panel(
    title: str, label: str, runs: Sequence[str], bars: Sequence[_Bar], kind: str
) -> "Figure":
    samples = list(dict.fromkeys(bar.sample for bar in bars))
    height = (RUN_HEIGHT * len(runs) + SAMPLE_ROOM) * len(samples)
    panel = panels.make_named_panel(samples, height, [_make_handles(runs)])
    axes = panel.axes[0]
    _draw_bands(axes, len(samples))
    for bar in bars:
        # In their order around the sample's place, the first at the top.
        shift = RUN_HEIGHT * (bar.run - 0.5 * (len(runs) - 1)) / (height / len(samples))
        place = samples.index(bar.sample)
        style = _choose_style(runs, bar.run)
        axes.plot(
            [bar.value - bar.expanded, bar.value + bar.expanded],
            [place + shift] * 2,
            color=style["color"],
            linewidth=1.2,
            gid=f"bar-{place}-{bar.run}",
        )
        axes.plot([bar.value], [place + shift], **style, gid=f"{kind}-{place}-{bar.run}")
    axes.set(title=title, xlabel=label)
    return panel


def _scale_differences(axes: "Axes", values: Sequence[float]) -> None:
    axes.axvline(0.0, color=INK, linewidth=0.8, alpha=0.5, zorder=1.0)
    low, high = min(-LINEAR_RANGE, *values), max(LINEAR_RANGE, *values)
    if max(-low, high) > LARGEST_LINEAR:
        axes.set_xscale("symlog", linthresh=LINEAR_RANGE)
        axes.set_xlim(ROOM * low, ROOM * high)
        axes.xaxis.set_major_formatter("{x:g}")


def _draw_bands(axes: "Axes", count: int) -> None:
    """Shade every second sample: the eye keeps the line."""
    for place in range(1, count, 2):
        axes.axhspan(place - 0.5, place + 0.5, color=INK, alpha=0.05, linewidth=0.0)


def _choose_style(runs: Sequence[str], run: int) -> dict[str, Any]:
    places = [str(place) for place in range(len(runs))]
    return {"color": panels.choose_looks(places)[str(run)].colour, **panels.choose_marker(run)}


def _make_handles(runs: Sequence[str]) -> "list[Artist]":
    return [
        panels.make_handle(panels.shorten_name(name, LONGEST_RUN), **_choose_style(runs, run))
        for run, name in enumerate(runs)
    ]


def _describe(
    measurand: Measurand, runs: Sequence[str], bars: Sequence[_Bar], differences: Sequence[_Bar]
) -> str:
    samples = len({bar.sample for bar in bars})
    text = (
        f"{measurand.sample_symbol} of {format_count(samples, 'sample')} in"
        f" {format_count(len(runs), 'run')}."
    )
    others = [bar for bar in differences if bar.run > 0]
    if not others:
        return text
    largest = max(others, key=lambda bar: abs(bar.value))
    value = next(bar for bar in bars if (bar.run, bar.sample) == (largest.run, largest.sample))
    return text + (
        f" Largest difference from {runs[0]}: {largest.value:+.2f} %, {largest.sample} in"
        f" {runs[largest.run]}, where it is"
        f" {format_uncertain(value.value, value.expanded, measurand.digits)} {measurand.unit}."
    )
