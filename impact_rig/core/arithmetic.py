"""What formulas need beyond + - * / and **, for floats and for uncertain numbers alike.

With these a formula of the core is written once: given floats it returns the float that it
always did, given uncertain numbers it carries their uncertainties along.
"""

import math
from functools import cache
from typing import Any, Protocol, TypeVar, overload


@cache
def load_gtc() -> Any:
    """Return the library GTC: it loads for a third of a second, and most processes need none."""
    import GTC

    return GTC


class UncertainNumber(Protocol):
    """A value x with standard uncertainty u and degrees of freedom df, as GTC's real numbers."""

    @property
    def x(self) -> float: ...  # noqa: D102
    @property
    def u(self) -> float: ...  # noqa: D102
    @property
    def df(self) -> float: ...  # noqa: D102
    def __add__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __radd__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __sub__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rsub__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __mul__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rmul__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __truediv__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __rtruediv__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105
    def __pow__(self, other: Any, /) -> "UncertainNumber": ...  # noqa: D105


Number = TypeVar("Number", float, UncertainNumber)
"""Either a float or an uncertain number; a formula takes all its inputs of one kind."""


def get_value(quantity: float | UncertainNumber) -> float:
    """Return the value of a quantity without its uncertainty."""
    return quantity if isinstance(quantity, (int, float)) else quantity.x


@overload
def compute_square_root(quantity: float) -> float: ...
@overload
def compute_square_root(quantity: UncertainNumber) -> UncertainNumber: ...
def compute_square_root(quantity: float | UncertainNumber) -> float | UncertainNumber:
    """Return the square root of a positive quantity."""
    if isinstance(quantity, (int, float)):
        return math.sqrt(quantity)
    root: UncertainNumber = load_gtc().sqrt(quantity)
    return root


def compute_hypotenuse(side: float, quantity: Number) -> Number:
    """Return sqrt(side^2 + quantity^2); `side` is a constant above zero."""
    if isinstance(quantity, (int, float)):
        return math.hypot(side, quantity)
    return compute_square_root(quantity * quantity + side * side)
