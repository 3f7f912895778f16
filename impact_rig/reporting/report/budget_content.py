"""Uncertainty budgets in a report: where the uncertainty of each result comes from."""

from impact_rig.reporting.report.document import (
    Folded,
    Part,
    Table,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.budgets import Budget, list_budgets
from impact_rig.results.estimates import HammerResults, SampleResults


def fold_budget(name: str, body: SampleResults | HammerResults) -> list[Part]:
    """Return the uncertainty budget of one body, to be unfolded; nothing if it has none."""
    tables = tuple(_tabulate(budget) for budget in list_budgets(name, body))
    return [Folded(f"Uncertainty budget of {name}", tables)] if tables else []


def _tabulate(budget: Budget) -> Table:
    columns = [
        make_text_column("Source", list(budget.sources)),
        make_text_column("Type", list(budget.kinds)),
        make_column(budget.contribution_header, list(budget.contributions)),
        make_column("Share of the variance [%]", list(budget.shares)),
    ]
    remark = budget.remark
    return make_table(budget.title, columns, [remark[0].upper() + remark[1:]] if remark else [])
