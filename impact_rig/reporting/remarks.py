"""What a table does not say: hits left out, warnings, and what could not be determined."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from impact_rig.reporting.terminal import Column, print_table
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MISSING


def print_rejections(console: Console, results: Results) -> None:
    """Print every rejected hit with its reasons, and what the virtual rig did on purpose."""
    hits = results.rejections
    if not hits:
        return
    columns = [
        Column("Sample", [hit.sample for hit in hits], is_text=True),
        Column("Hit", [str(hit.impact) for hit in hits]),
        Column("Try", [str(hit.attempt) for hit in hits]),
        Column("Why", ["\n".join(hit.reasons) for hit in hits], is_text=True),
    ]
    if any(hit.injected_faults for hit in hits):
        faults = ["\n".join(hit.injected_faults) or MISSING for hit in hits]
        columns.append(Column("Injected", faults, is_text=True))
    print_table(console, f"Rejected hits: {len(hits)}", columns)


def print_warnings(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what a reader of the numbers must know, each once with the samples it holds for."""
    remarks = [(sample.name, sample.warnings) for sample in samples]
    _print_remarks(console, "Warnings", remarks)


def print_notes(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what could not be determined, each note once with the samples it holds for."""
    remarks = [(sample.name, sample.notes) for sample in samples]
    _print_remarks(console, "Not determined", remarks)


def _print_remarks(
    console: Console, title: str, remarks: Sequence[tuple[str, Sequence[str]]]
) -> None:
    holders: dict[str, list[str]] = {}
    for name, texts in remarks:
        for text in texts:
            holders.setdefault(text, []).append(name)
    if not holders:
        return
    console.print(Text(title, style="bold yellow"))
    for text, names in holders.items():
        whose = "all samples" if len(names) == len(remarks) > 1 else ", ".join(names)
        console.print(Text(f"- {whose}: {text}"))
    console.print()
