"""Uncertain numbers by the GUM: inputs, propagation, results."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from impact_rig.core.estimates.equations import UncertainNumber
from impact_rig.core.given.errors import RigError, check_not_negative
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import BudgetLine, Quantity
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.mean.trends import STEADY, Course


class Source(NamedTuple):
    """Source of an input: inputs of one source make one line of a budget."""

    name: str  # in words
    degrees_of_freedom: float = math.inf  # n - 1 of n hits; infinite: type B


PULSE_SHAPE = "shape of the pulse"
"""Source of what another shape than the paper's makes of tau_p."""


@cache
def load_gtc() -> Any:
    """Return the library GTC: it loads for a third of a second, and most processes need none."""
    import GTC

    return GTC


def make_input(source: str, value: float, standard: float) -> UncertainNumber:
    """Make an input of type B, known otherwise than by repetition: a mass, the clock.

    Each call makes another input: results that share one are calculated from the same object.

    Parameters
    ----------
    source : str
        In words, for the budget.
    value : float
        Best estimate; NaN: not known.
    standard : float
        Standard uncertainty, in its unit; 0: exact.

    Raises
    ------
    ParameterError
        If the uncertainty is not a finite number of zero or more.
    """
    check_not_negative(f"standard uncertainty of {source}", standard, "")
    number: UncertainNumber = (
        load_gtc().constant(value)
        if math.isnan(value)
        else load_gtc().ureal(value, standard, label=Source(source))
    )
    return number


ASSUMED = ", assumed"
"""End of the source of an input that nothing states."""
ASSUMED_GAIN, ASSUMED_MASS = 0.03, 0.005
"""Relative standard uncertainties of what is stated without one [-]: a piezo accelerometer is
known to 2 to 5 %; of a mass our choice, half a gram in 100."""


def make_stated(source: str, value: float, standard: float, assumed: float) -> UncertainNumber:
    """Make an input with its stated uncertainty, or, where that is 0, with one that is assumed.

    What is not stated is not zero: the budget says that it is assumed.
    """
    if standard or math.isnan(value):
        return make_input(source, value, standard)
    return make_input(f"{source}{ASSUMED}", value, assumed * value)


def make_ensemble(
    source: str,
    estimates: Sequence[float],
    covariance: FloatArray,
    degrees_of_freedom: float,
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
    """
    # Scaled, since the parameters' units may differ by many powers of ten.
    scale = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    divisor = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(divisor, divisor))
    # Smaller variances are rounding.
    kept = values > 1e-14 * max(len(estimates), 1)
    factors = scale[:, np.newaxis] * vectors[:, kept] * np.sqrt(values[kept])
    count, line = int(kept.sum()), Source(source, degrees_of_freedom)
    # Uncorrelated unit errors that share their degrees of freedom (GUM H.2).
    errors = load_gtc().multiple_ureal(
        [0.0] * count, [1.0] * count, degrees_of_freedom, [line] * count
    )
    numbers = []
    for estimate, row in zip(estimates, factors.tolist(), strict=True):
        number: UncertainNumber = load_gtc().constant(float(estimate))
        for factor, error in zip(row, errors, strict=True):
            number = number + factor * error
        numbers.append(number)
    return tuple(numbers)


def make_scatter(
    source: str, value: float, values: Sequence[float] | FloatArray, count: int
) -> UncertainNumber:
    """Make an input whose uncertainty is that of the mean of `count` hits by their `values`."""
    variance = np.var(values, ddof=1) / count
    (number,) = make_ensemble(source, [value], np.array([[variance]]), len(values) - 1)
    return number


def compute_quantity(
    value: float, number: UncertainNumber, notes: tuple[Note, ...] = ()
) -> Quantity:
    """Return a value with standard and expanded uncertainty of a number, and its budget.

    Inputs of one source make one line: their variances are added. All sums are exact before they
    are rounded, so that the order in which inputs were made, which differs between a live rig and
    its recording, changes no bit.
    """
    if not math.isfinite(float(number.u)):
        note = Note(Subject.UNCERTAINTY, "not determined, it has no finite value")
        return Quantity(value, notes=(note,))
    return make_quantity(value, list_variances(number), notes)


def compute_covariances(numbers: Sequence[UncertainNumber]) -> list[list[float]]:
    """Return the covariance of each two of some numbers, a row for each."""
    find = load_gtc().get_covariance
    return [[float(find(one, other)) for other in numbers] for one in numbers]


def list_variances(number: UncertainNumber) -> dict[Source, float]:
    """Return each source's part of a number's variance."""
    parts: dict[Source, list[float]] = {}
    for influence in load_gtc().reporting.budget(number, trim=0.0):
        parts.setdefault(influence.label, []).append(influence.u**2)
    return {source: math.fsum(squares) for source, squares in parts.items()}


def make_quantity(
    value: float, variances: dict[Source, float], notes: tuple[Note, ...] = ()
) -> Quantity:
    """Return a value whose variance is the sum of independent parts."""
    total = math.fsum(variances.values())
    if total == 0.0:
        return Quantity(value, 0.0, 0.0, degrees_of_freedom=math.inf, notes=notes)
    standard = math.sqrt(total)
    freedom = _compute_effective_freedom(variances, total)
    # 95 % is the usual coverage probability (GUM 6.3).
    factor = float(load_gtc().reporting.k_factor(freedom, 95.0))
    return Quantity(
        value,
        standard,
        factor * standard,
        degrees_of_freedom=freedom,
        budget=_make_budget(variances),
        notes=notes,
    )


def leave_out(found: Quantity, is_left_out: Callable[[str], bool]) -> Quantity:
    """Return a value with an even interval, without the type B lines whose source is left out."""
    kept = 1.0 - math.fsum(line.share for line in found.budget if is_left_out(line.source))
    if kept == 1.0 or not found.standard * found.degrees_of_freedom > 0.0:
        return found
    standard, freedom = found.standard * math.sqrt(max(kept, 0.0)), found.degrees_of_freedom
    # What is left out has infinite degrees of freedom (GUM G.4.1).
    factor = float(load_gtc().reporting.k_factor(max(freedom * kept**2, 1.0), 95.0))
    return Quantity(found.value, standard, factor * standard)


def _compute_effective_freedom(variances: dict[Source, float], total: float) -> float:
    """Return the effective degrees of freedom by Welch and Satterthwaite (GUM G.4.1)."""
    spread = math.fsum(
        (variance / total) ** 2 / source.degrees_of_freedom
        for source, variance in variances.items()
    )
    # Rounding may bring one degree of freedom to just below one, which GTC refuses.
    return max(1.0 / spread, 1.0) if spread > 0.0 else math.inf


def _make_budget(variances: dict[Source, float]) -> tuple[BudgetLine, ...]:
    largest = max(variances.values())
    # Less is the rounding of the last digit that anyone prints.
    kept = {source: part for source, part in variances.items() if part > 1e-9 * largest}
    total = math.fsum(kept.values())
    lines = []
    for source, variance in sorted(kept.items(), key=lambda item: (-item[1], item[0])):
        kind = "A" if math.isfinite(source.degrees_of_freedom) else "B"
        lines.append(BudgetLine(source.name, kind, math.sqrt(variance), variance / total))
    return tuple(lines)


@dataclass(frozen=True)
class RigNumbers:
    """Uncertain inputs of all hits on one sample; those of a `RigInputs` know of each other."""

    hammer_mass: UncertainNumber  # m1 [kg]
    moving_mass: UncertainNumber  # m2, sample and accelerometer [kg]
    # Force on the hammer over its trace [kg]: m1, exact where force is what was measured.
    load: UncertainNumber
    # Factor on every measured time [-], 1 with the uncertainty of the sampling rate: times go
    # with it, rates against it.
    clock: UncertainNumber
    # Of the channels of hammer and sample over what is taken for them [-].
    gains: tuple[UncertainNumber, ...]
    low_pass: UncertainNumber  # 0 ± 1 [-]: the error by the low-pass, alike on all samples
    pulse_shape: UncertainNumber  # 0 ± 1 [-]: the error by the pulse's shape, alike on all samples
    notes: tuple[Note, ...] = ()  # what is assumed, since nothing states it

    def find_speed(self, change: UncertainNumber) -> UncertainNumber:
        """Return the hammer's change of velocity by that of its trace [m/s]."""
        return change if self.load is self.hammer_mass else change * self.load / self.hammer_mass

    def follow(self, course: Course) -> "RigNumbers":
        """Return them for a series whose peaks or widths change from hit to hit."""
        if course == STEADY:
            return self
        peak = make_input("trend of the peaks", 1.0, course.peak_standard)
        width = make_input("trend of the widths", 1.0, course.width_standard)
        gains = tuple(gain * peak for gain in self.gains)
        return replace(self, clock=self.clock * width, gains=gains)


class RigInputs:
    """The uncertain inputs of a rig, each made once: what is one object is one input.

    So the results on two samples know of their common hammer, accelerometer and clock.
    """

    def __init__(self, setup: RigSetup) -> None:
        self._setup, samples = setup, setup.samples
        carried = samples.accelerometer_mass, samples.accelerometer_mass_uncertainty
        self._masses = (
            ("the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty),
            ("the accelerometer", *carried),
        )
        hammer, self._accelerometer = (_make_mass(*stated) for stated in self._masses)
        load = make_input("force", setup.hammer_load, 0.0) if setup.measures_force else hammer
        self._bodies: dict[tuple[str, float, float], UncertainNumber] = {}
        gains = (
            make_stated(
                f"gain of the {body}'s channel",
                1.0,
                setup.find_sensor(channel).sensitivity_uncertainty,
                ASSUMED_GAIN,
            )
            for body, channel in zip(("hammer", "sample"), CHANNELS, strict=True)
        )
        self._common = RigNumbers(
            hammer_mass=hammer,
            moving_mass=self._accelerometer,
            load=load,
            clock=make_input("sampling clock", 1.0, setup.clock_uncertainty),
            gains=tuple(gains),
            low_pass=make_input("low-pass", 0.0, 1.0),
            pulse_shape=make_input(PULSE_SHAPE, 0.0, 1.0),
        )

    def find(self, sample: str) -> RigNumbers:
        """Return masses, clock and gains of the hits on `sample` with their uncertainties.

        Raises
        ------
        ParameterError
            If the set has no such sample.
        """
        setup, struck = self._setup, self._setup.samples.find(sample)
        stated = struck.body, struck.mass, struck.mass_uncertainty
        body = self._bodies.get(stated)
        if body is None:
            body = self._bodies[stated] = _make_mass(*stated)
        masses = *self._masses, stated
        unstated = [name for name, mass, standard in masses if mass > 0.0 == standard]
        gains = [it for it in CHANNELS if not setup.find_sensor(it).sensitivity_uncertainty]
        notes = [
            Note(
                subject,
                f"the {what} of {' and '.join(names)} within {100.0 * part:g} %, standard, since"
                " nothing states it",
            )
            for subject, what, names, part in (
                (Subject.ASSUMED_GAIN, "gains", gains, ASSUMED_GAIN),
                (Subject.ASSUMED_MASS, "mass", unstated, ASSUMED_MASS),
            )
            if names
        ]
        moving = body + self._accelerometer
        return replace(self._common, moving_mass=moving, notes=tuple(notes))


def _make_mass(name: str, mass: float, standard: float) -> UncertainNumber:
    return make_stated(f"mass of {name}", mass, standard, ASSUMED_MASS)


def make_rig_numbers(setup: RigSetup, sample: str) -> RigNumbers:
    """Return the inputs of the hits on one sample for a result that shares them with no other."""
    return RigInputs(setup).find(sample)


def propagate_decay(
    source: str,
    per_hit: FloatArray,
    rig: RigNumbers,
    *,
    estimates: Sequence[float],
    averaged: int,
    errors: Sequence[tuple[str, FloatArray]] = (),
) -> dict[str, Quantity]:
    """Return zeta, c = 2 m a and k = m (a^2 + omega^2) of a decay's a [1/s] and omega [rad/s].

    The covariance of the estimates is that of the hits over their number, n - 1 degrees of
    freedom (GUM 5.2.3, H.2). What noise does to each single hit is in their scatter; a fit whose
    hits scatter less than the noise explains did so by chance.

    Parameters
    ----------
    source : str
        What scatters, for the budget: "scatter of the hits on steel".
    per_hit : ndarray, shape (n_hits, 2)
        a and omega of every hit.
    estimates : sequence of float, length 2
        The best estimates, for example of the mean trace.
    averaged : int
        Hits that the estimates are the mean of.
    errors : sequence of (str, ndarray of shape (2, 2))
        What is wrong with all hits alike: its source, and its covariance.

    Returns
    -------
    dict of str to Quantity
        By the fields of a body. Of one hit only, their uncertainties are not determined.
    """
    hits, count = per_hit.shape
    has_scatter = hits >= LEAST_HITS
    scatter = np.zeros((count, count))
    if has_scatter:
        scatter += np.cov(per_hit, rowvar=False, ddof=1) / averaged
    parameters = make_ensemble(source, estimates, scatter, max(hits - 1, 1))
    for name, covariance in errors:
        moved = make_ensemble(name, [0.0] * count, covariance, math.inf)
        parameters = tuple(one + more for one, more in zip(parameters, moved, strict=True))
    decay, frequency = (rate / rig.clock for rate in parameters)
    square = decay * decay + frequency * frequency
    numbers = {
        "damping_ratio": decay / square**0.5,
        "damping_coefficient": 2.0 * rig.moving_mass * decay,
        "stiffness": rig.moving_mass * square,
    }
    reasons = () if has_scatter else (ONE_HIT,)
    stated = {name: Known(number, reasons).state(rig.notes) for name, number in numbers.items()}
    # `rig` was made for the decay alone.
    return {name: replace(quantity, number=None) for name, quantity in stated.items()}


LEAST_HITS = 2
"""Hits that have a scatter [-]."""
ONE_HIT = Note(
    Subject.UNCERTAINTY,
    f"not determined, since one accepted hit shows no scatter; it takes {LEAST_HITS} or more",
)


UNEVEN = 0.1
"""U over the value [-] above which an interval is given by its ends, our choice: 1 / tau_p^2 is
then even within a tenth of U."""


@dataclass(frozen=True)
class Known:
    """An uncertain number, and why its uncertainty is not determined, if it is not."""

    number: UncertainNumber
    reasons: tuple[Note, ...] = ()
    formula: Callable[..., Any] | None = None  # that made it; None: it was measured or stated
    inputs: tuple["Known", ...] = ()  # of the formula

    def state(self, notes: tuple[Note, ...] = ()) -> Quantity:
        """Return it with its uncertainty, or with why there is none."""
        value = float(self.number.x)
        if self.reasons:
            return Quantity(value, notes=self.reasons)
        found = replace(compute_quantity(value, self.number, notes), number=self.number)
        if self.formula is None or not found.expanded > UNEVEN * abs(value):
            return found
        ends = []
        for wide in (-found.expanded, found.expanded):
            try:
                ends.append(self.move(self.number, wide / found.standard**2))
            except RigError:  # the formula has no value there
                ends.append(math.nan)
        return found if math.isnan(ends[0]) else replace(found, lower=ends[0], upper=ends[1])

    def move(self, result: UncertainNumber, factor: float) -> float:
        """Return the value where `result` is off by `factor` times its variance.

        What was measured moves by its covariance with the result, which is where it then lies on
        average.
        """
        if self.formula is None:
            return float(self.number.x + factor * load_gtc().get_covariance(self.number, result))
        return float(self.formula(*(item.move(result, factor) for item in self.inputs)))


def derive(formula: Callable[..., Any], *inputs: Known) -> Known:
    """Return the value of a formula of floats and uncertain numbers.

    Where the uncertainty of one is not determined, that of the result is not.
    """
    reasons = next((item.reasons for item in inputs if item.reasons), ())
    return Known(formula(*(item.number for item in inputs)), reasons, formula, inputs)
