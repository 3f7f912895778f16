"""Uncertainty by the GUM: from uncertain numbers to what is reported.

The GUM is JCGM 100:2008. Uncertain numbers are GTC's: they know on which inputs they depend, so
that an input that enters twice, like the hammer's mass through k_eq and k1, is counted once,
with its sign.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import GTC
import numpy as np

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.checks import check_not_negative
from impact_rig.core.errors import ParameterError
from impact_rig.core.quantity import BudgetLine, Quantity
from impact_rig.core.signals.record import FloatArray

COVERAGE_PERCENT = 95.0
"""Coverage probability of the expanded uncertainty [%], the usual one (GUM 6.3)."""
REMEMBERED_INPUTS = 512
"""Inputs that are told apart by name and value [-], our choice: those that two results of a
campaign share are asked for within some dozen others. Each hit brings ten, which stay so long."""
REMEMBERED_ENSEMBLES = 64
"""The same of ensembles [-], which are larger: each hit brings two."""
NEGLIGIBLE_SHARE = 1e-9
"""Share of the variance below which an input has no line of its own [-], our choice: its
contribution would be less than the rounding of the last digit that anyone prints."""
SINGULAR_PART = 1e-14
"""Part of the largest variance below which a combination of parameters does not scatter [-], our
choice: rounding."""


@lru_cache(maxsize=REMEMBERED_INPUTS)
def make_input(
    source: str,
    value: float,
    standard: float,
    owner: str = "",  # noqa: ARG001, it tells inputs apart
) -> UncertainNumber:
    """Make an input of type B, known otherwise than by repetition: a mass, the clock.

    Parameters
    ----------
    source : str
        In words, for the budget.
    value : float
        Best estimate; NaN: not known.
    standard : float
        Standard uncertainty, in its unit; 0: exact.
    owner : str
        What the input belongs to. The same source, value, uncertainty and owner are the same
        input, whenever asked for: so correlations outlive the call.

    Raises
    ------
    ParameterError
        If the uncertainty is not a finite number of zero or more.
    """
    check_not_negative(f"standard uncertainty of {source}", standard, "")
    number: UncertainNumber = (
        GTC.constant(value)
        if math.isnan(value)
        else GTC.ureal(value, standard, label=make_label(source, math.inf))
    )
    return number


def make_ensemble(
    source: str,
    estimates: Sequence[float],
    covariance: FloatArray,
    degrees_of_freedom: float,
    owner: str = "",
) -> tuple[UncertainNumber, ...]:
    """Make inputs that were measured together, so that their errors are correlated.

    Parameters
    ----------
    source : str
        In words, for the budget: the inputs make one line of it.
    covariance : ndarray, shape (p, p)
        Of the estimates; may be singular.
    degrees_of_freedom : float
        n - 1 of n hits; infinite: type B.
    owner : str
        As in `make_input`.

    Raises
    ------
    ParameterError
        If the covariance is not finite, or of another shape.
    """
    matrix = np.array(covariance, dtype=np.float64)
    if matrix.shape != (len(estimates), len(estimates)) or not np.all(np.isfinite(matrix)):
        raise ParameterError(
            f"covariance of {source} is {matrix.tolist()}: it must be a finite"
            f" {len(estimates)} x {len(estimates)} matrix"
        )
    # Scaled, since the parameters' units may differ by many powers of ten.
    scale = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
    divisor = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(divisor, divisor))
    kept = values > SINGULAR_PART * max(len(estimates), 1)
    factors = scale[:, np.newaxis] * vectors[:, kept] * np.sqrt(values[kept])
    errors = _make_errors(source, int(kept.sum()), degrees_of_freedom, factors.tobytes(), owner)
    numbers = []
    for estimate, row in zip(estimates, factors.tolist(), strict=True):
        number: UncertainNumber = GTC.constant(float(estimate))
        for factor, error in zip(row, errors, strict=True):
            number = number + factor * error
        numbers.append(number)
    return tuple(numbers)


@lru_cache(maxsize=REMEMBERED_ENSEMBLES)
def _make_errors(
    source: str, count: int, degrees_of_freedom: float, _factors: bytes, _owner: str
) -> tuple[UncertainNumber, ...]:
    """Make uncorrelated unit errors that share their degrees of freedom (GUM H.2).

    Factors and owner only tell ensembles apart: the same data are the same inputs.
    """
    if count == 0:
        return ()
    labels = [make_label(source, degrees_of_freedom)] * count
    return tuple(GTC.multiple_ureal([0.0] * count, [1.0] * count, degrees_of_freedom, labels))


def make_label(source: str, degrees_of_freedom: float) -> str:
    """Name an input, so that its contribution can be told from others of other freedom."""
    return f"{degrees_of_freedom!r} {source}"


def compute_quantity(
    value: float, number: UncertainNumber, notes: tuple[str, ...] = ()
) -> Quantity:
    """Return a value with standard and expanded uncertainty of a number, and its budget.

    Inputs of one source make one line: their variances are added. All sums are exact before they
    are rounded, so that the order in which inputs were made, which differs between a live rig and
    its recording, changes no bit.
    """
    if not math.isfinite(float(number.u)):
        return Quantity(value, notes=("uncertainty: not determined, it has no finite value",))
    return make_quantity(value, list_variances(number), notes)


def list_variances(number: UncertainNumber) -> dict[str, float]:
    """Return what each source adds to the variance of a number, by its label."""
    parts: dict[str, list[float]] = {}
    for influence in GTC.reporting.budget(number, trim=0.0):
        parts.setdefault(influence.label, []).append(influence.u**2)
    return {label: math.fsum(squares) for label, squares in parts.items()}


def make_quantity(
    value: float, variances: dict[str, float], notes: tuple[str, ...] = ()
) -> Quantity:
    """Return a value whose variance is the sum of independent parts, by `make_label`."""
    total = math.fsum(variances.values())
    if total == 0.0:
        return Quantity(value, 0.0, 0.0, math.inf, (), notes)
    standard = math.sqrt(total)
    freedom = _compute_effective_freedom(variances, total)
    factor = float(GTC.reporting.k_factor(freedom, COVERAGE_PERCENT))
    return Quantity(value, standard, factor * standard, freedom, _make_budget(variances), notes)


def _compute_effective_freedom(variances: dict[str, float], total: float) -> float:
    """Return the effective degrees of freedom by Welch and Satterthwaite (GUM G.4.1)."""
    spread = math.fsum(
        (variance / total) ** 2 / float(label.partition(" ")[0])
        for label, variance in variances.items()
    )
    # Rounding may bring one degree of freedom to just below one, which GTC refuses.
    return max(1.0 / spread, 1.0) if spread > 0.0 else math.inf


def _make_budget(variances: dict[str, float]) -> tuple[BudgetLine, ...]:
    largest = max(variances.values())
    kept = {
        label: variance
        for label, variance in variances.items()
        if variance > NEGLIGIBLE_SHARE * largest
    }
    total = math.fsum(kept.values())
    lines = []
    for label, variance in sorted(kept.items(), key=lambda item: (-item[1], item[0])):
        freedom, _, source = label.partition(" ")
        kind = "A" if math.isfinite(float(freedom)) else "B"
        lines.append(BudgetLine(source, kind, math.sqrt(variance), variance / total))
    return tuple(lines)
