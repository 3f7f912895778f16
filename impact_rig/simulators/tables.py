"""Parameters and checks as tables, for terminal and report."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from impact_rig.results.numbers import MICRO, format_difference, format_number
from impact_rig.results.tables import (
    Table,
    make_column,
    make_optional,
    make_table,
    make_text_column,
)
from impact_rig.simulators.check import LARGEST_DIFFERENCE, EngineCheck, Motion, is_met
from impact_rig.simulators.parameters import Parameters, Value

SHORTEST_IN_MS = 100.0
"""Step that is shown in milliseconds [us]."""


def tabulate_parameters(found: Sequence[Parameters]) -> Table:
    """Return one engine's parameters of several samples."""
    engine = found[0].engine
    columns = [make_text_column("Sample", [item.contact.sample for item in found])]
    for name in found[0].values:
        values = [item.values[name] for item in found]
        units = " or ".join(dict.fromkeys(value.unit for value in values))
        header = f"{name} [{units}]" if units else name
        columns.append(make_column(header, list(map(_format_value, values))))
    forces = [
        format_difference(item.compute_pulse().peak_force, item.contact.peak_force, 1)
        for item in found
    ]
    columns.append(make_column("Force, diff. [%]", forces))
    laws = " or ".join(dict.fromkeys(item.law.equation for item in found))
    note = (
        f"{laws}, x: indentation; {engine.both_bodies}. Duration and restitution are met; the last"
        " column is what becomes of the peak force."
    )
    return make_table(f"Contacts for {engine.title}", columns, [note])


def _format_value(value: Value) -> str:
    if not value.expanded > 0.0:
        return f"{value.value:.4g}"
    return f"{value.value:.4g} ± {value.expanded:.2g}"


@dataclass(frozen=True)
class _Row:
    """What came of a contact: as it was measured, by an engine's law, or of several strikes."""

    engine: str
    step: str
    found: Sequence[Any]

    def format_range(self, name: str, digits: int, scale: float) -> str:
        """Return the values of an attribute, from the lowest to the highest."""
        values = sorted(scale * getattr(item, name) for item in self.found)
        ends = dict.fromkeys(format_number(value, digits) for value in (values[0], values[-1]))
        return " to ".join(ends)

    def format_worst(self, name: str, wanted: float) -> str:
        """Return the largest difference of an attribute from what is wanted [%]."""
        worst = max((getattr(item, name) for item in self.found), key=lambda x: abs(x - wanted))
        return format_difference(worst, wanted, 1)


def tabulate_checks(checks: Sequence[EngineCheck]) -> Table:
    """Return every engine at every step beside what was measured; they are of one contact."""
    contact = checks[0].parameters.contact
    rows = [_Row("measured", "", (contact,))]
    for check in checks:
        title = check.parameters.engine.title
        rows.append(_Row(title, "its law", (check.parameters.compute_pulse(),)))
        rows += [_Row(title, format_step(item[0].step), item) for item in check.strikes]
    columns = [
        make_text_column("Engine", [row.engine for row in rows]),
        make_column("Step", [row.step for row in rows]),
    ]
    for header, name, digits, scale in (
        ("Duration [µs]", "duration", 1, MICRO),
        ("e", "restitution", 3, 1.0),
        ("Force [N]", "peak_force", 1, 1.0),
    ):
        wanted = getattr(contact, name)
        columns += [
            make_optional(header, [row.format_range(name, digits, scale) for row in rows]),
            make_column("Diff. [%]", ["", *(row.format_worst(name, wanted) for row in rows[1:])]),
        ]
    failed = [
        place
        for place, row in enumerate(rows)
        if isinstance(row.found[0], Motion) and not is_met(row.found)
    ]
    notes = [
        (
            "The bodies touch at several places of a step: the range of what comes of it, and what"
            " differs most from what was measured."
        ),
        *(f"{check.parameters.engine.title}: {_describe_step(check)}" for check in checks),
    ]
    caption = (
        f"{contact.sample} in simulators: {1e3 * contact.hammer_mass:.1f} g meet"
        f" {1e3 * contact.sample_mass:.1f} g at {1e3 * contact.speed:.1f} mm/s"
    )
    return make_table(caption, columns, notes, failed)


def _describe_step(check: EngineCheck) -> str:
    percent = f"{100.0 * LARGEST_DIFFERENCE:g} %"
    if math.isnan(check.largest_step):
        return f"at none of these steps are duration and restitution within {percent}."
    step = format_step(check.largest_step)
    return f"duration and restitution are within {percent} at steps of {step} and below."


def format_step(step: float) -> str:
    """Return a step with a unit: 1 ms, 0.1 ms, 10 µs."""
    microseconds = round(MICRO * step, 9)
    return (
        f"{microseconds / 1e3:g} ms" if microseconds >= SHORTEST_IN_MS else f"{microseconds:g} µs"
    )
