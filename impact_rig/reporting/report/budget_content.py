"""Uncertainty budgets: where the uncertainty of each result comes from."""

from collections.abc import Sequence
from dataclasses import dataclass

from impact_rig.reporting.report.document import (
    Folded,
    Part,
    Table,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.estimates import BudgetLineResults, HammerResults, SampleResults
from impact_rig.results.numbers import MEGA, MICRO, format_uncertain

SMALLEST_SHARE = 5e-4
"""Share of the variance below which a contribution is named only [-], our choice."""


@dataclass(frozen=True)
class _Shown:
    """How a quantity of the budget is shown."""

    symbol: str
    unit: str
    scale: float
    result: str
    expanded: str


_SHOWN = {
    "contact_time": _Shown("τp", "µs", MICRO, "contact_time_s", "contact_time_expanded_s"),
    "stiffness": _Shown("k", "MN/m", MEGA, "stiffness_n_per_m", "stiffness_expanded_n_per_m"),
    "damping_coefficient": _Shown(
        "c",
        "N s/m",
        1.0,
        "damping_coefficient_n_s_per_m",
        "damping_coefficient_expanded_n_s_per_m",
    ),
    "damping_ratio": _Shown("ζ", "", 1.0, "damping_ratio", "damping_ratio_expanded"),
}


def fold_budget(name: str, body: SampleResults | HammerResults) -> list[Part]:
    """Return the uncertainty budget of one body, to be unfolded; nothing if it has none."""
    tables = [
        _tabulate(name, body, shown, lines)
        for quantity, shown in _SHOWN.items()
        if (lines := [line for line in body.budget if line.quantity == quantity])
    ]
    return [Folded(f"Uncertainty budget of {name}", tuple(tables))] if tables else []


def _tabulate(
    name: str,
    body: SampleResults | HammerResults,
    shown: _Shown,
    lines: Sequence[BudgetLineResults],
) -> Table:
    large = [line for line in lines if line.share >= SMALLEST_SHARE]
    value = format_uncertain(
        getattr(body, shown.result) * shown.scale, getattr(body, shown.expanded) * shown.scale, 3
    )
    columns = [
        make_text_column("Source", [line.source for line in large]),
        make_text_column("Type", [line.kind for line in large]),
        make_column(
            f"u [{shown.unit}]" if shown.unit else "u",
            [f"{line.contribution * shown.scale:.2g}" for line in large],
        ),
        make_column("Share of the variance [%]", [f"{100.0 * line.share:.1f}" for line in large]),
    ]
    small = [line.source for line in lines if line.share < SMALLEST_SHARE]
    notes = [f"Below 0.05 %: {', '.join(small)}."] if small else []
    return make_table(f"{name}: {shown.symbol} = {value} {shown.unit}".rstrip(), columns, notes)
