"""Whether results keep the limits of their samples, by a decision rule that is named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from impact_rig.core.given.quantity import Conformity, Quantity
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    SAMPLE_MEASURANDS,
    Measurand,
    format_number,
)
from impact_rig.results.references import SCATTER_HITS, shows_scatter
from impact_rig.results.table import Column, Table, list_table, make_text_column

Limits = Mapping[str, tuple[float, float]]
"""Smallest and largest value of a quantity, by its field [SI units]; infinite: there is none."""
DECISION_RULE = (
    "Decision rule: non-binary statement with the guard band U (ILAC-G8:09/2019, 4.2.3). Passed:"
    " the interval of 95 % lies within the limits; failed: outside; each is wrong with a"
    " probability of 2.5 % at most for each limit. Undecided: a limit lies in it (conditional pass"
    " or conditional fail), or the value is not known, or of fewer than four hits."
)


@dataclass(frozen=True)
class JudgedValue:
    """A value of a sample with its limits."""

    sample: str
    quantity: Measurand
    found: Quantity
    low: float  # [SI unit]; infinite: there is none
    high: float
    has_scatter: bool = True  # of hits, in the uncertainty
    method: str = "versed-sine"  # that it is by

    @property
    def conformity(self) -> Conformity:
        """Statement of conformity, with the expanded uncertainty as guard band."""
        if not self.has_scatter:
            return Conformity.UNDECIDED
        return self.found.judge(self.low, self.high)

    @property
    def statement(self) -> str:
        """The conformity, with the reason where no limit decides it."""
        reason = ""
        if not self.found.is_known:
            reason = ": not determined"
        elif not self.has_scatter:
            reason = f": fewer than {SCATTER_HITS} hits"
        return f"{self.conformity.value}{reason}"


def judge_values(results: Results, limits: Mapping[str, Limits]) -> list[JudgedValue]:
    """Return the values that have limits, by the names of the samples without release angles."""
    return [
        JudgedValue(
            sample.name,
            item,
            item.read(sample),
            *stated[item.field],
            shows_scatter(results, sample.name, item),
            item.find_method(sample),
        )
        for sample in results.samples
        if (stated := limits.get(results.setup.samples.find(sample.name).body, {}))
        for item in SAMPLE_MEASURANDS
        if item.field in stated
    ]


def tabulate_conformity(values: Sequence[JudgedValue]) -> list[Table]:
    """Return the statements of conformity with their rule; nothing without limits."""
    columns = [
        make_text_column("Sample", [item.sample for item in values]),
        make_text_column(
            "Quantity",
            [f"{item.quantity.sample_symbol} [{item.quantity.unit}]" for item in values],
        ),
        make_text_column("Method", [item.method for item in values]),
        Column("Minimum", [_format_limit(item, item.low) for item in values]),
        Column("Measured", [item.quantity.format(item.found) for item in values]),
        Column("Maximum", [_format_limit(item, item.high) for item in values]),
        make_text_column("Statement", [item.statement for item in values]),
    ]
    marked = [
        place for place, item in enumerate(values) if item.conformity is not Conformity.PASSED
    ]
    return list_table("Conformity with the limits", columns, [DECISION_RULE], marked)


def _format_limit(item: JudgedValue, value: float) -> str:
    return format_number(value * item.quantity.scale, item.quantity.digits)
