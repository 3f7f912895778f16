"""Every hit: those left out and why, and those in the means."""

import math
from collections import Counter
from collections.abc import Sequence

from impact_rig.reporting.report.document import (
    Column,
    Folded,
    Paragraph,
    Part,
    Section,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO, MISSING, format_number


def make_hits_section(results: Results) -> Section:
    """Tell of every hit of a campaign."""
    accepted = [hit for hit in results.hits if hit.accepted]
    parts: list[Part] = [Paragraph(_count(accepted, results.rejections))]
    if results.rejections:
        parts.append(_tabulate_rejected(results.rejections))
    if accepted:
        parts.append(_fold_accepted(accepted))
    return Section("Hits", tuple(parts))


def count_reasons(hits: Sequence[HitResults]) -> str:
    """Return how often each reason was given, in words; a hit may have several."""
    counts = Counter(reason.partition(":")[0] for hit in hits for reason in hit.reasons)
    return ", ".join(f"{reason} ({number})" for reason, number in counts.most_common())


def _count(accepted: Sequence[HitResults], rejected: Sequence[HitResults]) -> str:
    total = len(accepted) + len(rejected)
    text = f"Of {total} hits {len(accepted)} are in the means and {len(rejected)} were left out"
    reasons = count_reasons(rejected)
    return f"{text}: {reasons}. A hit may have several reasons." if reasons else f"{text}."


def _tabulate_rejected(hits: Sequence[HitResults]) -> Part:
    columns = [
        make_text_column("Sample", [hit.sample for hit in hits]),
        *_make_label_columns(hits),
        make_column("Hammer peak [m/s²]", _format_peaks(hits, "hammer_peak_m_per_s2")),
        make_text_column("Why it was left out", ["\n".join(hit.reasons) for hit in hits]),
        make_text_column("Injected fault", ["\n".join(hit.injected_faults) for hit in hits]),
    ]
    is_virtual = any(hit.injected_faults for hit in hits)
    note = "Injected fault: what the virtual rig did wrong on purpose."
    return make_table(f"Hits left out: {len(hits)}", columns, [note] if is_virtual else [])


def _fold_accepted(hits: Sequence[HitResults]) -> Folded:
    columns = [
        make_text_column("Sample", [hit.sample for hit in hits]),
        *_make_label_columns(hits),
        make_column("τp [µs]", [format_number(hit.contact_time_s * MICRO, 2) for hit in hits]),
        make_column("Hammer peak [m/s²]", _format_peaks(hits, "hammer_peak_m_per_s2")),
        make_column("Sample peak [m/s²]", _format_peaks(hits, "specimen_peak_m_per_s2")),
        make_text_column("By hand", ["\n".join(hit.reasons) for hit in hits]),
    ]
    note = "τp: of this hit alone. Peaks: largest acceleration after the low-pass, either sign."
    title = f"Hits in the means: {len(hits)}"
    return Folded(title, (make_table(title, columns, [note]),))


def _make_label_columns(hits: Sequence[HitResults]) -> list[Column]:
    return [
        make_column("Hit", [str(hit.impact) for hit in hits]),
        make_column("Try", [str(hit.attempt) for hit in hits]),
        make_column("Record", [str(hit.record) for hit in hits]),
    ]


def _format_peaks(hits: Sequence[HitResults], name: str) -> list[str]:
    values = [getattr(hit, name) for hit in hits]
    return [f"{value:.1f}" if math.isfinite(value) else MISSING for value in values]
