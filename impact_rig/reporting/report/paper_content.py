"""Tables 2, 3 and 4 of the paper: measured beside expected."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from impact_rig.core.model.pulses import HALF_SINE, HERTZ, VERSED_SINE
from impact_rig.reporting.report.document import (
    Column,
    Table,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.campaign import Results
from impact_rig.results.comparison import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    STIFFNESS,
    Quantity,
)
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.numbers import (
    MEGA,
    MICRO,
    MISSING,
    compute_difference,
    format_difference,
    format_number,
    format_uncertain,
)
from impact_rig.results.references import (
    Reference,
    explain_misprint,
    find_hammer_reference,
    find_reference,
)

HAMMER = "hammer"
AGREES, DISAGREES = "yes", "no"
JUDGEMENT = (
    "Agrees: the difference is no larger than the measured value's uncertainty; that of the"
    " expected value is not known."
)
_EXPECTED: dict[str, Callable[[Reference], float]] = {
    CONTACT_TIME.name: lambda reference: reference.contact_time,
    STIFFNESS.name: lambda reference: reference.stiffness,
    DAMPING_COEFFICIENT.name: lambda reference: reference.damping_coefficient,
}


@dataclass(frozen=True)
class _Row:
    """One body of a table."""

    name: str
    body: SampleResults | HammerResults
    reference: Reference


def tabulate_contact_times(results: Results) -> Table:
    """Return Table 2, with the pulse's width ratio, hits and spread."""
    rows, samples = _make_rows(results, with_hammer=False), results.samples
    columns = [
        *_make_columns(rows, CONTACT_TIME),
        make_column("w10/w50", [format_number(item.width_ratio, 3) for item in samples]),
        make_column(
            "Spread [µs]",
            [format_number(item.contact_time_spread_s * MICRO, 2) for item in samples],
        ),
        make_column("Hits", [str(item.impacts_accepted) for item in samples]),
        make_column("Rejected", [str(item.impacts_rejected) for item in samples]),
    ]
    shapes = ", ".join(
        f"{shape.name} {shape.width_ratio:.2f}" for shape in (VERSED_SINE, HERTZ, HALF_SINE)
    )
    notes = [
        explain_misprint(row.reference.published)
        for row in rows
        if row.reference.published and row.reference.is_misprinted
    ]
    if any(_judge(row, CONTACT_TIME) != MISSING for row in rows):
        notes.append(JUDGEMENT)
    notes.append(
        "w10/w50: width at a tenth of the peak over that at half of it, which tells pulse shapes"
        f" apart: {shapes}. Spread: standard deviation over the hits in the mean."
    )
    return make_table("Table 2. Contact time τp", columns, notes, _mark(rows, CONTACT_TIME))


def tabulate_stiffness(results: Results) -> list[Table]:
    """Return Table 3, the hammer below the samples; nothing if no stiffness is known."""
    rows = _make_rows(results, with_hammer=True)
    if not _has_values(rows, STIFFNESS):
        return []
    equivalent = [
        format_uncertain(
            item.equivalent_stiffness_n_per_m * MEGA,
            item.equivalent_stiffness_expanded_n_per_m * MEGA,
            3,
        )
        for item in results.samples
    ]
    columns = [
        *_make_columns(rows, STIFFNESS),
        make_column("k_eq [MN/m]", [*equivalent, ""]),
        make_column("Hits", _count_hits(results)),
    ]
    notes = _explain_mark(rows)
    if results.hammer.control_sample:
        control = results.hammer.control_sample
        notes.append(f"Hammer: k1 = 2 k_eq of the control sample, {control}.")
    return [make_table("Table 3. Stiffness k", columns, notes, _mark(rows, STIFFNESS))]


def tabulate_damping(results: Results) -> list[Table]:
    """Return Table 4, by the logarithmic decrement, the hammer below the samples.

    Nothing if no damping is known.
    """
    rows = _make_rows(results, with_hammer=True)
    if not _has_values(rows, DAMPING_COEFFICIENT):
        return []
    bodies = [row.body for row in rows]
    columns = [
        *_make_columns(rows, DAMPING_COEFFICIENT),
        make_column(
            "ζ",
            [
                format_uncertain(body.damping_ratio, body.damping_ratio_expanded, 3)
                for body in bodies
            ],
        ),
        make_column("Δ", [format_number(body.log_decrement, 3) for body in bodies]),
        make_column("Hits", _count_hits(results)),
    ]
    notes, marked = _explain_mark(rows), _mark(rows, DAMPING_COEFFICIENT)
    return [make_table("Table 4. Damping coefficient c", columns, notes, marked)]


def find_largest_differences(results: Results) -> dict[str, tuple[float, str]]:
    """Return the largest difference from what is expected and whose it is, by symbol [%]."""
    largest = {}
    for quantity in (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT):
        differences = [
            (abs(_find_difference(row, quantity)), row.name)
            for row in _make_rows(results, with_hammer=False)
        ]
        known = [item for item in differences if math.isfinite(item[0])]
        if known:
            largest[quantity.symbol] = max(known)
    return largest


def _make_rows(results: Results, *, with_hammer: bool) -> list[_Row]:
    samples = results.setup.to_samples()
    rows = [
        _Row(sample.name, sample, find_reference(samples, sample.name))
        for sample in results.samples
    ]
    if with_hammer:
        rows.append(_Row(HAMMER, results.hammer, find_hammer_reference(samples)))
    return rows


def _make_columns(rows: Sequence[_Row], quantity: Quantity) -> list[Column]:
    """Return name, expected, measured and difference."""
    expected = [_EXPECTED[quantity.name](row.reference) for row in rows]
    published = all(
        row.reference.is_published
        for row, value in zip(rows, expected, strict=True)
        if math.isfinite(value)
    )
    return [
        make_text_column(
            "Sample",
            [f"{row.name} *" if row.reference.is_misprinted else row.name for row in rows],
        ),
        make_column(
            f"{'Paper' if published else 'Reference'} [{quantity.unit}]",
            _format_expected([value * quantity.scale for value in expected], quantity.digits),
        ),
        make_column(
            f"Measured [{quantity.unit}]",
            [
                format_uncertain(
                    quantity.read_value(row.body) * quantity.scale,
                    quantity.read_expanded(row.body) * quantity.scale,
                    quantity.digits,
                )
                for row in rows
            ],
        ),
        make_column(
            "Difference [%]",
            [
                format_difference(quantity.read_value(row.body), value)
                for row, value in zip(rows, expected, strict=True)
            ],
        ),
        make_text_column("Agrees", [_judge(row, quantity) for row in rows]),
    ]


def _judge(row: _Row, quantity: Quantity) -> str:
    """Return whether a difference is explained by the measured value's uncertainty."""
    expanded = quantity.read_expanded(row.body)
    difference = quantity.read_value(row.body) - _EXPECTED[quantity.name](row.reference)
    if not (math.isfinite(difference) and expanded > 0.0):
        return MISSING
    return DISAGREES if abs(difference) > expanded else AGREES


def _mark(rows: Sequence[_Row], quantity: Quantity) -> list[int]:
    """Return the rows that do not agree with what is expected."""
    return [place for place, row in enumerate(rows) if _judge(row, quantity) == DISAGREES]


def _format_expected(values: Sequence[float], digits: int) -> list[str]:
    """Return what is expected, without decimals that nobody gave."""
    is_whole = all(value == round(value) for value in values if math.isfinite(value))
    return [format_number(value, 0 if is_whole else digits) for value in values]


def _has_values(rows: Sequence[_Row], quantity: Quantity) -> bool:
    return any(math.isfinite(quantity.read_value(row.body)) for row in rows)


def _find_difference(row: _Row, quantity: Quantity) -> float:
    expected = _EXPECTED[quantity.name](row.reference)
    return compute_difference(quantity.read_value(row.body), expected)


def _count_hits(results: Results) -> list[str]:
    return [*(str(item.impacts_accepted) for item in results.samples), ""]


def _explain_mark(rows: Sequence[_Row]) -> list[str]:
    if not any(row.reference.is_misprinted for row in rows):
        return []
    return ["* Its contact time is misprinted in the paper, see Table 2."]
