"""Text of the view as Markdown: tables, remarks, one sample, one hit; needs no Rerun."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import join_findings
from impact_rig.core.given.records import SIMULATED
from impact_rig.core.given.setup import ACCELERATION
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO, MISSING, format_count, format_number, show_unit
from impact_rig.results.references import explain_misprint, find_expected
from impact_rig.results.remarks import (
    Remark,
    describe_origin,
    gather_remarks,
    gather_sample_remarks,
    tabulate_rejections,
)
from impact_rig.results.table import Column, Table, make_text_column
from impact_rig.results.tables import (
    tabulate_checks,
    tabulate_errors,
    tabulate_methods,
    tabulate_results,
    tabulate_summary,
)

_ESCAPES = str.maketrans({letter: f"\\{letter}" for letter in "\\`*_[]<>|#~"})
"""Letters that mean something to Markdown, as they are written then."""
LEGEND = "± is the half-width of the 95 % interval. A dash: not determined, see the notes."
NOT_YET = "Nothing is measured yet."


def escape_markdown(text: str) -> str:
    """Return `text` so that Markdown shows it as it is, on one line."""
    return " ".join(text.split()).translate(_ESCAPES)


def format_verdict(hit: HitResults, hammer: tuple[float, str] = ACCELERATION) -> str:
    """Return a hit's verdict as Markdown: which hit, the verdict, every reason, the figures.

    The hammer's peak is in the unit of its sensor, see `RigSetup.hammer_reading`.
    """
    lines = [
        f"# {escape_markdown(hit.sample)}",
        f"Impact {hit.impact}, attempt {hit.attempt} (record {hit.record})",
        escape_markdown(f"Origin: {hit.origin}"),
        "## Accepted" if hit.accepted else "## Rejected",
    ]
    lines += [
        _format_item(item.reason.value.replace("_", " "), item.explanation) for item in hit.reasons
    ]
    figures = [
        f"| {name} | {format_number(value, digits)} {unit} |"
        for name, value, digits, unit in (
            ("Contact time", hit.contact_time * MICRO, 2, "µs"),
            ("Hammer peak", hammer[0] * hit.hammer_peak, 0, show_unit(hammer[1])),
            ("Sample peak", hit.specimen_peak, 0, "m/s²"),
        )
        if math.isfinite(value)
    ]
    if figures:
        lines.append("\n".join(["| Of this hit alone | |", "|:--|--:|", *figures]))
    if hit.injected_faults:
        faults = ", ".join(fault.replace("_", " ") for fault in hit.injected_faults)
        lines.append(f"Fault of the virtual rig, on purpose: {escape_markdown(faults)}.")
    return "\n\n".join(lines)


def _format_item(about: str, text: str) -> str:
    """Return an item of a Markdown list, with its subject where there is one."""
    subject = f"**{escape_markdown(about)}**: " if about else ""
    return f"- {subject}{escape_markdown(text)}"


def format_log_line(hit: HitResults) -> str:
    """Return a hit's verdict as one line of plain text."""
    start = f"record {hit.record}: {hit.sample}, impact {hit.impact}"
    if hit.origin.kind == SIMULATED:
        start = f"{SIMULATED} {start}"
    if hit.attempt > 1:
        start += f", attempt {hit.attempt}"
    if not hit.accepted:
        return f"{start}: rejected, {join_findings(hit.reasons)}"
    contact_time = format_number(hit.contact_time * MICRO, 2)
    unit = "" if contact_time == MISSING else " µs"
    return f"{start}: accepted, contact time {contact_time}{unit}"


def format_results(results: Results) -> str:
    """Return the results as Markdown: values, remarks and rejected hits."""
    if not results.samples:
        return "\n\n".join([NOT_YET, *map(format_table, tabulate_rejections(results))])
    return "\n\n".join(
        [
            f"**{escape_markdown(describe_origin(hit.origin for hit in results.hits))}**",
            *map(format_table, tabulate_summary(results)),
            *_format_remarks(gather_remarks(results)),
            *map(format_table, tabulate_results(results)),
            LEGEND,
            *map(format_table, tabulate_rejections(results)),
        ]
    )


def format_table(table: Table) -> str:
    """Return a table as Markdown, its caption as a heading; rows that stand out are bold."""
    lines = [
        [escape_markdown(column.header) for column in table.columns],
        [":--" if column.is_text else "--:" for column in table.columns],
    ]
    for place, row in enumerate(table.rows):
        cells = [escape_markdown(cell).replace("\n", " ") for cell in row]
        lines.append([f"**{cell}**" if cell and place in table.marked else cell for cell in cells])
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    notes = (escape_markdown(note) for note in table.explanations)
    return "\n\n".join([f"## {escape_markdown(table.caption)}", text, *notes])


def _turn(table: Table) -> Table:
    """Return a table with its rows as columns: a narrow pane shows few columns."""
    names = make_text_column(table.columns[0].header, [item.header for item in table.columns[1:]])
    rows = (Column(name, cells) for name, *cells in table.rows)
    return replace(table, columns=(names, *rows), marked=frozenset())


def _format_remarks(remarks: Sequence[Remark]) -> list[str]:
    items = [_format_item(remark.about, remark.text) for remark in remarks]
    return ["## Remarks", "\n".join(items)] if items else []


def format_summary(results: Results, sample: SampleEstimate) -> str:
    """Return one sample: its values by each method, and its remarks."""
    reference = find_expected(results, sample.name)
    # Counted as the tables count: an estimate may be older than the last rejected hit.
    struck = [hit for hit in results.hits if hit.sample == sample.name]
    accepted = sum(hit.accepted for hit in struck)
    paragraphs = [
        f"# {escape_markdown(sample.name)}",
        escape_markdown(f"Origin: {results.find_origin(sample.name)}"),
        f"{format_count(accepted, 'hit')} in the mean, {len(struck) - accepted} rejected.",
        format_table(tabulate_methods(results, sample)),
        *(format_table(_turn(table)) for table in tabulate_errors([sample])),
        *(format_table(_turn(table)) for table in tabulate_checks([sample])),
    ]
    if reference.published is not None and reference.is_misprinted:
        paragraphs.append(escape_markdown(explain_misprint(reference.published)))
    return "\n\n".join([*paragraphs, *_format_remarks(gather_sample_remarks(sample))])
