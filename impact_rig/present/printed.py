"""Results that print themselves: in a Python shell, in a text, in a notebook."""

import html
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar

from impact_rig.configuration.units import combine_units
from impact_rig.core.estimates.uncertainty import compute_quantity
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.core.given.findings import Finding, Note
from impact_rig.core.given.quantity import INTERNAL, BudgetLine, Description, Quantity, list_fields
from impact_rig.present.console import format_tables
from impact_rig.results.numbers import SCALES, format_quantity, show_unit
from impact_rig.results.table import Table, make_table, make_text_column
from impact_rig.results.tables import tabulate_budget

SMALL, LARGE = 1e-3, 1e6
"""Beyond these a value is printed with a power of ten, our choice."""
DIGITS = 6
"""Significant ones of a value without uncertainty."""
NOT_DETERMINED = "not determined"
_DIGITS = re.compile(r"\.\d|[eEfFgGn%]$")
"""What a format of floats has; others pad a text."""


class Printed:
    """A few tables: text by `print`, HTML in a notebook, LaTeX by `to_latex`."""

    def list_tables(self) -> list[Table]:
        """Return the printed tables."""
        raise NotImplementedError(f"{type(self).__name__} prints itself and lists no tables")

    def __str__(self) -> str:
        """Return the tables as text."""
        return format_tables(self.list_tables())

    def _repr_html_(self) -> str:
        """Return the tables as a notebook shows them."""
        return "".join(map(format_html, self.list_tables()))

    def to_latex(self) -> str:
        """Return the tables as LaTeX's environments `tabular`, which need no package."""
        return "\n\n".join(map(format_latex, self.list_tables()))


def format_html(table: Table) -> str:
    """Return a table as HTML, its notes below it."""
    rows = [("th", tuple(column.header for column in table.columns))]
    rows += [("td", row) for row in table.rows]
    sides = ["left" if column.is_text else "right" for column in table.columns]
    lines = (
        "".join(
            f'<{tag} style="text-align:{side}">{html.escape(cell)}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        )
        for tag, cells in rows
    )
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    notes = "".join(f"<p><small>{html.escape(note)}</small></p>" for note in table.explanations)
    return f"<table><caption>{html.escape(table.caption)}</caption>{body}</table>{notes}"


LATEX = {
    "\\": r"\textbackslash{}", "%": r"\%", "&": r"\&", "_": r"\_", "#": r"\#", "^": r"\^{}",
    "µ": r"$\mu$", "μ": r"$\mu$", "τ": r"$\tau$", "ζ": r"$\zeta$", "Δ": r"$\Delta$",
    "δ": r"$\delta$", "±": r"$\pm$", "²": "$^2$", "ⁿ": "$^n$", "·": r"$\cdot$", "°": r"$^\circ$",
    "∞": r"$\infty$", "≥": r"$\ge$", "≤": r"$\le$", "\u2013": "--", "\u2212": "$-$",
    "…": r"\ldots{}", "√": r"$\surd$", "|": r"$|$",
}  # fmt: skip
"""Letters of tables that LaTeX has commands for."""
UNEVEN = re.compile(r" \+([\d.]+) -([\d.]+)")
NEGATIVE = re.compile(r"(?<![\w.{])-(?=\d)")


def escape_latex(text: str) -> str:
    """Return a text of a table as LaTeX: letters, ends of an uneven interval, minus signs."""
    escaped = "".join(LATEX.get(letter, letter) for letter in text)
    escaped = UNEVEN.sub(r"$\\,^{+\1}_{-\2}$", escaped)
    return NEGATIVE.sub("$-$", escaped)


def format_latex(table: Table) -> str:
    """Return a table as LaTeX, its notes below it."""
    sides = "".join("l" if column.is_text else "r" for column in table.columns)
    rows = [tuple(column.header for column in table.columns), *table.rows]
    head, *lines = (" & ".join(map(escape_latex, row)) + r" \\" for row in rows)
    body = "\n".join([r"\hline", head, r"\hline", *lines, r"\hline"])
    notes = "".join(f"\n\n{escape_latex(note)}" for note in table.explanations)
    return f"% {table.caption}\n\\begin{{tabular}}{{{sides}}}\n{body}\n\\end{{tabular}}{notes}"


def make_frame(rows: Sequence[Mapping[str, Any]], index: str) -> Any:
    """Return rows as a DataFrame of pandas, indexed by a column that stays, or of polars.

    Raises
    ------
    RigError
        If neither is installed.
    """
    columns = {name: [read_number(row[name]) for row in rows] for row in rows[:1] for name in row}
    if find_spec("pandas") is not None:
        return import_module("pandas").DataFrame(columns).set_index(index, drop=False)
    if find_spec("polars") is not None:
        return import_module("polars").DataFrame(columns, strict=False)
    raise RigError("to_dataframe needs pandas or polars: pip install pandas")


def read_number(cell: Any) -> Any:
    """Return the number that a cell's text is; empty: NaN; other texts as they are."""
    try:
        return float(cell or "nan") if isinstance(cell, str) else cell
    except ValueError:
        return cell


class Budget(Printed, tuple[BudgetLine, ...]):
    """The lines of an uncertainty budget, largest first; it prints itself as a table.

    Each line has `source`, `kind` ("A" from repeated hits, "B" by other means), `contribution` (to
    u, in the SI unit of the result) and `share` (of the variance).
    """

    table: Table

    def list_tables(self) -> list[Table]:
        """Return the printed tables."""
        return [self.table]

    __repr__ = Printed.__str__


def _operate(
    formula: Callable[[Any, Any], Any], *, is_reflected: bool = False
) -> Callable[["Number", "Number | float"], "Number"]:
    """Return the method of `Number` that calculates with another number."""

    def operate(number: "Number", other: "Number | float") -> "Number":
        pair = (other, number) if is_reflected else (number, other)
        return number._calculate(formula, *pair)  # noqa: SLF001 - a method of it

    return operate


@dataclass(frozen=True, repr=False)
class Number(Quantity):
    """A value with its uncertainty, printed with ± and unit.

    `value`, `standard` (u), `expanded` (U, for 95 %), `lower` and `upper` (ends of the interval)
    and ``float(number)`` are in SI units; `unit` is what it is printed in. NaN: not determined.
    An uneven interval is printed as ``0.45 +0.44 -0.18``. `budget` prints itself as a table.
    ``format(number, "L")`` is LaTeX.

    Sums, differences, products, ratios and powers of numbers, of one analysis and with plain
    ones, are numbers with their uncertainty and budget: what they share, as the hammer's mass,
    counts once. `uncertain` is GTC's uncertain number, for its functions.

    Examples
    --------
    >>> from impact_rig.core.given.quantity import Description
    >>> number = Number(169.68e-6, 0.06e-6, 0.13e-6, said=Description("s", "τp", shown="µs"))
    >>> number
    169.68 ± 0.13 µs
    >>> f"{number:.1f}", float(number)
    ('169.7 ± 0.1 µs', 0.00016968)
    >>> import impact_rig as ir
    >>> results = ir.VirtualRig(seed=7).run(["steel small", "aluminium large"], 4).analyze()
    >>> results["steel small"].stiffness / results["aluminium large"].stiffness
    1.28... ± 0.0...
    """

    said: Description = field(default=Description(), metadata=INTERNAL)
    told: str = field(default="", metadata=INTERNAL)  # in print behind the unit

    @property
    def unit(self) -> str:
        """Its unit in print; empty: it has none."""
        return show_unit(self.said.shown or self.said.unit)

    @property
    def scale(self) -> float:
        """From the SI unit to `unit` [-]."""
        return SCALES.get(self.said.shown, 1.0)

    def __float__(self) -> float:
        """Return the value in its SI unit."""
        return self.value

    def __format__(self, spec: str) -> str:
        """Return value, ± and unit; a format of floats, as ``.2f``, is for all numbers.

        Without one both are rounded to the second digit of the uncertainty; ``>30`` pads the text.
        An ``L`` at the end makes LaTeX of it.
        """
        if spec.endswith("L"):
            return escape_latex(format(self, spec[:-1]))
        if not _DIGITS.search(spec):
            return format(str(self), spec)
        if not self.is_known:
            return NOT_DETERMINED
        widths = (self.compute_half_width(to) * self.scale for to in (math.inf, -math.inf))
        above, below = (format(width, spec) for width in widths)
        text = f" ± {above}" if self.is_even else f" +{above} -{below}"
        text = format(self.value * self.scale, spec) + text * math.isfinite(self.expanded)
        return f"{text} {self.unit}".rstrip() + self.told

    def __str__(self) -> str:
        """Return ``169.68 ± 0.13 µs``."""
        if not self.is_known:
            return NOT_DETERMINED
        value = self.value * self.scale
        power = math.floor(math.log10(abs(value))) if value else 0
        if SMALL <= abs(value) < LARGE or not value:
            text = format_quantity(self, max(DIGITS - 1 - power, 0), self.scale)
        else:
            text = format_quantity(self, DIGITS - 1, self.scale / 10.0**power)
            text = f"({text})e{power}"
        return f"{text} {self.unit}".rstrip() + self.told

    __repr__ = __str__

    @property
    def uncertain(self) -> Any:
        """GTC's uncertain number behind it.

        Raises
        ------
        ParameterError
            If it was read from results, or has inputs of its own, so that what it shares with
            others is not known.
        """
        if self.number is None:
            raise ParameterError(
                f"{self} does not know which inputs it shares with others: calculate with contact"
                " time, stiffness and damping of an analysis of recorded hits"
            )
        return self.number

    def _calculate(self, formula: Callable[[Any, Any], Any], first: Any, second: Any) -> Any:
        """Return what a formula makes of two numbers, one of which is this one."""
        if not all(isinstance(item, Number | Real) for item in (first, second)):
            return NotImplemented
        pair = [item.uncertain if isinstance(item, Number) else item for item in (first, second)]
        found = formula(*pair)
        quantity = replace(compute_quantity(float(found.x), found), number=found)
        return make_number(quantity, Description(find_unit(formula, first, second)), "result")

    __add__ = __radd__ = _operate(operator.add)
    __sub__, __rsub__ = _operate(operator.sub), _operate(operator.sub, is_reflected=True)
    __mul__ = __rmul__ = _operate(operator.mul)
    __truediv__, __rtruediv__ = (
        _operate(operator.truediv), _operate(operator.truediv, is_reflected=True)
    )  # fmt: skip
    __pow__ = _operate(operator.pow)

    def __neg__(self) -> "Number":
        """Return its negative."""
        return self * -1.0


def find_unit(formula: Callable[[Any, Any], Any], first: Any, second: Any) -> str:
    """Return the SI unit of what a formula makes of two numbers; empty: none, or not known.

    Raises
    ------
    ParameterError
        If they cannot be added.
    """
    units = [item.said.unit if isinstance(item, Number) else "" for item in (first, second)]
    if formula in (operator.add, operator.sub):
        if units[0] != units[1]:
            named = " and ".join(unit or "a plain number" for unit in units)
            raise ParameterError(f"{first} and {second} are of different units: {named}")
        return units[0]
    return combine_units(formula, units[0], units[1], second)


def make_number(quantity: Quantity, said: Description, name: str, told: str = "") -> Number:
    """Return a quantity as it prints itself, by the description of its field."""
    budget = Budget(quantity.budget)
    found = {item.name: getattr(quantity, item.name) for item in fields(Quantity)}
    number = Number(**{**found, "budget": budget}, said=said, told=told)
    caption = f"{name}: {said.symbol or said.label} = {number}"
    budget.table = tabulate_budget(caption, budget, number.unit, number.scale)
    return number


def list_items(record: Any) -> dict[str, tuple[Any, Description]]:
    """Return the fields of a dataclass by name, those of its inline records among them."""
    items: dict[str, tuple[Any, Description]] = {}
    for item in list_fields(type(record)):
        value = getattr(record, item.name)
        if item.description.is_inline:
            items |= list_items(value)
        else:
            items[item.name] = value, item.description
    return items


def show(value: Any, said: Description, name: str, told: str = "") -> Any:
    """Return a value as it prints itself: quantities, records, and those within tuples."""
    if isinstance(value, Quantity):
        return make_number(value, said, name, told)
    if isinstance(value, tuple):
        return tuple(show(item, said, name, told) for item in value)
    is_sentence = isinstance(value, Note | Finding)
    if not is_dataclass(value) or is_sentence:
        return value
    return View.kinds.get(type(value), View)(value, name, told)


class View(Printed):
    """Results of one body or one method, by the names of its fields.

    Quantities are `Number`; other numbers are floats in SI units. `record` is the frozen dataclass
    behind it, at whose fields stands what they mean.
    """

    kinds: ClassVar[dict[type, type["View"]]] = {}
    """Classes that list the fields of a record's, by that record's."""

    def __init_subclass__(cls, of: type | None = None) -> None:
        """Show records of a class as this one."""
        if of is not None:
            View.kinds[of] = cls

    def __init__(self, record: Any, name: str, told: str = "") -> None:
        self.record = record
        self.name = name
        self._told = told  # behind each number

    if not TYPE_CHECKING:  # which finds a name that is none, by what subclasses list

        def __getattr__(self, name: str) -> Any:
            """Return a field of the record."""
            if name in ("record", "name") or name.startswith("_"):
                raise AttributeError(name)
            items = list_items(self.record)
            if name in items:
                value, said = items[name]
                return show(value, said, self.name, self._told)
            if hasattr(self.record, name):
                return show(getattr(self.record, name), Description(), self.name, self._told)
            raise AttributeError(f"{self.name} has no {name!r}: it has {', '.join(items)}")

    def __dir__(self) -> Iterable[str]:
        """Return the names of the fields as well, which shells complete."""
        return [*super().__dir__(), *list_items(self.record)]

    @property
    def numbers(self) -> dict[str, Number]:
        """All quantities that are determined, by the names of their fields."""
        return {
            key: make_number(value, said, self.name, self._told)
            for key, (value, said) in list_items(self.record).items()
            if isinstance(value, Quantity) and value.is_known
        }

    def __repr__(self) -> str:
        """Return the name and the quantities that are determined."""
        known = (f"{key} = {number}" for key, number in self.numbers.items())
        return f"{self.name}: {', '.join(known) or NOT_DETERMINED}"

    def list_tables(self) -> list[Table]:
        """Return the printed tables."""
        return [tabulate_numbers(self.name, self.numbers)]


def tabulate_numbers(
    caption: str, numbers: Mapping[str, Number], notes: Sequence[str] = ()
) -> Table:
    """Return numbers by their names as a table; without any its notes alone."""
    columns = [
        make_text_column("Name", list(numbers)),
        make_text_column("Symbol", [item.said.symbol for item in numbers.values()]),
        make_text_column("Value", [str(item) for item in numbers.values()]),
    ]
    return make_table(caption, columns if numbers else [], notes)
