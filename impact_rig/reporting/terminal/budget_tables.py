"""Uncertainty budgets in a terminal: where the uncertainty of each result comes from."""

from collections.abc import Sequence

from rich.console import Console

from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import print_table
from impact_rig.results.budgets import list_budgets
from impact_rig.results.estimates import HammerResults, SampleResults


def print_budgets(
    console: Console, samples: Sequence[SampleResults], hammer: HammerResults
) -> None:
    """Print the uncertainty budget of every sample, and of the hammer."""
    for sample in samples:
        _print_budgets_of(console, sample.name, sample)
    _print_budgets_of(console, "hammer", hammer)


def _print_budgets_of(console: Console, name: str, body: SampleResults | HammerResults) -> None:
    for budget in list_budgets(name, body):
        columns = [
            Column("Source", budget.sources, is_text=True),
            Column("Type", budget.kinds, is_text=True),
            Column(budget.contribution_header, budget.contributions),
            Column("Share %", budget.shares),
        ]
        print_table(console, budget.title, columns, [budget.remark] if budget.remark else [])
