"""The paper's Tables 2, 3 and 4: measured beside expected."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Console

from impact_rig.core.model.pulses import HALF_SINE, HERTZ, VERSED_SINE
from impact_rig.reporting.terminal.columns import Column, make_optional
from impact_rig.reporting.terminal.console import ALARM, print_table
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.numbers import (
    MEGA,
    MICRO,
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

BEYOND_MARK = "!"
BEYOND_NOTE = (
    f"{BEYOND_MARK} differs by more than the uncertainty of the measured value, a 95 % interval:"
    " by chance one in twenty does."
)


@dataclass(frozen=True)
class _Row:
    """One body of a table: a value and its expanded uncertainty beside what is expected of it."""

    name: str
    value: float
    expanded: float
    expected: float
    reference: Reference

    @property
    def is_beyond(self) -> bool:
        """Whether the two lie further apart than the uncertainty; False: it is not known."""
        return abs(self.value - self.expected) > self.expanded


@dataclass(frozen=True)
class _Quantity:
    """What one of the paper's tables shows, and how."""

    title: str
    symbol: str
    scale: float
    digits: int
    read_result: Callable[[SampleResults], float]
    read_expanded: Callable[[SampleResults], float]
    read_reference: Callable[[Reference], float]

    def make_rows(self, results: Results) -> list[_Row]:
        rows, sample_set = [], results.setup.to_samples()
        for sample in results.samples:
            reference = find_reference(sample_set, sample.name)
            rows.append(
                _Row(
                    sample.name,
                    self.read_result(sample),
                    self.read_expanded(sample),
                    self.read_reference(reference),
                    reference,
                )
            )
        return rows


CONTACT_TIME = _Quantity(
    title="Table 2. Contact time τp [µs]",
    symbol="τp",
    scale=MICRO,
    digits=2,
    read_result=lambda sample: sample.contact_time_s,
    read_expanded=lambda sample: sample.contact_time_expanded_s,
    read_reference=lambda reference: reference.contact_time,
)
STIFFNESS = _Quantity(
    title="Table 3. Stiffness k [MN/m]",
    symbol="k2",
    scale=MEGA,
    digits=2,
    read_result=lambda sample: sample.stiffness_n_per_m,
    read_expanded=lambda sample: sample.stiffness_expanded_n_per_m,
    read_reference=lambda reference: reference.stiffness,
)
DAMPING = _Quantity(
    title="Table 4. Damping coefficient c [N s/m]",
    symbol="c2",
    scale=1.0,
    digits=1,
    read_result=lambda sample: sample.damping_coefficient_n_s_per_m,
    read_expanded=lambda sample: sample.damping_coefficient_expanded_n_s_per_m,
    read_reference=lambda reference: reference.damping_coefficient,
)


def _make_columns(rows: Sequence[_Row], quantity: _Quantity) -> list[Column]:
    """Return name, expected, measured and difference; no empty columns."""
    names = Column(
        "Sample",
        [f"{row.name} *" if row.reference.is_misprinted else row.name for row in rows],
        is_text=True,
    )
    measured = Column(
        "Measured",
        [
            format_uncertain(
                row.value * quantity.scale, row.expanded * quantity.scale, quantity.digits
            )
            for row in rows
        ],
    )
    referenced = [row for row in rows if math.isfinite(row.expected)]
    if not referenced:
        return [names, measured]
    expected = Column(
        "Paper" if all(row.reference.is_published for row in referenced) else "Reference",
        [
            format_number(row.expected * quantity.scale, quantity.digits)
            if row in referenced
            else ""
            for row in rows
        ],
    )
    return [names, expected, measured, _make_difference_column(rows)]


def _make_difference_column(rows: Sequence[_Row]) -> Column:
    """Return the differences, marked where the uncertainty does not cover them."""
    marked = any(row.is_beyond for row in rows)
    cells = []
    for row in rows:
        known = math.isfinite(row.expected)
        cell = format_difference(row.value, row.expected) if known else ""
        mark = BEYOND_MARK if row.is_beyond else " "
        cells.append(f"{cell} {mark}" if marked else cell)
    styles = [ALARM if row.is_beyond else "" for row in rows]
    return Column("Diff. %", cells, styles=styles, note=BEYOND_NOTE if marked else "")


def print_contact_times(console: Console, results: Results) -> None:
    """Print Table 2, with the pulse's width ratio and the hits."""
    rows, samples = CONTACT_TIME.make_rows(results), results.samples
    shapes = ", ".join(
        f"{shape.name} {shape.width_ratio:.2f}" for shape in (VERSED_SINE, HERTZ, HALF_SINE)
    )
    columns = [
        *_make_columns(rows, CONTACT_TIME),
        make_optional(
            "Hits",
            [str(item.impacts_accepted) for item in samples],
            styles=["" if item.impacts_accepted else ALARM for item in samples],
        ),
        make_optional(
            "Rejected",
            [str(item.impacts_rejected) for item in samples],
            styles=[ALARM if item.impacts_rejected else "" for item in samples],
        ),
        make_optional(
            "w10/w50",
            [format_number(item.width_ratio, 3) for item in samples],
            "w10/w50: width at a tenth of the peak over that at half of it, which tells pulse"
            f" shapes apart: {shapes}.",
        ),
        make_optional(
            "Spread",
            [format_number(item.contact_time_spread_s * MICRO, 2) for item in samples],
            "Spread: standard deviation over the hits.",
        ),
    ]
    notes = [
        explain_misprint(row.reference.published)
        for row in rows
        if row.reference.published and row.reference.is_misprinted
    ]
    print_table(console, CONTACT_TIME.title, columns, notes)


def print_stiffness(console: Console, results: Results) -> None:
    """Print Table 3, the hammer's stiffness below the samples'."""
    hammer, reference = results.hammer, find_hammer_reference(results.setup.to_samples())
    rows = STIFFNESS.make_rows(results)
    rows.append(
        _Row(
            "hammer",
            hammer.stiffness_n_per_m,
            hammer.stiffness_expanded_n_per_m,
            reference.stiffness,
            reference,
        )
    )
    equivalent = [item.equivalent_stiffness_n_per_m * MEGA for item in results.samples]
    columns = [
        *_make_columns(rows, STIFFNESS),
        make_optional("k_eq", [*(format_number(value, 3) for value in equivalent), ""]),
    ]
    notes = _explain_mark(rows)
    if hammer.control_sample:
        notes.append(f"hammer: k1 = 2 k_eq of the control sample, {hammer.control_sample}.")
    print_table(console, STIFFNESS.title, columns, notes)


def print_damping(console: Console, results: Results) -> None:
    """Print Table 4, by the logarithmic decrement, the hammer's damping below the samples'."""
    hammer, reference = results.hammer, find_hammer_reference(results.setup.to_samples())
    rows = DAMPING.make_rows(results)
    rows.append(
        _Row(
            "hammer",
            hammer.damping_coefficient_n_s_per_m,
            hammer.damping_coefficient_expanded_n_s_per_m,
            reference.damping_coefficient,
            reference,
        )
    )
    bodies: list[SampleResults | HammerResults] = [*results.samples, hammer]
    columns = [
        *_make_columns(rows, DAMPING),
        make_optional(
            "ζ",
            [
                format_uncertain(body.damping_ratio, body.damping_ratio_expanded, 3)
                for body in bodies
            ],
        ),
        make_optional("Δ", [format_number(body.log_decrement, 3) for body in bodies]),
    ]
    print_table(console, DAMPING.title, columns, _explain_mark(rows))


def _explain_mark(rows: Sequence[_Row]) -> list[str]:
    if not any(row.reference.is_misprinted for row in rows):
        return []
    return ["* its contact time is misprinted in the paper, see Table 2."]


def find_largest_differences(results: Results) -> dict[str, float]:
    """Return the largest differences from what is expected, by symbol [%]; unknown ones absent."""
    largest = {}
    for quantity in (CONTACT_TIME, STIFFNESS, DAMPING):
        rows = quantity.make_rows(results)
        differences = [abs(compute_difference(row.value, row.expected)) for row in rows]
        known = [difference for difference in differences if math.isfinite(difference)]
        if known:
            largest[quantity.symbol] = max(known)
    return largest
