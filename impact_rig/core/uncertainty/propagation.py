"""Uncertainty of what follows from parameters that were fitted to hits.

What the rig states about itself, masses and clock, enters as uncertain numbers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from impact_rig.core.arithmetic import (
    UncertainNumber,
    compute_square_root,
)
from impact_rig.core.damping.log_decrement import estimate_damping_ratio_from_coefficient
from impact_rig.core.quantity import UNKNOWN, Quantity
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import CHANNELS
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.uncertainty.contact import LEAST_HITS, ONE_HIT
from impact_rig.core.uncertainty.results import compute_quantity, make_ensemble, make_input


@dataclass(frozen=True)
class RigNumbers:
    """Uncertain inputs that a rig shares among all its hits on one sample.

    The same set-up always gives the same inputs, so that two samples know of their common
    hammer, accelerometer and clock.

    Attributes
    ----------
    hammer_mass : UncertainNumber
        m1 [kg].
    moving_mass : UncertainNumber
        m2, sample and accelerometer [kg].
    clock : UncertainNumber
        Factor on every measured time [-], 1 with the uncertainty of the sampling rate: times go
        with it, rates against it.
    notes : tuple of str
        Which masses state no uncertainty.
    gains : tuple of UncertainNumber
        Of the channels of hammer and sample over what is taken for them [-]: 1, exact where
        their sensors state no uncertainty.
    """

    hammer_mass: UncertainNumber
    moving_mass: UncertainNumber
    clock: UncertainNumber
    notes: tuple[str, ...] = ()
    gains: tuple[UncertainNumber, ...] = field(default_factory=lambda: make_gains(0.0, 0.0))


def make_gains(*uncertainties: float) -> tuple[UncertainNumber, ...]:
    """Return the gains of the channels, by their relative standard uncertainties [-]."""
    return tuple(
        make_input(f"gain of the {body}'s channel", 1.0, uncertainty)
        for body, uncertainty in zip(("hammer", "sample"), uncertainties, strict=True)
    )


def make_rig_numbers(setup: RigSetup, sample: str) -> RigNumbers:
    """Return masses and clock of the hits on `sample` with their stated uncertainties.

    Raises
    ------
    ParameterError
        If the set has no such sample.
    """
    struck, samples = setup.samples.find(sample), setup.samples
    hammer_mass = make_input(
        "mass of the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty
    )
    accelerometer_mass = make_input(
        "mass of the accelerometer",
        samples.accelerometer_mass,
        samples.accelerometer_mass_uncertainty,
    )
    sample_mass = make_input(f"mass of {struck.body}", struck.mass, struck.mass_uncertainty)
    unstated = [
        name
        for name, mass, uncertainty in (
            ("the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty),
            (
                "the accelerometer",
                samples.accelerometer_mass,
                samples.accelerometer_mass_uncertainty,
            ),
            (struck.body, struck.mass, struck.mass_uncertainty),
        )
        if mass > 0.0 and uncertainty == 0.0
    ]
    notes = (
        (f"uncertainty of k and c: none is stated for the mass of {' and '.join(unstated)}",)
        if unstated
        else ()
    )
    return RigNumbers(
        hammer_mass=hammer_mass,
        moving_mass=sample_mass + accelerometer_mass,
        clock=make_input("sampling clock", 1.0, setup.clock_uncertainty),
        notes=notes,
        gains=make_gains(
            *(setup.find_sensor(channel).sensitivity_uncertainty for channel in CHANNELS)
        ),
    )


@dataclass(frozen=True)
class FittedBody:
    """What was fitted to one body.

    Attributes
    ----------
    damping_ratio : Quantity
        zeta [-].
    damping_coefficient : Quantity
        c [N s/m].
    stiffness : Quantity
        k [N/m].
    contact_time : Quantity
        tau_p [s], where it was fitted too.
    """

    damping_ratio: Quantity
    damping_coefficient: Quantity
    stiffness: Quantity
    contact_time: Quantity = UNKNOWN


Formula = Callable[[Sequence[UncertainNumber], RigNumbers], Sequence[UncertainNumber]]
"""Fitted parameters, masses and clock to the fields of `FittedBody`; written with + - * / ** and
`core.arithmetic` alone. The clock is the formula's to apply: times times it, rates over it."""


def propagate_fit(
    source: str,
    per_hit: FloatArray,
    formula: Formula,
    rig: RigNumbers,
    *,
    estimates: Sequence[float],
    averaged: int,
    owner: str,
) -> FittedBody:
    """Propagate the scatter of fitted parameters, masses and clock to results.

    The covariance of the estimates is that of the hits over their number, n - 1 degrees of
    freedom (GUM 5.2.3, H.2). What noise does to each single hit is in their scatter; a fit whose
    hits scatter less than the noise explains did so by chance.

    Parameters
    ----------
    source : str
        What scatters, for the budget: "scatter of the hits on steel".
    per_hit : ndarray, shape (n_hits, p)
        The parameters of every hit, in any units.
    formula : callable
        `find_decaying_body` or `find_identified_body`.
    estimates : sequence of float, length p
        The best estimates, say of the mean trace.
    averaged : int
        Hits that the estimates are the mean of.
    owner : str
        What the parameters belong to, see `make_input`.

    Returns
    -------
    FittedBody
        Of one hit only, its uncertainties are not determined.
    """
    hits, count = per_hit.shape
    if hits < LEAST_HITS:
        exact = make_ensemble(source, estimates, np.zeros((count, count)), np.inf, owner)
        return FittedBody(
            *(Quantity(float(number.x), notes=(ONE_HIT,)) for number in formula(exact, rig))
        )
    scatter = np.atleast_2d(np.cov(per_hit, rowvar=False, ddof=1)) / averaged
    numbers = formula(make_ensemble(source, estimates, scatter, hits - 1, owner), rig)
    return FittedBody(
        *(compute_quantity(float(number.x), number, rig.notes) for number in numbers)
    )


def find_decaying_body(
    parameters: Sequence[UncertainNumber], rig: RigNumbers
) -> tuple[UncertainNumber, ...]:
    """Return zeta, c = 2 m a and k = m (a^2 + omega^2) of a decay's a [1/s] and omega [rad/s]."""
    decay, frequency = (rate / rig.clock for rate in parameters)
    square = decay * decay + frequency * frequency
    return (
        decay / compute_square_root(square),
        2.0 * rig.moving_mass * decay,
        rig.moving_mass * square,
    )


def find_identified_body(
    parameters: Sequence[UncertainNumber], rig: RigNumbers
) -> tuple[UncertainNumber, ...]:
    """Return zeta, c2, k2 and tau_p of identified tau_p [s], k2 [N/m] and c2 [N s/m].

    Traces of accelerations determine k2 / m2 and c2 / m2, so that both go with the mass that was
    stated; times go with the clock, c2 against it, k2 against its square.
    """
    contact_time, stiffness, damping = parameters
    part = rig.moving_mass / rig.moving_mass.x
    stiffness = stiffness * part / (rig.clock * rig.clock)
    damping = damping * part / rig.clock
    ratio = estimate_damping_ratio_from_coefficient(damping, stiffness, rig.moving_mass)
    return ratio, damping, stiffness, contact_time * rig.clock
