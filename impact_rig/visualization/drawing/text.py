"""Verdicts in words: Markdown, and lines of the log; no Rerun in here."""

import math

from impact_rig.results.campaign import HitResults
from impact_rig.results.numbers import MICRO, MISSING, format_number

LEAST_PERCENT = 0.0005
"""What three decimals would show as zero [%]."""
SPECIAL = "\\`*_[]<>|#~"
"""Letters that mean something to Markdown."""


def escape_markdown(text: str) -> str:
    """Return `text` so that Markdown shows it as it is, on one line."""
    line = " ".join(text.split())
    return "".join(f"\\{letter}" if letter in SPECIAL else letter for letter in line)


def format_percent(value: float) -> str:
    """Return a percentage of any size with three decimals."""
    return "< 0.001" if 0.0 <= value < LEAST_PERCENT else format_number(value, 3)


def write_verdict(hit: HitResults) -> str:
    """Return a hit's verdict as Markdown: which hit, the verdict, every reason, the figures."""
    lines = [
        f"# {escape_markdown(hit.sample)}",
        f"Impact {hit.impact}, attempt {hit.attempt} (record {hit.record})",
        "## Accepted" if hit.accepted else "## Rejected",
    ]
    lines += [write_reason(reason) for reason in hit.reasons]
    figures = [
        f"| {name} | {format_number(value, digits)} {unit} |"
        for name, value, digits, unit in (
            ("Contact time", hit.contact_time_s * MICRO, 2, "µs"),
            ("Hammer peak", hit.hammer_peak_m_per_s2, 0, "m/s²"),
            ("Sample peak", hit.specimen_peak_m_per_s2, 0, "m/s²"),
        )
        if math.isfinite(value)
    ]
    if figures:
        lines.append("\n".join(["| Of this hit alone | |", "|:--|--:|", *figures]))
    if hit.injected_faults:
        faults = ", ".join(fault.replace("_", " ") for fault in hit.injected_faults)
        lines.append(f"Done on purpose by the virtual rig: {escape_markdown(faults)}.")
    return "\n\n".join(lines)


def write_reason(reason: str) -> str:
    """Return a reason, ``code: explanation``, as an item of a Markdown list."""
    code, separator, explanation = reason.partition(": ")
    if not separator:
        return f"- {escape_markdown(reason)}"
    return f"- **{escape_markdown(code.replace('_', ' '))}**: {escape_markdown(explanation)}"


def write_log_line(hit: HitResults) -> str:
    """Return a hit's verdict as one line of plain text."""
    start = f"record {hit.record}: {hit.sample}, impact {hit.impact}"
    if hit.attempt > 1:
        start += f", attempt {hit.attempt}"
    if not hit.accepted:
        return f"{start}: rejected, {'; '.join(hit.reasons)}"
    contact_time = format_number(hit.contact_time_s * MICRO, 2)
    unit = "" if contact_time == MISSING else " µs"
    return f"{start}: accepted, contact time {contact_time}{unit}"
