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
from impact_rig.core.errors import ParameterError
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


Formula = Callable[[Sequence[UncertainNumber], RigNumbers], Sequence[UncertainNumber]]
"""Fitted parameters, masses and clock to results; written with + - * / ** and
`core.arithmetic` alone."""


def propagate_parameters(
    source: str,
    per_hit: FloatArray,
    formula: Formula,
    rig: RigNumbers,
    *,
    estimates: Sequence[float] | None = None,
    noise_covariance: FloatArray | None = None,
    averaged: int = 0,
    owner: str = "",
) -> tuple[Quantity, ...]:
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
        (parameters, rig) to results; the clock is the formula's to apply: times times
        `rig.clock`, rates over it.
    rig : RigNumbers
        Masses and clock.
    estimates : sequence of float, length p, optional
        The best estimates, say of the mean trace; the mean over the hits by default.
    noise_covariance : ndarray, shape (p, p), optional
        Of the estimates, by errors that the scatter does not show; known, so with infinite
        degrees of freedom. None: there are none.
    averaged : int
        Hits that the estimates are the mean of; 0: those of `per_hit`.
    owner : str
        What the parameters belong to, see `make_input`.

    Returns
    -------
    tuple of Quantity
        One for each result of `formula`; of one hit only the uncertainty is not determined.

    Raises
    ------
    ParameterError
        If the parameters are not a finite matrix or the covariance does not fit them.
    """
    values = np.asarray(per_hit, dtype=np.float64)
    if (
        values.shape != np.atleast_2d(values).shape
        or values.size == 0
        or not np.all(np.isfinite(values))
    ):
        raise ParameterError(
            f"parameters of the hits have shape {values.shape}: they must be a finite matrix with"
            " one row for each hit"
        )
    hits, count = values.shape
    best = values.mean(axis=0).tolist() if estimates is None else [float(x) for x in estimates]
    if hits < LEAST_HITS:
        exact = make_ensemble(source, best, np.zeros((count, count)), np.inf, owner)
        return tuple(Quantity(float(x.x), notes=(ONE_HIT,)) for x in formula(exact, rig))
    scatter = np.atleast_2d(np.cov(values, rowvar=False, ddof=1)) / (averaged or hits)
    parameters = make_ensemble(source, best, scatter, hits - 1, owner)
    if noise_covariance is not None:
        errors = make_ensemble("noise of the fit", [0.0] * count, noise_covariance, np.inf, owner)
        parameters = tuple(a + b for a, b in zip(parameters, errors, strict=True))
    numbers = formula(parameters, rig)
    return tuple(compute_quantity(float(number.x), number, rig.notes) for number in numbers)


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


def propagate_free_decay(
    source: str,
    per_hit: FloatArray,
    rig: RigNumbers,
    *,
    estimates: Sequence[float] | None = None,
    noise_covariance: FloatArray | None = None,
    averaged: int = 0,
    owner: str = "",
) -> FittedBody:
    """Propagate (a, omega_d) of a sample's free decay to zeta, c = 2 m a, k = m (a^2 + omega_d^2).

    Parameters
    ----------
    source, rig, estimates, noise_covariance, averaged, owner
        As in `propagate_parameters`.
    per_hit : ndarray, shape (n_hits, 2)
        Decay rate a [1/s] and damped angular frequency omega_d [rad/s] of every hit.
    """
    return FittedBody(
        *propagate_parameters(
            source,
            per_hit,
            _find_decaying_body,
            rig,
            estimates=estimates,
            noise_covariance=noise_covariance,
            averaged=averaged,
            owner=owner,
        )
    )


def propagate_identification(
    source: str,
    per_hit: FloatArray,
    rig: RigNumbers,
    *,
    estimates: Sequence[float] | None = None,
    noise_covariance: FloatArray | None = None,
    averaged: int = 0,
    owner: str = "",
) -> FittedBody:
    """Propagate identified (tau_p, k2, c2) to themselves and zeta, with mass and clock.

    Traces of accelerations determine k2 / m2 and c2 / m2, so that both go with the mass that was
    stated; times go with the clock, c2 against it, k2 against its square.

    Parameters
    ----------
    source, rig, estimates, noise_covariance, averaged, owner
        As in `propagate_parameters`.
    per_hit : ndarray, shape (n_hits, 3)
        tau_p [s], k2 [N/m] and c2 [N s/m] of every hit, at the stated mass.
    """
    return FittedBody(
        *propagate_parameters(
            source,
            per_hit,
            _find_identified_body,
            rig,
            estimates=estimates,
            noise_covariance=noise_covariance,
            averaged=averaged,
            owner=owner,
        )
    )


def _find_decaying_body(
    parameters: Sequence[UncertainNumber], rig: RigNumbers
) -> tuple[UncertainNumber, ...]:
    decay, frequency = (rate / rig.clock for rate in parameters)
    square = decay * decay + frequency * frequency
    return (
        decay / compute_square_root(square),
        2.0 * rig.moving_mass * decay,
        rig.moving_mass * square,
    )


def _find_identified_body(
    parameters: Sequence[UncertainNumber], rig: RigNumbers
) -> tuple[UncertainNumber, ...]:
    contact_time, stiffness, damping = parameters
    part = rig.moving_mass / rig.moving_mass.x
    stiffness = stiffness * part / (rig.clock * rig.clock)
    damping = damping * part / rig.clock
    ratio = estimate_damping_ratio_from_coefficient(damping, stiffness, rig.moving_mass)
    return ratio, damping, stiffness, contact_time * rig.clock
