"""Everything known of one sample: the paper's method, and the model beside the measurement."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimation.comparison import ModelComparison, compare_with_model
from impact_rig.core.estimation.paper_method import (
    NAN,
    BodyEstimate,
    ContactEstimate,
    estimate_bodies,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.setup.samples import RigSetup


@dataclass(frozen=True)
class SampleEstimate:
    """Everything known of one sample; NaN: not determined.

    Attributes
    ----------
    name : str
        Of the sample.
    impacts_accepted, impacts_rejected : int
        Hits in the mean and left out.
    contact : ContactEstimate or None
        From the hammer's mean trace; None: no accepted hit.
    contact_time_spread : float
        Standard deviation of tau_p over the accepted hits [s].
    body : BodyEstimate
        k2, zeta2, c2.
    hammer_peak, specimen_peak : float
        Of the mean traces [m/s^2].
    comparisons : tuple of ModelComparison
        One per model variant; empty: not possible, see the notes.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact: ContactEstimate | None = None
    contact_time_spread: float = NAN
    body: BodyEstimate = field(default_factory=BodyEstimate)
    hammer_peak: float = NAN
    specimen_peak: float = NAN
    comparisons: tuple[ModelComparison, ...] = ()

    def find_comparison(self, variant: ModelVariant) -> ModelComparison | None:
        """Return the comparison with one model variant, if there is one."""
        return next((item for item in self.comparisons if item.variant is variant), None)


def estimate_sample(
    name: str,
    mean: MeanHit,
    contact_times: tuple[float, ...],
    impacts_rejected: int,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    """Estimate tau_p, k2 and c2 of one sample, and compare it with the model.

    Parameters
    ----------
    name : str
        Of the sample.
    mean : MeanHit
        Its mean hit.
    contact_times : tuple of float
        tau_p of every accepted hit [s].
    impacts_rejected : int
        Hits left out.
    hammer : BodyEstimate
        Of the control experiment; k1 NaN: not known yet, and then k2 and c2 are neither.
    setup : RigSetup
        Masses and settings.
    """
    contact, body = estimate_bodies(mean, setup, name, hammer)
    peaks = np.abs(mean.traces).max(axis=1)
    estimate = SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact=contact,
        contact_time_spread=float(np.std(contact_times, ddof=1))
        if len(contact_times) > 1
        else NAN,
        body=body,
        hammer_peak=float(peaks[0]),
        specimen_peak=float(peaks[1]) if peaks.size > 1 else NAN,
    )
    return _add_comparisons(estimate, mean, hammer, setup)


def _add_comparisons(
    estimate: SampleEstimate,
    mean: MeanHit,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    body, contact = estimate.body, estimate.contact
    if contact is None or math.isnan(body.damping_coefficient):
        return estimate
    variants = [ModelVariant.DRIVEN]
    if not math.isnan(hammer.damping_coefficient):
        variants.append(ModelVariant.PRINTED)
    model = ImpactModel(
        # The driven model does not use the hammer's damping.
        hammer=Body(
            setup.hammer_mass, hammer.stiffness, float(np.nan_to_num(hammer.damping_coefficient))
        ),
        specimen=Body(
            setup.samples.find_moving_mass(estimate.name), body.stiffness, body.damping_coefficient
        ),
        contact_time=contact.contact_time,
        impact_speed=setup.impact_speed,
        peak_force=setup.hammer_mass * estimate.hammer_peak,
    )
    comparisons = tuple(
        compare_with_model(mean, model, variant, setup.analysis.cutoff_frequency)
        for variant in variants
    )
    return replace(estimate, comparisons=comparisons)
