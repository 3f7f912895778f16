"""The paper's method: from mean traces to tau_p, k and c of hammer and sample."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.estimation.comparison import ModelComparison, compare_with_model
from impact_rig.core.estimation.log_decrement import (
    LogDecrement,
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
from impact_rig.core.estimation.uncertainty import (
    NOT_DETERMINED,
    Uncertainty,
    find_uncertainty,
    make_input,
    make_undetermined,
)
from impact_rig.core.estimation.uncertainty_arithmetic import UncertainNumber
from impact_rig.core.estimation.uncertainty_contact import (
    ContactNumbers,
    estimate_contact_numbers,
)
from impact_rig.core.estimation.uncertainty_inputs import RigNumbers, find_rig_numbers
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import PulseWidth, measure_pulse
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
    stiffness_uncertainty, damping_ratio_uncertainty, damping_coefficient_uncertainty : Uncertainty
        Of the values above.
    stiffness_number : UncertainNumber or None
        The stiffness with all that it depends on, for what is calculated from it; None: its
        uncertainty is not determined, or none was stated.
    """

    stiffness: float = NAN
    log_decrement: float = NAN
    damping_ratio: float = NAN
    damping_coefficient: float = NAN
    notes: tuple[str, ...] = ()
    stiffness_uncertainty: Uncertainty = NOT_DETERMINED
    damping_ratio_uncertainty: Uncertainty = NOT_DETERMINED
    damping_coefficient_uncertainty: Uncertainty = NOT_DETERMINED
    stiffness_number: UncertainNumber | None = field(default=None, compare=False, repr=False)


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
    contact_time_uncertainty, equivalent_stiffness_uncertainty : Uncertainty
        Of the values above.
    equivalent_stiffness_number : UncertainNumber or None
        k_eq with all that it depends on; None: its uncertainty is not determined.
    """

    half_amplitude_width: float
    width_ratio: float
    contact_time: float
    equivalent_stiffness: float
    contact_time_uncertainty: Uncertainty = NOT_DETERMINED
    equivalent_stiffness_uncertainty: Uncertainty = NOT_DETERMINED
    equivalent_stiffness_number: UncertainNumber | None = field(
        default=None, compare=False, repr=False
    )


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


@dataclass(frozen=True)
class _Series:
    """A mean hit, read once: pulse, peaks of its traces, and what is known of their uncertainty.

    Attributes
    ----------
    mean : MeanHit
        What was read.
    pulse : PulseWidth
        Of the hammer.
    decrements : mapping of int to LogDecrement
        By channel, where determined.
    notes : mapping of int to str
        By channel, where not: why.
    rig : RigNumbers
        Masses and clock.
    numbers : ContactNumbers or None
        None: the uncertainty is not determined.
    reason : str
        Why not.
    """

    mean: MeanHit
    pulse: PulseWidth
    decrements: Mapping[int, LogDecrement]
    notes: Mapping[int, str]
    rig: RigNumbers
    numbers: ContactNumbers | None
    reason: str


def _read_series(mean: MeanHit, setup: RigSetup, sample: str) -> _Series:
    pulse = measure_pulse(mean.traces[0])
    # The hits on the control sample say something of both bodies, correlated; those on another
    # sample are asked for that sample alone.
    channels = (0, 1) if sample == setup.samples.control_sample else (1,)
    decrements: dict[int, LogDecrement] = {}
    notes: dict[int, str] = {}
    for channel in channels:
        if channel >= mean.traces.shape[0]:
            notes[channel] = "c2: the sample's trace was not measured"
            continue
        try:
            decrements[channel] = estimate_log_decrement(
                mean.traces[channel], float(mean.noise[channel])
            )
        except RigError as error:
            notes[channel] = f"{DAMPING_NAMES[channel]}: {error}"
    numbers, reason = None, ""
    try:
        numbers = estimate_contact_numbers(
            mean, pulse, decrements, setup.analysis, setup.clock_uncertainty, sample
        )
    except NotDeterminedError as error:
        reason = str(error)
    rig = find_rig_numbers(setup, sample)
    return _Series(mean, pulse, decrements, notes, rig, numbers, reason)


def estimate_contact(mean: MeanHit, setup: RigSetup, sample: str) -> ContactEstimate:
    """Estimate tau_p = F w50 and k_eq of the contact with `sample` from the mean hammer trace.

    Raises
    ------
    SignalError
        If the mean trace has no whole pulse.
    """
    return _estimate_contact(_read_series(mean, setup, sample), setup, sample)


def _estimate_contact(series: _Series, setup: RigSetup, sample: str) -> ContactEstimate:
    width = series.pulse.half_amplitude_width / series.mean.sampling_rate
    contact_time = setup.analysis.pulse_factor * width
    equivalent_mass = estimate_equivalent_mass(
        setup.hammer_mass, setup.samples.find_moving_mass(sample)
    )
    estimate = ContactEstimate(
        half_amplitude_width=width,
        width_ratio=series.pulse.width_ratio,
        contact_time=contact_time,
        equivalent_stiffness=estimate_equivalent_stiffness(equivalent_mass, contact_time),
    )
    rig, numbers = series.rig, series.numbers
    if numbers is None:
        missing = make_undetermined(series.reason)
        return replace(
            estimate, contact_time_uncertainty=missing, equivalent_stiffness_uncertainty=missing
        )
    stiffness = estimate_equivalent_stiffness(
        estimate_equivalent_mass(rig.hammer_mass, rig.moving_mass), numbers.contact_time
    )
    return replace(
        estimate,
        contact_time_uncertainty=find_uncertainty(numbers.contact_time),
        equivalent_stiffness_uncertainty=find_uncertainty(stiffness, rig.notes),
        equivalent_stiffness_number=stiffness,
    )


def _estimate_body(
    series: _Series, channel: int, mass: float, stiffness: float, number: UncertainNumber | None
) -> BodyEstimate:
    """Estimate damping of one body (0: hammer, 1: sample) from its mean trace, given stiffness.

    Mass in kg, stiffness in N/m; NaN: not determined, and then c is neither.
    """
    rig, numbers = series.rig, series.numbers
    stated = NOT_DETERMINED if number is None else find_uncertainty(number, rig.notes)
    body = BodyEstimate(stiffness, stiffness_uncertainty=stated, stiffness_number=number)
    if channel in series.notes:
        return replace(body, notes=(series.notes[channel],))
    decrement = series.decrements[channel].log_decrement
    ratio = estimate_damping_ratio(decrement)
    coefficient = (
        NAN if math.isnan(stiffness) else estimate_damping_coefficient(ratio, stiffness, mass)
    )
    body = replace(
        body, log_decrement=decrement, damping_ratio=ratio, damping_coefficient=coefficient
    )
    if numbers is None:
        missing = make_undetermined(series.reason)
        return replace(
            body, damping_ratio_uncertainty=missing, damping_coefficient_uncertainty=missing
        )
    uncertain_ratio = estimate_damping_ratio(numbers.log_decrements[channel])
    body = replace(body, damping_ratio_uncertainty=find_uncertainty(uncertain_ratio))
    if number is None:
        return body
    uncertain_coefficient = estimate_damping_coefficient(
        uncertain_ratio, number, rig.moving_mass if channel else rig.hammer_mass
    )
    return replace(
        body,
        damping_coefficient_uncertainty=find_uncertainty(uncertain_coefficient, rig.notes),
    )


def estimate_hammer(control: MeanHit, setup: RigSetup) -> BodyEstimate:
    """Estimate k1 and c1 from the control experiment: hammer and sample alike, k1 = 2 k_eq."""
    sample = setup.samples.control_sample
    series = _read_series(control, setup, sample)
    contact = _estimate_contact(series, setup, sample)
    number = contact.equivalent_stiffness_number
    body = _estimate_body(
        series,
        0,
        setup.hammer_mass,
        estimate_hammer_stiffness(contact.equivalent_stiffness),
        None if number is None else estimate_hammer_stiffness(number),
    )
    if number is None:
        return replace(body, stiffness_uncertainty=make_undetermined(f"k1: {series.reason}"))
    return body


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
    series = _read_series(mean, setup, name)
    contact = _estimate_contact(series, setup, name)
    moving_mass = setup.samples.find_moving_mass(name)
    stiffness, notes = NAN, hammer.notes
    number: UncertainNumber | None = None
    if math.isnan(hammer.stiffness):
        reason = "k2: not determined without k1"
        notes += (reason,)
        missing = make_undetermined(reason)
    else:
        try:
            stiffness = estimate_sample_stiffness(contact.equivalent_stiffness, hammer.stiffness)
            number, missing = _find_stiffness_number(contact, hammer)
        except NotDeterminedError as error:
            notes += (str(error),)
            missing = make_undetermined(str(error))
    body = _estimate_body(series, 1, moving_mass, stiffness, number)
    if number is None:
        body = replace(
            body, stiffness_uncertainty=missing, damping_coefficient_uncertainty=missing
        )
    peaks = np.abs(mean.traces).max(axis=1)
    estimate = SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact=contact,
        contact_time_spread=float(np.std(contact_times, ddof=1))
        if len(contact_times) > 1
        else NAN,
        body=replace(body, notes=notes + body.notes),
        hammer_peak=float(peaks[0]),
        specimen_peak=float(peaks[1]) if peaks.size > 1 else NAN,
    )
    return _add_comparisons(estimate, mean, hammer, moving_mass, setup)


def _find_stiffness_number(
    contact: ContactEstimate, hammer: BodyEstimate
) -> tuple[UncertainNumber | None, Uncertainty]:
    """Return k2 with its uncertainty; or None, and what is said instead."""
    if contact.equivalent_stiffness_number is None:
        return None, contact.equivalent_stiffness_uncertainty
    hammer_number = hammer.stiffness_number
    if hammer_number is None:
        if hammer.stiffness_uncertainty.notes:
            return None, hammer.stiffness_uncertainty
        # Given as a plain figure, not measured here: taken as exact.
        hammer_number = make_input("stiffness of the hammer", hammer.stiffness, 0.0)
    return estimate_sample_stiffness(
        contact.equivalent_stiffness_number, hammer_number
    ), NOT_DETERMINED


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
