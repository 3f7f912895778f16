"""Uncertainty of what follows from parameters that were fitted to hits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.arithmetic import (
    UncertainNumber,
    find_square_root,
)
from impact_rig.core.damping.log_decrement import estimate_damping_ratio_from_coefficient
from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.uncertainty.contact import LEAST_HITS, ONE_HIT
from impact_rig.core.uncertainty.inputs import RigNumbers
from impact_rig.core.uncertainty.results import (
    NOT_DETERMINED,
    Uncertainty,
    find_uncertainty,
    make_ensemble,
    make_undetermined,
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
) -> tuple[Uncertainty, ...]:
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
    tuple of Uncertainty
        One for each result of `formula`. Not determined, with a note, for one hit only: then
        how many results there are is found from the formula, too.

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
        return tuple(make_undetermined(ONE_HIT) for _ in formula(exact, rig))
    scatter = np.atleast_2d(np.cov(values, rowvar=False, ddof=1)) / (averaged or hits)
    parameters = make_ensemble(source, best, scatter, hits - 1, owner)
    if noise_covariance is not None:
        errors = make_ensemble("noise of the fit", [0.0] * count, noise_covariance, np.inf, owner)
        parameters = tuple(a + b for a, b in zip(parameters, errors, strict=True))
    return tuple(find_uncertainty(number, rig.notes) for number in formula(parameters, rig))


@dataclass(frozen=True)
class BodyUncertainties:
    """Uncertainties of what was fitted to one body.

    Attributes
    ----------
    damping_ratio : Uncertainty
        Of zeta [-].
    damping_coefficient : Uncertainty
        Of c [N s/m].
    stiffness : Uncertainty
        Of k [N/m].
    contact_time : Uncertainty
        Of tau_p [s], where it was fitted too.
    """

    damping_ratio: Uncertainty
    damping_coefficient: Uncertainty
    stiffness: Uncertainty
    contact_time: Uncertainty = NOT_DETERMINED


def propagate_free_decay(
    source: str,
    per_hit: FloatArray,
    rig: RigNumbers,
    *,
    estimates: Sequence[float] | None = None,
    noise_covariance: FloatArray | None = None,
    averaged: int = 0,
    owner: str = "",
) -> BodyUncertainties:
    """Propagate (a, omega_d) of a sample's free decay to zeta, c = 2 m a, k = m (a^2 + omega_d^2).

    Parameters
    ----------
    source, rig, estimates, noise_covariance, averaged, owner
        As in `propagate_parameters`.
    per_hit : ndarray, shape (n_hits, 2)
        Decay rate a [1/s] and damped angular frequency omega_d [rad/s] of every hit.
    """
    return BodyUncertainties(
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
) -> BodyUncertainties:
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
    return BodyUncertainties(
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
        decay / find_square_root(square),
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
