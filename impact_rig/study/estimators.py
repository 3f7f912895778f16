"""What each estimator makes of a campaign, beside the truth: the one place that calls them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.free_decay import estimate_free_decay
from impact_rig.core.estimation.identification import identify_model
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.estimation.uncertainty_arithmetic import UncertainNumber
from impact_rig.core.estimation.uncertainty_inputs import RigNumbers, find_rig_numbers
from impact_rig.core.estimation.uncertainty_propagation import Formula, propagate_parameters
from impact_rig.core.hits.averaging import MeanHit, average_hits
from impact_rig.core.hits.selection import select_hits
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import FloatArray
from impact_rig.study.bounds import find_bounds
from impact_rig.study.campaigns import Campaign
from impact_rig.study.cases import FREE_DECAY, IDENTIFICATION, PAPER

CONTACT_TIME = "contact_time"
STIFFNESS = "stiffness"
DAMPING_COEFFICIENT = "damping_coefficient"
DAMPING_RATIO = "damping_ratio"


@dataclass(frozen=True)
class Outcome:
    """One estimate of one quantity, relative to the truth; NaN: not determined.

    Attributes
    ----------
    estimator, quantity : str
        As named in this module.
    error : float
        Estimate over truth, less 1 [-].
    half_width : float
        Expanded uncertainty over truth [-].
    bound : float
        Least standard deviation of an unbiased estimator over truth [-].
    """

    estimator: str
    quantity: str
    error: float
    half_width: float
    bound: float = math.nan


@dataclass(frozen=True)
class _Estimate:
    """A value with its expanded uncertainty, in SI units; NaN: not determined."""

    value: float = math.nan
    expanded: float = math.nan


Estimator = Callable[[SampleEstimate, MeanHit, RigSetup], dict[str, _Estimate]]


def evaluate(campaign: Campaign) -> tuple[Outcome, ...]:
    """Return every estimate of a campaign beside its truth."""
    sample, setup = campaign.sample, campaign.session.setup
    truth = campaign.truth.find_parameters(sample)
    bounds = find_bounds(campaign.case, campaign.rig, setup, sample)
    estimate = campaign.session.estimate_sample(sample)
    filtered = [hit.filtered for hit in select_hits(campaign.hits).kept if hit.filtered]
    mean = average_hits(filtered)
    outcomes = []
    for name in campaign.case.estimators:
        try:
            found = _ESTIMATORS[name](estimate, mean, setup)
        except NotDeterminedError:
            found = {}
        for quantity in ESTIMATED[name]:
            if name == PAPER and quantity in NEEDS_CONTROL and not campaign.case.has_control:
                continue
            value = found.get(quantity, _Estimate())
            is_paper_stiffness = (name, quantity) == (PAPER, STIFFNESS)
            true = truth["paper_stiffness" if is_paper_stiffness else quantity]
            outcomes.append(
                Outcome(
                    name,
                    quantity,
                    value.value / true - 1.0,
                    value.expanded / true,
                    math.nan if is_paper_stiffness else bounds.get(quantity, math.nan),
                )
            )
    return tuple(outcomes)


def _estimate_by_paper(
    estimate: SampleEstimate, _mean: MeanHit, _setup: RigSetup
) -> dict[str, _Estimate]:
    contact, body = estimate.contact, estimate.body
    if contact is None:
        return {}
    return {
        CONTACT_TIME: _Estimate(contact.contact_time, contact.contact_time_uncertainty.expanded),
        STIFFNESS: _Estimate(body.stiffness, body.stiffness_uncertainty.expanded),
        DAMPING_RATIO: _Estimate(body.damping_ratio, body.damping_ratio_uncertainty.expanded),
        DAMPING_COEFFICIENT: _Estimate(
            body.damping_coefficient, body.damping_coefficient_uncertainty.expanded
        ),
    }


def _estimate_by_free_decay(
    estimate: SampleEstimate, mean: MeanHit, setup: RigSetup
) -> dict[str, _Estimate]:
    if estimate.contact is None:
        return {}
    found = estimate_free_decay(
        mean, 1, estimate.contact.contact_time, setup.analysis.cutoff_frequency
    )

    def derive(fitted: Sequence[UncertainNumber], rig: RigNumbers) -> list[UncertainNumber]:
        decay_rate, frequency = (value / rig.clock for value in fitted)
        squared = decay_rate**2 + frequency**2
        return [
            rig.moving_mass * squared,
            2.0 * rig.moving_mass * decay_rate,
            decay_rate / squared**0.5,
        ]

    mass = setup.samples.find_moving_mass(estimate.name)
    values = (
        found.find_stiffness(mass),
        found.find_damping_coefficient(mass),
        found.damping_ratio,
    )
    fitted = (found.decay_rate, found.angular_frequency)
    return _propagate(FREE_DECAY, values, fitted, found.hit_values, derive, estimate.name, setup)


def _identify(estimate: SampleEstimate, mean: MeanHit, setup: RigSetup) -> dict[str, _Estimate]:
    found = identify_model(mean, setup, estimate.name, ModelVariant.DRIVEN)
    stated_mass = setup.samples.find_moving_mass(estimate.name)

    def derive(fitted: Sequence[UncertainNumber], rig: RigNumbers) -> list[UncertainNumber]:
        # The fit knows k2 / m2 and c2 / m2 in the clock's time.
        contact_time, stiffness, damping = fitted
        mass = rig.moving_mass / stated_mass
        return [
            contact_time * rig.clock,
            stiffness * mass / rig.clock**2,
            damping * mass / rig.clock,
        ]

    columns = [found.names.index(name) for name in ("tau_p", "k2", "c2")]
    values = found.values[columns].tolist()
    per_hit = found.hit_values[:, columns]
    return _propagate(IDENTIFICATION, values, values, per_hit, derive, estimate.name, setup)


def _propagate(
    estimator: str,
    values: Sequence[float],
    fitted: Sequence[float],
    per_hit: FloatArray,
    derive: Formula,
    sample: str,
    setup: RigSetup,
) -> dict[str, _Estimate]:
    """Put the hits' scatter, masses and clock into the uncertainties of `values`."""
    uncertainties = propagate_parameters(
        f"scatter of the hits on {sample}",
        per_hit,
        derive,
        find_rig_numbers(setup, sample),
        estimates=fitted,
    )
    return {
        name: _Estimate(value, uncertainty.expanded)
        for name, value, uncertainty in zip(
            ESTIMATED[estimator], values, uncertainties, strict=True
        )
    }


ESTIMATED = {
    PAPER: (CONTACT_TIME, STIFFNESS, DAMPING_RATIO, DAMPING_COEFFICIENT),
    FREE_DECAY: (STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT),
}
"""What each estimator determines."""
NEEDS_CONTROL = (STIFFNESS, DAMPING_COEFFICIENT)
"""What the paper's method gets from the control sample's k1."""
_ESTIMATORS: dict[str, Estimator] = {
    PAPER: _estimate_by_paper,
    FREE_DECAY: _estimate_by_free_decay,
    IDENTIFICATION: _identify,
}
