"""Uncertainty budgets as they are shown, one for each quantity of a body, in its usual unit."""

from collections.abc import Iterator
from dataclasses import dataclass

from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.numbers import MEGA, MICRO, format_uncertain

SMALLEST_SHARE = 5e-4
"""Share of the variance below which a contribution is named only [-], our choice."""


@dataclass(frozen=True)
class Budget:
    """Where the uncertainty of one quantity comes from.

    Attributes
    ----------
    title : str
        Body, quantity and its value ± expanded uncertainty.
    unit : str
        Of the contributions; empty: none.
    sources, kinds, contributions, shares : tuple of str
        Of the contributions that count: where from, type A or B, standard uncertainty in the
        unit, share of the variance in percent.
    remark : str
        Which contributions are smaller; empty: none.
    """

    title: str
    unit: str
    sources: tuple[str, ...]
    kinds: tuple[str, ...]
    contributions: tuple[str, ...]
    shares: tuple[str, ...]
    remark: str

    @property
    def contribution_header(self) -> str:
        """What stands above the contributions."""
        return f"u [{self.unit}]" if self.unit else "u"


@dataclass(frozen=True)
class _Quantity:
    """A quantity that has a budget, and how it is shown."""

    name: str
    symbol: str
    unit: str
    scale: float
    result: str
    expanded: str


_QUANTITIES = (
    _Quantity("contact_time", "τp", "µs", MICRO, "contact_time_s", "contact_time_expanded_s"),
    _Quantity("stiffness", "k", "MN/m", MEGA, "stiffness_n_per_m", "stiffness_expanded_n_per_m"),
    _Quantity(
        "damping_coefficient",
        "c",
        "N s/m",
        1.0,
        "damping_coefficient_n_s_per_m",
        "damping_coefficient_expanded_n_s_per_m",
    ),
    _Quantity("damping_ratio", "ζ", "", 1.0, "damping_ratio", "damping_ratio_expanded"),
)


def list_budgets(name: str, body: SampleResults | HammerResults) -> Iterator[Budget]:
    """Yield the budgets of a sample or of the hammer, as far as there are any."""
    for quantity in _QUANTITIES:
        lines = [line for line in body.budget if line.quantity == quantity.name]
        if not lines:
            continue
        value = format_uncertain(
            getattr(body, quantity.result) * quantity.scale,
            getattr(body, quantity.expanded) * quantity.scale,
            3,
        )
        large = [line for line in lines if line.share >= SMALLEST_SHARE]
        small = [line.source for line in lines if line.share < SMALLEST_SHARE]
        yield Budget(
            title=f"{name}: {quantity.symbol} = {value} {quantity.unit}".rstrip(),
            unit=quantity.unit,
            sources=tuple(line.source for line in large),
            kinds=tuple(line.kind for line in large),
            contributions=tuple(f"{line.contribution * quantity.scale:.2g}" for line in large),
            shares=tuple(f"{100.0 * line.share:.1f}" for line in large),
            remark=f"below 0.05 %: {', '.join(small)}." if small else "",
        )
