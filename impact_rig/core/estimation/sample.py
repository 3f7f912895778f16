"""The paper's method: from mean traces to tau_p, k and c of hammer and sample."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.estimation.comparison import ModelComparison, compare_with_model
from impact_rig.core.estimation.log_decrement import (
    estimate_damping_coefficient,
    estimate_damping_ratio,
    estimate_log_decrement,
)
from impact_rig.core.estimation.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.setup.samples import RigSetup

NAN = math.nan
DAMPING_NAMES = ("c1", "c2")
"""Of hammer and sample, for what is said about them."""


@dataclass(frozen=True)
class BodyEstimate:
    """Stiffness and damping of one body; NaN: not determined.

    Attributes
    ----------
    stiffness : float
        [N/m]
    log_decrement, damping_ratio : float
        [-]
    damping_coefficient : float
        [N s/m]
    notes : tuple of str
        What could not be determined, and why.
    """

    stiffness: float = NAN
    log_decrement: float = NAN
    damping_ratio: float = NAN
    damping_coefficient: float = NAN
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ContactEstimate:
    """What the hammer's mean trace says of the contact.

    Attributes
    ----------
    half_amplitude_width : float
        w50 [s].
    width_ratio : float
        w10 / w50 [-]; NaN where the pulse does not come down to a tenth.
    contact_time : float
        tau_p [s].
    equivalent_stiffness : float
        k_eq [N/m].
    """

    half_amplitude_width: float
    width_ratio: float
    contact_time: float
    equivalent_stiffness: float


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
    body: BodyEstimate = BodyEstimate()
    hammer_peak: float = NAN
    specimen_peak: float = NAN
    comparisons: tuple[ModelComparison, ...] = ()

    def find_comparison(self, variant: ModelVariant) -> ModelComparison | None:
        """Return the comparison with one model variant, if there is one."""
        return next((item for item in self.comparisons if item.variant is variant), None)


def estimate_contact(mean: MeanHit, setup: RigSetup, sample: str) -> ContactEstimate:
    """Estimate tau_p = F w50 and k_eq of the contact with `sample` from the mean hammer trace.

    Raises
    ------
    SignalError
        If the mean trace has no whole pulse.
    """
    pulse = measure_pulse(mean.traces[0])
    width = pulse.half_amplitude_width / mean.sampling_rate
    contact_time = setup.analysis.pulse_factor * width
    equivalent_mass = estimate_equivalent_mass(
        setup.hammer_mass, setup.samples.find_moving_mass(sample)
    )
    return ContactEstimate(
        half_amplitude_width=width,
        width_ratio=pulse.width_ratio,
        contact_time=contact_time,
        equivalent_stiffness=estimate_equivalent_stiffness(equivalent_mass, contact_time),
    )


def estimate_body(mean: MeanHit, channel: int, mass: float, stiffness: float) -> BodyEstimate:
    """Estimate damping of one body from its mean trace, given its stiffness.

    Parameters
    ----------
    mean : MeanHit
        Mean hit.
    channel : int
        0: hammer, 1: sample.
    mass : float
        [kg]
    stiffness : float
        [N/m]; NaN: not determined, and then c is neither.
    """
    if channel >= mean.traces.shape[0]:
        return BodyEstimate(stiffness, notes=("c2: the sample's trace was not measured",))
    try:
        peaks = estimate_log_decrement(mean.traces[channel], float(mean.noise[channel]))
    except RigError as error:
        return BodyEstimate(stiffness, notes=(f"{DAMPING_NAMES[channel]}: {error}",))
    ratio = estimate_damping_ratio(peaks.log_decrement)
    coefficient = (
        NAN if math.isnan(stiffness) else estimate_damping_coefficient(ratio, stiffness, mass)
    )
    return BodyEstimate(stiffness, peaks.log_decrement, ratio, coefficient)


def estimate_hammer(control: MeanHit, setup: RigSetup) -> BodyEstimate:
    """Estimate k1 and c1 from the control experiment: hammer and sample alike, k1 = 2 k_eq."""
    contact = estimate_contact(control, setup, setup.samples.control_sample)
    stiffness = estimate_hammer_stiffness(contact.equivalent_stiffness)
    return estimate_body(control, 0, setup.hammer_mass, stiffness)


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
    contact = estimate_contact(mean, setup, name)
    moving_mass = setup.samples.find_moving_mass(name)
    stiffness, notes = NAN, hammer.notes
    if math.isnan(hammer.stiffness):
        notes += ("k2: not determined without k1",)
    else:
        try:
            stiffness = estimate_sample_stiffness(contact.equivalent_stiffness, hammer.stiffness)
        except NotDeterminedError as error:
            notes += (str(error),)
    body = estimate_body(mean, 1, moving_mass, stiffness)
    peaks = np.abs(mean.traces).max(axis=1)
    estimate = SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact=contact,
        contact_time_spread=float(np.std(contact_times, ddof=1))
        if len(contact_times) > 1
        else NAN,
        body=BodyEstimate(
            body.stiffness,
            body.log_decrement,
            body.damping_ratio,
            body.damping_coefficient,
            notes + body.notes,
        ),
        hammer_peak=float(peaks[0]),
        specimen_peak=float(peaks[1]) if peaks.size > 1 else NAN,
    )
    return _add_comparisons(estimate, mean, hammer, moving_mass, setup)


def _add_comparisons(
    estimate: SampleEstimate,
    mean: MeanHit,
    hammer: BodyEstimate,
    moving_mass: float,
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
        specimen=Body(moving_mass, body.stiffness, body.damping_coefficient),
        contact_time=contact.contact_time,
        impact_speed=setup.impact_speed,
        peak_force=setup.hammer_mass * estimate.hammer_peak,
    )
    comparisons = tuple(
        compare_with_model(mean, model, variant, setup.analysis.cutoff_frequency)
        for variant in variants
    )
    return replace(estimate, comparisons=comparisons)
