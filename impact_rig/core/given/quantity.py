"""A value with its uncertainty and budget, and how fields describe themselves."""

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from enum import Enum
from functools import cache
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Note, Reason, Subject

Record = TypeVar("Record")
_KEY = "impact_rig"


class Comparable:
    """A frozen dataclass in which NaN, which stands for what is not known, equals NaN.

    The dataclasses of Python 3.13 compare field by field, and NaN differs from itself.
    """

    def __init_subclass__(cls) -> None:
        """Set the methods that `dataclass` keeps if the class itself has them."""
        cls.__eq__ = Comparable.__eq__  # type: ignore[method-assign]
        cls.__hash__ = Comparable.__hash__  # type: ignore[method-assign]

    def __eq__(self, other: object) -> bool:
        """Return whether both are of one class and alike in every field."""
        if type(other) is not type(self):
            return NotImplemented
        return _list_values(self) == _list_values(other)

    def __hash__(self) -> int:
        """Return a number that equal ones share."""
        return hash(_list_values(self))


def _list_values(record: Any) -> tuple[Any, ...]:
    """Return the compared values of a dataclass, with None for NaN."""
    values = (getattr(record, item.name) for item in fields(record) if item.compare)
    return tuple(None if value != value else value for value in values)  # noqa: PLR0124 - NaN


LARGEST = 1e30
"""Above it, and below its reciprocal but for 0, nothing can be meant [SI units], our choice: the
largest is k of a contact law of high exponent, 1e27 N/m^n; squares and ratios stay finite."""
POSITIVE = 1.0 / LARGEST
"""Least of what is above 0."""
LIMITS = {
    "s": (POSITIVE, 1e4), "N/m": (POSITIVE, 1e15), "N/m^n": (POSITIVE, LARGEST),
    "m/s": (POSITIVE, 1e5), "N s": (POSITIVE, 1e9), "N s/m": (0.0, 1e12), "Hz": (0.0, 1e12),
    "m/s^2": (0.0, 1e12), "N": (0.0, 1e12), "m": (0.0, 1e3), "kg": (0.0, 1e9),
    "J": (-1e9, 1e9),
}  # fmt: skip
"""What numbers of a unit are at least and at most, where their field says nothing else. Our
choice: a thousand times what bodies on earth have, such as 1e12 N/m of a metre of diamond."""


@dataclass(frozen=True)
class Description:
    """Description of a result's field."""

    unit: str = ""  # SI unit; empty: none
    symbol: str = ""  # in equations, for tables
    label: str = ""  # in words, for tables
    shown: str = ""  # unit that tables show it in; empty: the SI unit
    written: str = ""  # its name in files without the unit; empty: that of the field
    is_inline: bool = False  # the fields of this record appear directly among its owner's
    is_internal: bool = False  # it stays where it was made
    least: float = -LARGEST  # of what can be meant [unit]; NaN, not determined, always can
    most: float = LARGEST

    def explain(self, value: Any) -> str | None:
        """Return why a number, or that of a quantity, cannot be meant; None: it can."""
        number = value.value if isinstance(value, Quantity) else value
        if not isinstance(number, float) or not (number < self.least or number > self.most):
            return None
        unit = f" {self.unit}" if self.unit else ""
        if number > self.most:
            return f"is {number:.6g}{unit}: it must be {self.most:g} at most"
        wanted = "above 0" if self.least == POSITIVE else f"{self.least:g} or more"
        return f"is {number:.6g}{unit}: it must be {wanted}"


def describe(
    unit: str = "",
    symbol: str = "",
    label: str = "",
    *,
    shown: str = "",
    written: str = "",
    least: float | None = None,
    most: float | None = None,
) -> Mapping[str, Description]:
    """Return the metadata of a dataclass field, see `Description`; its limits go by the unit."""
    low, high = LIMITS.get(unit, (-LARGEST, LARGEST))
    least, most = low if least is None else least, high if most is None else most
    return {_KEY: Description(unit, symbol, label, shown, written, least=least, most=most)}


NOT_NEGATIVE = describe(least=0.0)
"""Metadata of a number without a unit, of a spread or of what is left."""
PART = describe(least=0.0, most=1.0)
"""Metadata of a part of a whole."""
INLINE: Mapping[str, Description] = {_KEY: Description(is_inline=True)}
"""Metadata of a record whose fields appear directly among its owner's."""
INTERNAL: Mapping[str, Description] = {_KEY: Description(is_internal=True)}
"""Metadata of a field that stays where it was made: traces, uncertain numbers."""
_PLAIN = Description()


def read_description(item: "Field[Any]") -> Description:
    """Return the description of a dataclass's field."""
    found: Description = item.metadata.get(_KEY, _PLAIN)
    return found


class StoredField(NamedTuple):
    """A field of a dataclass that leaves where it was made."""

    name: str
    hint: Any  # its type
    description: Description


def _list_fields(kind: Any) -> tuple[StoredField, ...]:
    """Return the fields of a dataclass that are compared and not internal."""
    hints = get_type_hints(kind)
    found = (it for it in fields(kind) if it.compare and not read_description(it).is_internal)
    return tuple(StoredField(it.name, hints[it.name], read_description(it)) for it in found)


list_fields: Callable[[Any], tuple[StoredField, ...]] = cache(_list_fields)


END = describe(least=-2.0 * LARGEST, most=2.0 * LARGEST)
"""Metadata of an interval's end: a value and an uncertainty added."""


@dataclass(frozen=True)
class BudgetLine:
    """Contribution of one input to an uncertainty."""

    source: str  # the input, in words
    kind: str  # "A": evaluated from repeated hits, "B": by other means (GUM 2.3.2, 2.3.3)
    # |sensitivity| times standard uncertainty, in the unit of the result
    contribution: float = field(metadata=describe(least=0.0))
    # of the variance [-]; the shares of a budget add up to 1
    share: float = field(metadata=PART)


class Conformity(Enum):
    """Conformity of a value that has limits."""

    PASSED = "passed"
    FAILED = "failed"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Quantity(Comparable):
    """A value with its uncertainty by the GUM; NaN: not determined, see the notes."""

    value: float = math.nan  # best estimate, in its SI unit, as are the uncertainties
    # combined standard uncertainty u (GUM 5)
    standard: float = field(default=math.nan, metadata=describe(least=0.0))
    # U = k u, for a coverage of 95 %, k from Student's t (GUM G.4)
    expanded: float = field(default=math.nan, metadata=describe(least=0.0))
    # Ends of the 95 % interval: value -+ U, or what a formula makes of its inputs at their ends
    # where U is above 10 % of the value. An upper end of NaN beside a lower one: there is none.
    lower: float = field(default=math.nan, metadata=END)
    upper: float = field(default=math.nan, metadata=END)
    # effective ones by Welch and Satterthwaite [-]; infinite where type B alone counts
    degrees_of_freedom: float = field(
        default=math.nan, metadata=describe(least=0.0, most=math.inf)
    )
    budget: tuple[BudgetLine, ...] = ()  # largest first; empty where nothing contributes
    # why the uncertainty is not determined, or what it leaves out
    notes: tuple[Note, ...] = field(default=(), metadata=INTERNAL)
    # GTC's uncertain number, which knows of the inputs that it shares with others of one analysis;
    # None: it was read, or has inputs of its own.
    number: Any = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Set the ends where none are given."""
        if math.isnan(self.lower) and math.isnan(self.upper):
            object.__setattr__(self, "lower", self.value - self.expanded)
            object.__setattr__(self, "upper", self.value + self.expanded)

    @property
    def is_known(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)

    @property
    def is_even(self) -> bool:
        """Whether the interval reaches as far to both sides, or is not known."""
        return math.isnan(self.lower) or (
            self.lower == self.value - self.expanded and self.upper == self.value + self.expanded
        )

    def find_impossible(self, said: Description) -> tuple[str, str] | None:
        """Return a number that cannot be meant, by its name, and why; None: all can.

        The ends are held against the value and, unless the uncertainty itself reaches beyond them,
        against the limits of what the quantity is.
        """
        for item in fields(self):
            problem = read_description(item).explain(getattr(self, item.name))
            if problem is not None:
                return item.name, problem
        is_within = said.explain(self.value - self.expanded) is None
        for name, end in (("lower", self.lower), ("upper", self.upper)):
            if math.isnan(self.value) and not math.isnan(end):
                return name, f"is {end:.6g}: there is no value"
            if is_within and (problem := said.explain(end)) is not None:
                return name, problem
        if self.lower > self.value:
            return "lower", f"is {self.lower:.6g}: it must not be above the value"
        if self.upper < self.value:
            return "upper", f"is {self.upper:.6g}: it must not be below the value"
        return None

    def compute_half_width(self, other: float) -> float:
        """Return how far the interval reaches towards another value; infinite: it is open."""
        if self.is_even:
            return self.expanded
        width = self.value - self.lower if other < self.value else self.upper - self.value
        return math.inf if math.isnan(width) else width

    def judge(self, low: float, high: float) -> Conformity:
        """Return the conformity with two limits; the expanded uncertainty is the guard band."""
        least, most = self.lower, self.upper
        if math.isnan(most) and math.isfinite(least):
            most = math.inf
        if low <= least and most <= high:
            return Conformity.PASSED
        return Conformity.FAILED if most < low or least > high else Conformity.UNDECIDED


UNKNOWN = Quantity()
"""A quantity that is not determined."""


def quantity_field(
    unit: str,
    symbol: str,
    label: str,
    *,
    shown: str = "",
    least: float | None = None,
    most: float | None = None,
) -> Any:
    """Return the field of a quantity that is not determined unless it is given."""
    said = describe(unit, symbol, label, shown=shown, least=least, most=most)
    return field(default=UNKNOWN, metadata=said)


def stated_field(unit: str, written: str, default: float = 0.0) -> Any:
    """Return the field of a standard uncertainty, 0 where nothing states it."""
    return field(default=default, metadata=describe(unit, written=written, least=0.0))


def make_result(record: Record) -> Record:
    """Return a dataclass as it leaves where it was made, with all records within it.

    What is to stay is dropped. A number that no reader would take is not determined.
    """
    changes: dict[str, Any] = {}
    for item in fields(record):  # type: ignore[arg-type]
        value, said = getattr(record, item.name), read_description(item)
        if said.is_internal:
            if item.default is not MISSING:
                changes[item.name] = item.default
        elif isinstance(value, Quantity):
            is_possible = said.explain(value) is None and value.find_impossible(said) is None
            changes[item.name] = make_result(value) if is_possible else UNKNOWN
        elif is_dataclass(value):
            changes[item.name] = make_result(value)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            changes[item.name] = tuple(map(make_result, value))
        elif said.explain(value) is not None:
            changes[item.name] = math.nan
    return replace(record, **changes) if changes else record  # type: ignore[type-var]


CODES = (Reason, Reason | Subject)
"""Types of the codes."""


def read_code(hint: Any, text: str) -> Any:
    """Return a code, of one of `CODES`, of a file or message; raises `ParameterError`."""
    known = {item.value: item for kind in get_args(hint) or (hint,) for item in kind}
    if text not in known:
        raise ParameterError(f"is {text!r:.80}: it must be a code, such as {next(iter(known))!r}")
    return known[text]
