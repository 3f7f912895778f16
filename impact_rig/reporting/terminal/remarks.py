"""What a table does not say: hits left out, warnings, and what could not be determined."""

from collections import Counter
from collections.abc import Sequence

from rich.console import Console

from impact_rig.core.hits.reasons import Reason
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import (
    ALARM,
    NOTE,
    TITLE,
    WARNING,
    print_item,
    print_table,
    print_text,
)
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MISSING


def print_rejections(console: Console, results: Results) -> None:
    """Print every rejected hit with its reasons, and what the virtual rig did on purpose."""
    hits = sorted(results.rejections, key=lambda hit: hit.record)
    if not hits:
        return
    names = [hit.sample for hit in hits]
    columns = [
        Column(
            "Sample",
            [
                "" if place and name == names[place - 1] else name
                for place, name in enumerate(names)
            ],
            is_text=True,
        ),
        Column("Hit", [f"{hit.impact}.{hit.attempt}" for hit in hits]),
        Column(
            "Why",
            ["\n".join(hit.reasons) for hit in hits],
            is_text=True,
            styles=[NOTE if _is_surplus(hit) else WARNING for hit in hits],
        ),
    ]
    if any(hit.injected_faults for hit in hits):
        faults = ["\n".join(hit.injected_faults) or MISSING for hit in hits]
        columns.append(Column("Injected", faults, is_text=True))
    print_table(console, f"Rejected hits: {len(hits)}", columns, [_count_reasons(hits)])


def _is_surplus(hit: HitResults) -> bool:
    """Whether nothing is wrong with a hit but that others were preferred."""
    return all(_find_code(reason) == Reason.SURPLUS.value for reason in hit.reasons)


def _count_reasons(hits: Sequence[HitResults]) -> str:
    counts = Counter(_find_code(reason) for hit in hits for reason in hit.reasons)
    parts = ", ".join(f"{code} ({number})" for code, number in counts.most_common())
    return f"Hit 3.2: impact 3, attempt 2. Reasons: {parts}."


def _find_code(reason: str) -> str:
    return reason.partition(":")[0]


def print_warnings(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what a reader of the numbers must know, each once with the samples it holds for."""
    remarks = [(sample.name, sample.warnings) for sample in samples]
    _print_remarks(console, "Warnings", remarks, ALARM)


def print_notes(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what could not be determined, each note once with the samples it holds for."""
    remarks = [(sample.name, sample.notes) for sample in samples]
    _print_remarks(console, "Not determined", remarks, TITLE)


def _print_remarks(
    console: Console, title: str, remarks: Sequence[tuple[str, Sequence[str]]], style: str
) -> None:
    holders: dict[str, list[str]] = {}
    for name, texts in remarks:
        for text in texts:
            holders.setdefault(text, []).append(name)
    if not holders:
        return
    print_text(console, title, style)
    for text, names in holders.items():
        whose = "all samples" if len(names) == len(remarks) > 1 else ", ".join(names)
        print_item(console, f"{whose}: {text}")
    console.print()
