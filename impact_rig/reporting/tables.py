"""The tables of a campaign: the paper's 2, 3 and 4 and its Fig. 6, measured beside expected."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.text import Text

from impact_rig.core.model.pulses import HALF_SINE, HERTZ, VERSED_SINE
from impact_rig.core.setup.samples import SampleSet
from impact_rig.reporting.references import (
    Reference,
    explain_misprint,
    find_hammer_reference,
    find_reference,
)
from impact_rig.reporting.results import HammerResults, Results, SampleResults
from impact_rig.reporting.terminal import (
    MISSING,
    Column,
    compute_difference,
    format_difference,
    format_number,
    print_table,
)

MICRO = 1e6
"""Seconds to microseconds."""
MEGA = 1e-6
"""N/m to MN/m."""


@dataclass(frozen=True)
class _Row:
    """One body of a table: a value beside what is expected of it."""

    name: str
    value: float
    expected: float
    reference: Reference


@dataclass(frozen=True)
class _Quantity:
    """What one of the paper's tables shows, and how."""

    title: str
    symbol: str
    scale: float
    digits: int
    read_result: Callable[[SampleResults], float]
    read_reference: Callable[[Reference], float]

    def make_rows(self, samples: Sequence[SampleResults], sample_set: SampleSet) -> list[_Row]:
        rows = []
        for sample in samples:
            reference = find_reference(sample_set, sample.name)
            rows.append(
                _Row(
                    sample.name,
                    self.read_result(sample),
                    self.read_reference(reference),
                    reference,
                )
            )
        return rows


_CONTACT_TIME = _Quantity(
    title="Table 2. Contact time τp [µs]",
    symbol="τp",
    scale=MICRO,
    digits=2,
    read_result=lambda sample: sample.contact_time_s,
    read_reference=lambda reference: reference.contact_time,
)
_STIFFNESS = _Quantity(
    title="Table 3. Stiffness k [MN/m]",
    symbol="k2",
    scale=MEGA,
    digits=2,
    read_result=lambda sample: sample.stiffness_n_per_m,
    read_reference=lambda reference: reference.stiffness,
)
_DAMPING = _Quantity(
    title="Table 4. Damping coefficient c [N s/m]",
    symbol="c2",
    scale=1.0,
    digits=1,
    read_result=lambda sample: sample.damping_coefficient_n_s_per_m,
    read_reference=lambda reference: reference.damping_coefficient,
)


def print_results(console: Console, results: Results, samples: SampleSet) -> None:
    """Print everything that a campaign found.

    The list of rejected hits, which may be long, comes first: the results stay in sight.

    Parameters
    ----------
    console : Console
        See `make_console`.
    results : Results
        What was found.
    samples : SampleSet
        Where the expected values come from.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in the set.
    """
    print_rejections(console, results)
    _print_contact_times(console, results.samples, samples)
    _print_stiffness(console, results, samples)
    _print_damping(console, results, samples)
    print_comparison(console, results.samples)
    print_notes(console, results.samples)
    _print_summary(console, results, samples)


def _make_columns(rows: Sequence[_Row], quantity: _Quantity) -> list[Column]:
    """Return name, expected, measured and difference; no empty columns."""
    names = Column(
        "Sample",
        [f"{row.name} *" if row.reference.is_misprinted else row.name for row in rows],
        is_text=True,
    )
    measured = Column(
        "Measured", [format_number(row.value * quantity.scale, quantity.digits) for row in rows]
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
    difference = Column(
        "Diff. %",
        [format_difference(row.value, row.expected) if row in referenced else "" for row in rows],
    )
    return [names, expected, measured, difference]


def _make_extra(header: str, cells: Sequence[str]) -> Column:
    return Column(header, cells, is_optional=True)


def _print_contact_times(
    console: Console, results: Sequence[SampleResults], samples: SampleSet
) -> None:
    rows = _CONTACT_TIME.make_rows(results, samples)
    columns = [
        *_make_columns(rows, _CONTACT_TIME),
        _make_extra("w10/w50", [format_number(item.width_ratio, 3) for item in results]),
        _make_extra("Hits", [str(item.impacts_accepted) for item in results]),
        _make_extra("Rejected", [str(item.impacts_rejected) for item in results]),
        _make_extra(
            "Spread", [format_number(item.contact_time_spread_s * MICRO, 2) for item in results]
        ),
    ]
    shapes = ", ".join(
        f"{shape.name} {shape.width_ratio:.2f}" for shape in (VERSED_SINE, HERTZ, HALF_SINE)
    )
    notes = [
        explain_misprint(row.reference.published)
        for row in rows
        if row.reference.published and row.reference.is_misprinted
    ]
    notes.append(
        "w10/w50: width at a tenth of the peak over that at half of it, which tells pulse shapes"
        f" apart: {shapes}. Spread: standard deviation over the hits."
    )
    print_table(console, _CONTACT_TIME.title, columns, notes)


def _print_stiffness(console: Console, results: Results, samples: SampleSet) -> None:
    hammer, reference = results.hammer, find_hammer_reference(samples)
    rows = _STIFFNESS.make_rows(results.samples, samples)
    rows.append(_Row("hammer", hammer.stiffness_n_per_m, reference.stiffness, reference))
    equivalent = [item.equivalent_stiffness_n_per_m * MEGA for item in results.samples]
    columns = [
        *_make_columns(rows, _STIFFNESS),
        _make_extra("k_eq", [*(format_number(value, 3) for value in equivalent), ""]),
    ]
    notes = _explain_mark(rows)
    if hammer.control_sample:
        notes.append(f"hammer: k1 = 2 k_eq of the control sample, {hammer.control_sample}.")
    print_table(console, _STIFFNESS.title, columns, notes)


def _print_damping(console: Console, results: Results, samples: SampleSet) -> None:
    hammer, reference = results.hammer, find_hammer_reference(samples)
    rows = _DAMPING.make_rows(results.samples, samples)
    rows.append(
        _Row(
            "hammer",
            hammer.damping_coefficient_n_s_per_m,
            reference.damping_coefficient,
            reference,
        )
    )
    bodies: list[SampleResults | HammerResults] = [*results.samples, hammer]
    columns = [
        *_make_columns(rows, _DAMPING),
        _make_extra("ζ", [format_number(body.damping_ratio, 3) for body in bodies]),
        _make_extra("Δ", [format_number(body.log_decrement, 3) for body in bodies]),
    ]
    print_table(console, _DAMPING.title, columns, _explain_mark(rows))


def _explain_mark(rows: Sequence[_Row]) -> list[str]:
    if not any(row.reference.is_misprinted for row in rows):
        return []
    return ["* its contact time is misprinted in the paper, see Table 2."]


def print_comparison(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print how far model and measurement lie apart, if any sample could be compared."""
    if all(math.isnan(sample.mse_hammer_percent) for sample in samples):
        return

    def column(header: str, name: str, digits: int, scale: float = 1.0) -> Column:
        values = [getattr(sample, name) * scale for sample in samples]
        return _make_extra(header, [format_number(value, digits) for value in values])

    columns = [
        Column("Sample", [sample.name for sample in samples], is_text=True),
        column("MSE\nhammer", "mse_hammer_percent", 3),
        column("MSE\nsample", "mse_sample_percent", 2),
        column("contact\nhammer", "contact_error_hammer_percent", 1),
        column("contact\nsample", "contact_error_sample_percent", 1),
        column("printed\nhammer", "printed_mse_hammer_percent", 2),
        column("printed\nsample", "printed_mse_sample_percent", 2),
        column("shift\nsample", "shift_sample_s", 1, MICRO),
        column("shift\nhammer", "shift_hammer_s", 1, MICRO),
    ]
    note = (
        "MSE: over the record, with the force of equation (4) alone driving the sample. contact:"
        " RMS error of the same over the contact. printed: MSE of equations (1) and (2) as"
        " printed. shift [µs]: applied to the model of MSE, later is positive."
    )
    print_table(console, "Fig. 6. Model against measurement [%]", columns, [note])


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


def print_notes(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what could not be determined, each note once with the samples it holds for."""
    holders: dict[str, list[str]] = {}
    for sample in samples:
        for note in sample.notes:
            holders.setdefault(note, []).append(sample.name)
    if not holders:
        return
    console.print(Text("Not determined", style="bold yellow"))
    for note, names in holders.items():
        whose = "all samples" if len(names) == len(samples) > 1 else ", ".join(names)
        console.print(Text(f"- {whose}: {note}"))
    console.print()


def _print_summary(console: Console, results: Results, samples: SampleSet) -> None:
    accepted = sum(sample.impacts_accepted for sample in results.samples)
    console.print(
        f"{len(results.samples)} samples, {accepted} hits accepted,"
        f" {len(results.rejections)} rejected."
    )
    largest = []
    for quantity in (_CONTACT_TIME, _STIFFNESS, _DAMPING):
        rows = quantity.make_rows(results.samples, samples)
        differences = [abs(compute_difference(row.value, row.expected)) for row in rows]
        known = [difference for difference in differences if math.isfinite(difference)]
        if known:
            largest.append(f"{quantity.symbol} {max(known):.2f} %")
    if largest:
        console.print(f"Largest differences: {', '.join(largest)}.")
