"""What the view says in words: verdicts and tables as Markdown; no Rerun in here."""

import math
from dataclasses import dataclass

from impact_rig.core.signals.record import HitLabel

NAN = math.nan
ABSENT = "-"
"""Stands for a value that is not determined."""
LEAST_PERCENT = 0.0005
"""What three decimals would show as zero [%]."""
SPECIAL = "\\`*_[]<>|#~"
"""Letters that mean something to Markdown."""


@dataclass(frozen=True)
class Verdict:
    """One judged hit.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    accepted : bool
        Whether it goes into the sample's mean.
    reasons : tuple of str
        Every reason for rejection, ``code: explanation``; empty when accepted.
    contact_time : float
        tau_p of this hit [s]; NaN: not determined.
    hammer_peak, specimen_peak : float
        Largest |acceleration| [m/s^2]; NaN: no pulse.
    """

    label: HitLabel
    accepted: bool
    reasons: tuple[str, ...] = ()
    contact_time: float = NAN
    hammer_peak: float = NAN
    specimen_peak: float = NAN


@dataclass(frozen=True)
class Quantity:
    """A measured value beside its reference, both in SI units; NaN: none."""

    measured: float = NAN
    reference: float = NAN


@dataclass(frozen=True)
class EstimateRow:
    """One sample's line of the table.

    Attributes
    ----------
    name : str
        Of the sample.
    impacts_accepted, impacts_rejected : int
        Hits in the mean and left out.
    contact_time : Quantity
        tau_p [s].
    stiffness : Quantity
        k2 [N/m].
    damping_coefficient : Quantity
        c2 [N s/m].
    mse_hammer_percent, mse_sample_percent : float
        Mean square error of the force-driven model [%].
    mark : str
        Put behind the name, for a footnote.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact_time: Quantity = Quantity()
    stiffness: Quantity = Quantity()
    damping_coefficient: Quantity = Quantity()
    mse_hammer_percent: float = NAN
    mse_sample_percent: float = NAN
    mark: str = ""


@dataclass(frozen=True)
class EstimateTable:
    """Everything measured so far.

    Attributes
    ----------
    rows : tuple of EstimateRow
        In the order of the sample set.
    hammer_stiffness, hammer_damping_coefficient : Quantity
        k1 [N/m] and c1 [N s/m].
    reference_name : str
        Heads the columns of reference values, such as "paper".
    footnotes : tuple of str
        Below the table.
    """

    rows: tuple[EstimateRow, ...]
    hammer_stiffness: Quantity = Quantity()
    hammer_damping_coefficient: Quantity = Quantity()
    reference_name: str = "reference"
    footnotes: tuple[str, ...] = ()


def escape_markdown(text: str) -> str:
    """Return `text` so that Markdown shows it as it is, on one line."""
    line = " ".join(text.split())
    return "".join(f"\\{letter}" if letter in SPECIAL else letter for letter in line)


def format_number(value: float, pattern: str) -> str:
    """Return `value` formatted, or a dash where it is not finite."""
    return format(value, pattern) if math.isfinite(value) else ABSENT


def format_percent(value: float) -> str:
    """Return a percentage of any size with three decimals."""
    return "< 0.001" if 0.0 <= value < LEAST_PERCENT else format_number(value, ".3f")


def write_verdict(verdict: Verdict) -> str:
    """Return a hit's verdict as Markdown: which hit, the verdict, every reason, the figures."""
    label = verdict.label
    lines = [
        f"# {escape_markdown(label.sample)}",
        f"Impact {label.impact}, attempt {label.attempt} (record {label.record})",
        "## Accepted" if verdict.accepted else "## Rejected",
    ]
    lines += [_write_reason(reason) for reason in verdict.reasons]
    figures = [
        f"| {name} | {value:{pattern}} {unit} |"
        for name, value, pattern, unit in (
            ("Contact time", verdict.contact_time * 1e6, ".2f", "µs"),
            ("Hammer peak", verdict.hammer_peak, ".0f", "m/s²"),
            ("Sample peak", verdict.specimen_peak, ".0f", "m/s²"),
        )
        if math.isfinite(value)
    ]
    if figures:
        lines.append("\n".join(["| Of this hit alone | |", "|:--|--:|", *figures]))
    return "\n\n".join(lines)


def _write_reason(reason: str) -> str:
    code, separator, explanation = reason.partition(": ")
    if not separator:
        return f"- {escape_markdown(reason)}"
    return f"- **{escape_markdown(code.replace('_', ' '))}**: {escape_markdown(explanation)}"


def write_log_line(verdict: Verdict) -> str:
    """Return a hit's verdict as one line of plain text."""
    label = verdict.label
    start = f"record {label.record}: {label.sample}, impact {label.impact}"
    if label.attempt > 1:
        start += f", attempt {label.attempt}"
    if not verdict.accepted:
        return f"{start}: rejected, {'; '.join(verdict.reasons)}"
    contact_time = format_number(verdict.contact_time * 1e6, ".2f")
    return f"{start}: accepted, contact time {contact_time} µs"


def write_table(table: EstimateTable) -> str:
    """Return the estimates beside their reference values as Markdown."""
    reference = escape_markdown(table.reference_name)
    heads = ["Sample", "Hits"]
    for quantity in ("τp [µs]", "k₂ [MN/m]", "c₂ [N s/m]"):
        heads += [quantity, reference, "diff. [%]"]
    heads += ["MSE hammer [%]", "MSE sample [%]"]
    lines = [
        "| " + " | ".join(heads) + " |",
        "|:--|" + "--:|" * (len(heads) - 1),
        *(_write_row(row) for row in table.rows),
    ]
    stiffness = _write_quantity(table.hammer_stiffness, 1e-6, ".2f")
    damping = _write_quantity(table.hammer_damping_coefficient, 1.0, ".0f")
    hammer = (
        f"Hammer: k₁ = {stiffness[0]} MN/m ({reference} {stiffness[1]}),"
        f" c₁ = {damping[0]} N s/m ({reference} {damping[1]})."
    )
    paragraphs = ["\n".join(lines), hammer, *map(escape_markdown, table.footnotes)]
    return "\n\n".join(paragraphs)


def _write_row(row: EstimateRow) -> str:
    hits = f"{row.impacts_accepted}"
    if row.impacts_rejected:
        hits += f" (+{row.impacts_rejected} rejected)"
    cells = [
        escape_markdown(row.name + row.mark),
        hits,
        *_write_quantity(row.contact_time, 1e6, ".2f"),
        *_write_quantity(row.stiffness, 1e-6, ".2f"),
        *_write_quantity(row.damping_coefficient, 1.0, ".0f"),
        format_percent(row.mse_hammer_percent),
        format_percent(row.mse_sample_percent),
    ]
    return "| " + " | ".join(cells) + " |"


def _write_quantity(quantity: Quantity, factor: float, pattern: str) -> tuple[str, str, str]:
    difference = NAN
    if quantity.reference != 0.0:
        difference = 100.0 * (quantity.measured / quantity.reference - 1.0)
    return (
        format_number(quantity.measured * factor, pattern),
        format_number(quantity.reference * factor, pattern),
        format_number(difference, "+.2f"),
    )
