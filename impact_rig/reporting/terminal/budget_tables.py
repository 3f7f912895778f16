"""Uncertainty budgets: where the uncertainty of each result comes from."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console

from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import print_table
from impact_rig.results.estimates import BudgetLineResults, HammerResults, SampleResults
from impact_rig.results.numbers import MEGA, MICRO, format_uncertain

SMALLEST_SHARE = 5e-4
"""Share of the variance below which a contribution is summed up with its like [-], our choice."""


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


def print_budgets(
    console: Console, samples: Sequence[SampleResults], hammer: HammerResults
) -> None:
    """Print the uncertainty budget of every sample, and of the hammer."""
    for sample in samples:
        _print_budget(console, sample.name, sample, sample.budget)
    _print_budget(console, "hammer", hammer, hammer.budget)


def _print_budget(
    console: Console,
    name: str,
    body: SampleResults | HammerResults,
    budget: Sequence[BudgetLineResults],
) -> None:
    for quantity, shown in _SHOWN.items():
        lines = [line for line in budget if line.quantity == quantity]
        if not lines:
            continue
        large = [line for line in lines if line.share >= SMALLEST_SHARE]
        value = format_uncertain(
            getattr(body, shown.result) * shown.scale,
            getattr(body, shown.expanded) * shown.scale,
            3,
        )
        columns = [
            Column("Source", [line.source for line in large], is_text=True),
            Column("Type", [line.kind for line in large], is_text=True),
            Column(
                f"u [{shown.unit}]" if shown.unit else "u",
                [f"{line.contribution * shown.scale:.2g}" for line in large],
            ),
            Column("Share %", [f"{100.0 * line.share:.1f}" for line in large]),
        ]
        left_out = [line.source for line in lines if line.share < SMALLEST_SHARE]
        notes = ["below 0.05 %: " + ", ".join(left_out) + "."] if left_out else []
        title = f"{name}: {shown.symbol} = {value} {shown.unit}".rstrip()
        print_table(console, title, columns, notes)
