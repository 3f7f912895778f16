"""What each estimator makes of a campaign, beside the truth: the one place that calls them."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.fits import add_uncertainties, estimate_decay
from impact_rig.core.estimation.paper_method import (
    BodyEstimate,
    ContactEstimate,
    estimate_bodies,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.identification.identification import identify_model
from impact_rig.core.setup.samples import RigSetup
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


@dataclass(frozen=True)
class _Evidence:
    """What the estimators are given: the mean hit, and the paper's estimates from it."""

    mean: MeanHit
    setup: RigSetup
    sample: str
    contact: ContactEstimate
    body: BodyEstimate


Estimator = Callable[[_Evidence], dict[str, _Estimate]]


def evaluate(campaign: Campaign) -> tuple[Outcome, ...]:
    """Return every estimate of a campaign beside its truth."""
    case, sample, setup = campaign.case, campaign.sample, campaign.session.setup
    truth = campaign.truth.find_parameters(sample)
    bounds = find_bounds(case, campaign.rig, setup, sample)
    mean = campaign.session.find_mean(sample)
    if mean is None:
        raise NotDeterminedError(f"a campaign on {sample!r}: no hit was accepted")
    bodies = estimate_bodies(mean, setup, sample, campaign.session.estimate_hammer())
    evidence = _Evidence(mean, setup, sample, *bodies)
    outcomes = []
    for name in case.estimators:
        try:
            found = _ESTIMATORS[name](evidence)
        except NotDeterminedError:
            found = {}
        for quantity in ESTIMATED[name]:
            if name == PAPER and quantity in NEEDS_CONTROL and not case.has_control:
                continue
            is_paper_stiffness = (name, quantity) == (PAPER, STIFFNESS)
            true = truth["paper_stiffness" if is_paper_stiffness else quantity]
            value = found.get(quantity, _Estimate())
            bound = math.nan if is_paper_stiffness else bounds.get(quantity, math.nan)
            error, half_width = value.value / true - 1.0, value.expanded / true
            outcomes.append(Outcome(name, quantity, error, half_width, bound))
    return tuple(outcomes)


def _estimate_by_paper(evidence: _Evidence) -> dict[str, _Estimate]:
    contact, body = evidence.contact, evidence.body
    return {
        CONTACT_TIME: _Estimate(contact.contact_time, contact.contact_time_uncertainty.expanded),
        STIFFNESS: _Estimate(body.stiffness, body.stiffness_uncertainty.expanded),
        DAMPING_RATIO: _Estimate(body.damping_ratio, body.damping_ratio_uncertainty.expanded),
        DAMPING_COEFFICIENT: _Estimate(
            body.damping_coefficient, body.damping_coefficient_uncertainty.expanded
        ),
    }


def _estimate_by_free_decay(evidence: _Evidence) -> dict[str, _Estimate]:
    found = estimate_decay(
        evidence.mean, evidence.setup, evidence.sample, evidence.contact.contact_time
    )
    return {
        STIFFNESS: _Estimate(found.stiffness, found.uncertainties.stiffness.expanded),
        DAMPING_COEFFICIENT: _Estimate(
            found.damping_coefficient, found.uncertainties.damping_coefficient.expanded
        ),
        DAMPING_RATIO: _Estimate(found.damping_ratio, found.uncertainties.damping_ratio.expanded),
    }


def _identify(evidence: _Evidence) -> dict[str, _Estimate]:
    mean, setup, sample = evidence.mean, evidence.setup, evidence.sample
    fitted = identify_model(mean, setup, sample)
    found = add_uncertainties(fitted, setup, sample)
    return {
        CONTACT_TIME: _Estimate(fitted.contact_time, found.uncertainties.contact_time.expanded),
        STIFFNESS: _Estimate(fitted.stiffness, found.uncertainties.stiffness.expanded),
        DAMPING_COEFFICIENT: _Estimate(
            fitted.damping_coefficient, found.uncertainties.damping_coefficient.expanded
        ),
        DAMPING_RATIO: _Estimate(found.damping_ratio, found.uncertainties.damping_ratio.expanded),
    }


ESTIMATED = {
    PAPER: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    FREE_DECAY: (STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
    IDENTIFICATION: (CONTACT_TIME, STIFFNESS, DAMPING_COEFFICIENT, DAMPING_RATIO),
}
"""What each estimator determines."""
NEEDS_CONTROL = (STIFFNESS, DAMPING_COEFFICIENT)
"""What the paper's method gets from the control sample's k1."""
_ESTIMATORS: dict[str, Estimator] = {
    PAPER: _estimate_by_paper,
    FREE_DECAY: _estimate_by_free_decay,
    IDENTIFICATION: _identify,
}
