"""Results as Markdown: Tables 2 to 4 in one, remarks, rejected hits, and one sample by itself."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence

from impact_rig.results.campaign import Results
from impact_rig.results.cross_checks import IdentificationResults
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import (
    MEGA,
    MICRO,
    format_difference,
    format_number,
    format_uncertain,
)
from impact_rig.results.references import (
    NAN,
    Reference,
    explain_misprint,
    find_hammer_reference,
    find_reference,
)
from impact_rig.visualization.drawing.text import escape_markdown, format_percent, write_reason

LEGEND = (
    "Behind ± stands the half-width of the 95 % interval. A dash: not determined, see the notes."
)
NOT_YET = "Nothing is measured yet."


def write_results(results: Results) -> str:
    """Return everything found as Markdown: values, remarks, and hits that were rejected."""
    if not results.samples:
        return "\n\n".join([NOT_YET, *_write_rejections(results)])
    samples = results.setup.to_samples()
    references = [find_reference(samples, sample.name) for sample in results.samples]
    all_published = all(reference.is_published for reference in references)
    return "\n\n".join(
        [
            "# Tables 2 to 4",
            _write_main_table(results, references, "paper" if all_published else "expected"),
            *(
                escape_markdown(explain_misprint(reference.published))
                for reference in references
                if reference.is_misprinted and reference.published is not None
            ),
            LEGEND,
            *_write_remarks("Warnings", ((item.name, item.warnings) for item in results.samples)),
            *_write_remarks(
                "Notes",
                (
                    ("hammer", results.hammer.notes),
                    *((item.name, item.notes) for item in results.samples),
                ),
            ),
            *_write_rejections(results),
        ]
    )


def write_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; its cells are Markdown already."""
    lines = [heads, [":--", *("--:" for _ in heads[1:])], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _write_main_table(results: Results, references: Sequence[Reference], beside: str) -> str:
    heads = ["Sample", "Hits"]
    for quantity in ("τp [µs]", "k₂ [MN/m]", "c₂ [N s/m]"):
        heads += [f"**{quantity}**", beside, "diff. [%]"]
    heads += ["ζ₂", "MSE hammer [%]", "MSE sample [%]"]
    rows = [
        _write_sample(sample, reference)
        for sample, reference in zip(results.samples, references, strict=True)
    ]
    hammer, expected = results.hammer, find_hammer_reference(results.setup.to_samples())
    rows.append(
        [
            "hammer (k₁, c₁)",
            "",
            *("", "", ""),
            *_write_quantity(
                hammer.stiffness_n_per_m,
                hammer.stiffness_expanded_n_per_m,
                expected.stiffness,
                (MEGA, 2),
            ),
            *_write_quantity(
                hammer.damping_coefficient_n_s_per_m,
                hammer.damping_coefficient_expanded_n_s_per_m,
                expected.damping_coefficient,
                (1.0, 0),
            ),
            format_uncertain(hammer.damping_ratio, hammer.damping_ratio_expanded, 3),
            *("", ""),
        ]
    )
    return write_table(heads, rows)


def _write_sample(sample: SampleResults, reference: Reference) -> list[str]:
    hits = f"{sample.impacts_accepted}"
    if sample.impacts_rejected:
        hits += f" (+{sample.impacts_rejected} rejected)"
    mark = " *" if reference.is_misprinted else ""
    return [
        escape_markdown(sample.name + mark),
        hits,
        *_write_quantity(
            sample.contact_time_s,
            sample.contact_time_expanded_s,
            reference.contact_time,
            (MICRO, 2),
        ),
        *_write_quantity(
            sample.stiffness_n_per_m,
            sample.stiffness_expanded_n_per_m,
            reference.stiffness,
            (MEGA, 2),
        ),
        *_write_quantity(
            sample.damping_coefficient_n_s_per_m,
            sample.damping_coefficient_expanded_n_s_per_m,
            reference.damping_coefficient,
            (1.0, 0),
        ),
        format_uncertain(sample.damping_ratio, sample.damping_ratio_expanded, 3),
        format_percent(sample.mse_hammer_percent),
        format_percent(sample.mse_sample_percent),
    ]


def _write_quantity(
    value: float, expanded: float, reference: float, scale: tuple[float, int]
) -> tuple[str, str, str]:
    """Return value, reference and difference, by factor and decimals of their unit."""
    factor, digits = scale
    return (
        f"**{format_uncertain(value * factor, expanded * factor, digits)}**",
        format_number(reference * factor, digits),
        format_difference(value, reference if reference != 0.0 else NAN),
    )


def _write_remarks(title: str, remarks: Iterable[tuple[str, tuple[str, ...]]]) -> list[str]:
    """Return a heading and each remark once, with the names of whom it is about."""
    names = defaultdict(list)
    for name, texts in remarks:
        for text in texts:
            names[text].append(name)
    items = [
        f"- **{escape_markdown(', '.join(about))}**: {escape_markdown(text)}"
        for text, about in names.items()
    ]
    return [f"## {title}", "\n".join(items)] if items else []


def _write_rejections(results: Results) -> list[str]:
    if not results.rejections:
        return []
    paragraphs = ["## Rejected hits"]
    for hit in results.rejections:
        name = f"Record {hit.record}: {hit.sample}, impact {hit.impact}, attempt {hit.attempt}"
        paragraphs.append("\n".join([escape_markdown(name), "", *map(write_reason, hit.reasons)]))
    return paragraphs


def write_summary(results: Results, sample: SampleResults) -> str:
    """Return one sample by itself: what was found by which method, what to know of it."""
    reference = find_reference(results.setup.to_samples(), sample.name)
    decay, fitted = sample.free_decay, sample.identification or IdentificationResults("")
    rows = [
        ["", "paper's method", "free decay", f"fit ({fitted.model or 'none'})", "expected"],
        [
            "τp [µs]",
            format_uncertain(
                sample.contact_time_s * MICRO, sample.contact_time_expanded_s * MICRO, 2
            ),
            "",
            format_uncertain(
                fitted.contact_time_s * MICRO, fitted.contact_time_expanded_s * MICRO, 2
            ),
            format_number(reference.contact_time * MICRO, 2),
        ],
        [
            "k₂ [MN/m]",
            format_uncertain(
                sample.stiffness_n_per_m * MEGA, sample.stiffness_expanded_n_per_m * MEGA, 2
            ),
            format_uncertain(
                decay.stiffness_n_per_m * MEGA, decay.stiffness_expanded_n_per_m * MEGA, 2
            ),
            format_uncertain(
                fitted.stiffness_n_per_m * MEGA, fitted.stiffness_expanded_n_per_m * MEGA, 2
            ),
            format_number(reference.stiffness * MEGA, 2),
        ],
        [
            "c₂ [N s/m]",
            *(
                format_uncertain(
                    item.damping_coefficient_n_s_per_m,
                    item.damping_coefficient_expanded_n_s_per_m,
                    0,
                )
                for item in (sample, decay, fitted)
            ),
            format_number(reference.damping_coefficient, 0),
        ],
        [
            "ζ₂",
            *(
                format_uncertain(item.damping_ratio, item.damping_ratio_expanded, 3)
                for item in (sample, decay, fitted)
            ),
            "",
        ],
    ]
    paragraphs = [
        f"# {escape_markdown(sample.name)}",
        f"{sample.impacts_accepted} hits in the mean, {sample.impacts_rejected} rejected.",
        write_table(rows[0], rows[1:]),
        _write_pulse(sample),
        *(
            escape_markdown(explain_misprint(reference.published))
            for _ in range(reference.is_misprinted)
            if reference.published is not None
        ),
    ]
    for title, texts in (
        ("Warnings", sample.warnings),
        ("Notes", (*sample.notes, *fitted.notes)),
    ):
        if texts:
            paragraphs += [f"## {title}", "\n".join(f"- {escape_markdown(t)}" for t in texts)]
    return "\n\n".join(paragraphs)


def _write_pulse(sample: SampleResults) -> str:
    parts = [
        f"w50 {format_number(sample.half_amplitude_width_s * MICRO, 2)} µs",
        f"w10/w50 {format_number(sample.width_ratio, 3)}",
        f"U1 {format_number(sample.first_peak_m_per_s2, 1)} m/s²",
        f"U2 {format_number(sample.second_peak_m_per_s2, 1)} m/s²",
        f"log decrement {format_number(sample.log_decrement, 3)}",
    ]
    shape = sample.pulse_shape
    if shape.best_shape:
        surely = "" if shape.is_told_apart else ", not told apart from the next"
        parts.append(f"pulse {shape.best_shape}{surely}")
    if math.isfinite(sample.contact_error_sample_percent):
        parts.append(
            "model over the contact, RMS error"
            f" hammer {format_percent(sample.contact_error_hammer_percent)} %,"
            f" sample {format_percent(sample.contact_error_sample_percent)} %"
        )
    return escape_markdown("; ".join(parts) + ".")
