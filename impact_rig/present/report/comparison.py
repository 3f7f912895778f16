"""Several runs: what changed beyond its uncertainty, and what differs in the set-ups."""

import math
from collections.abc import Sequence

from impact_rig.core.quantity import Quantity
from impact_rig.present.figures.comparison_figure import draw_comparison_figure
from impact_rig.present.report.document import (
    Paragraph,
    Part,
    Picture,
    Remarks,
    Section,
    drop_empty,
)
from impact_rig.present.report.setup import SETUP_FIELDS, SetupField
from impact_rig.results.comparison import (
    Change,
    ComparedQuantity,
    SetupDifference,
    compare_runs,
    find_setup_differences,
)
from impact_rig.results.numbers import MISSING, format_number
from impact_rig.results.remarks import Remark
from impact_rig.results.run import Run
from impact_rig.results.tables import Table, make_column, make_table, make_text_column

CHANGED = "changed"
UNCHANGED = "no change seen"
EXPLANATION = (
    "En is the normalised error: the difference over its expanded uncertainty √(U1² + U2²). Where"
    " |En| is above 1, the value has changed by more than its uncertainty explains. Runs of one"
    " rig share masses and clock, so that a part of their uncertainties is common and cancels in"
    " the difference: the verdict is cautious, a change has to be larger than need be to be"
    " called one. Of many comparisons without any change, one in twenty at most goes beyond 1 by"
    " chance."
)


def make_comparison_section(runs: Sequence[Run]) -> Section:
    """Compare every run with the first."""
    results = [run.campaign.results for run in runs]
    compared = compare_runs(results)
    others = ", ".join(run.name for run in runs[1:])
    first = f"The first run, {runs[0].name}, is what the others are held against: {others}."
    parts: list[Part] = [Paragraph(first)]
    if compared:
        named = [(run.name, run.campaign.results) for run in runs]
        parts += [_summarize(runs, compared), Paragraph(EXPLANATION)]
        parts += [Picture(figure) for figure in draw_comparison_figure(named)]
    else:
        parts.append(Paragraph("No quantity was determined in two of the runs."))
    parts += _tell_setup_differences(runs, find_setup_differences(results))
    sections = [_compare_with_first(runs, place, compared) for place in range(1, len(runs))]
    return Section("Comparison of the runs", tuple(parts), drop_empty(*sections))


def _summarize(runs: Sequence[Run], compared: Sequence[ComparedQuantity]) -> Remarks:
    items = []
    for place, run in enumerate(runs[1:]):
        known = [item for item in compared if math.isfinite(item.changes[place].normalised_error)]
        changed = [item for item in known if item.changes[place].is_beyond_uncertainty]
        named = ", ".join(f"{item.quantity.symbol} of {item.body}" for item in changed)
        if not known:
            text = "no value has an uncertainty in both runs: nothing can be said of changes"
        elif changed:
            text = (
                f"{len(changed)} of {len(known)} values changed beyond their uncertainty: {named}"
            )
        else:
            text = f"none of {len(known)} values changed beyond its uncertainty"
        items.append(Remark(f"{text}.", run.name))
    return Remarks(tuple(items))


def _compare_with_first(
    runs: Sequence[Run], place: int, compared: Sequence[ComparedQuantity]
) -> Section:
    """Return a table for each quantity that both runs determined."""
    by_name: dict[str, list[ComparedQuantity]] = {}
    for item in compared:
        if math.isfinite(item.changes[place - 1].difference):
            by_name.setdefault(item.quantity.name, []).append(item)
    tables = tuple(_tabulate(runs, place, items) for items in by_name.values())
    return Section(f"{runs[place].name} against {runs[0].name}", tables)


def _tabulate(runs: Sequence[Run], place: int, items: Sequence[ComparedQuantity]) -> Table:
    quantity = items[0].quantity
    changes = [item.changes[place - 1] for item in items]
    differences = [
        quantity.format(Quantity(change.difference, expanded=change.expanded))
        for change in changes
    ]
    columns = [
        make_text_column("Sample", [item.body for item in items]),
        *(
            make_column(
                f"{runs[which].name} [{quantity.unit}]",
                [quantity.format(item.found[which]) for item in items],
            )
            for which in (0, place)
        ),
        make_column(f"Difference [{quantity.unit}]", differences),
        make_column("En", [format_number(change.normalised_error, 2) for change in changes]),
        make_text_column("Verdict", [_judge(change) for change in changes]),
    ]
    marked = [row for row, change in enumerate(changes) if change.is_beyond_uncertainty]
    title = f"{quantity.name[0].upper()}{quantity.name[1:]} {quantity.symbol}"
    caption = f"{title}: {runs[place].name} against {runs[0].name}"
    return make_table(caption, columns, marked=marked)


def _judge(change: Change) -> str:
    if math.isnan(change.normalised_error):
        return MISSING
    return CHANGED if change.is_beyond_uncertainty else UNCHANGED


def _tell_setup_differences(
    runs: Sequence[Run], differences: Sequence[SetupDifference]
) -> list[Part]:
    rows = [_describe_difference(item) for item in differences]
    rows += [
        (label, "", cells)
        for label, cells in (
            ("origin", [str(run.campaign.results.origin) for run in runs]),
            ("sampling and full scale", [_describe_sampling(run) for run in runs]),
            ("software that recorded", [_describe_software(run) for run in runs]),
        )
        if len({cell for cell in cells if cell != MISSING}) > 1
    ]
    if not rows:
        return [Paragraph("Masses, samples and settings are the same in all runs.")]
    columns = [
        make_text_column("What", [label for label, *_ in rows]),
        make_text_column("Unit", [unit for _, unit, _ in rows]),
        *(
            make_text_column(run.name, [cells[place] for *_, cells in rows])
            for place, run in enumerate(runs)
        ),
    ]
    return [make_table("What differs in the set-ups", columns)]


def _describe_difference(item: SetupDifference) -> tuple[str, str, list[str]]:
    shown = SETUP_FIELDS.get(item.field, SetupField(item.field))
    label = f"{item.sample}: {shown.label}" if item.sample else shown.label
    return label, shown.unit, [shown.format(value) for value in item.values]


def _describe_sampling(run: Run) -> str:
    described = [
        f"{item.sampling_rate * 1e-3:.7g} kHz"
        + "".join(
            f", {channel.name} {channel.full_scale:.7g} m/s²"
            for channel in item.channels
            if channel.full_scale
        )
        for item in run.acquisitions
    ]
    return "; ".join(described) or MISSING


def _describe_software(run: Run) -> str:
    versions = run.provenance.versions if run.provenance else ()
    return ", ".join(f"{name} {text}" for name, text in versions) or MISSING
