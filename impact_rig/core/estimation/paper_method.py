"""The paper's method: from mean traces to tau_p, k and c of hammer and sample.

Each figure comes with its uncertainty by the GUM. The figures are floats from the formulas of
`stiffness` and `log_decrement`; the same formulas, given uncertain numbers, carry the
uncertainties and their correlations.
"""

import math
from dataclasses import dataclass, field, replace

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.damping.log_decrement import (
    LogDecrement,
    estimate_damping_coefficient,
    estimate_damping_ratio,
)
from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.mean_reading import MeanReading, read_mean_hit
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.results import (
    NOT_DETERMINED,
    Uncertainty,
    find_uncertainty,
    make_input,
    make_undetermined,
)

NAN = math.nan


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
    peaks : LogDecrement or None
        U1 and U2 in the mean trace; None: not determined.
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
    peaks: LogDecrement | None = None
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


def estimate_contact(mean: MeanHit, setup: RigSetup, sample: str) -> ContactEstimate:
    """Estimate tau_p = F w50 and k_eq of the contact with `sample` from the mean hammer trace.

    Raises
    ------
    SignalError
        If the mean trace has no whole pulse.
    """
    return _estimate_contact(read_mean_hit(mean, setup, sample), setup, sample)


def _estimate_contact(series: MeanReading, setup: RigSetup, sample: str) -> ContactEstimate:
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
    series: MeanReading,
    channel: int,
    mass: float,
    stiffness: float,
    number: UncertainNumber | None,
) -> BodyEstimate:
    """Estimate damping of one body (0: hammer, 1: sample) from its mean trace, given stiffness.

    Mass in kg, stiffness in N/m; NaN: not determined, and then c is neither.
    """
    rig, numbers = series.rig, series.numbers
    stated = NOT_DETERMINED if number is None else find_uncertainty(number, rig.notes)
    body = BodyEstimate(stiffness, stiffness_uncertainty=stated, stiffness_number=number)
    if channel in series.notes:
        return replace(body, notes=(series.notes[channel],))
    peaks = series.decrements[channel]
    decrement = peaks.log_decrement
    ratio = estimate_damping_ratio(decrement)
    coefficient = (
        NAN if math.isnan(stiffness) else estimate_damping_coefficient(ratio, stiffness, mass)
    )
    body = replace(
        body,
        log_decrement=decrement,
        damping_ratio=ratio,
        damping_coefficient=coefficient,
        peaks=peaks,
    )
    if numbers is None:
        missing = make_undetermined(series.reason)
        return replace(
            body, damping_ratio_uncertainty=missing, damping_coefficient_uncertainty=missing
        )
    if channel in numbers.notes:
        missing = make_undetermined(numbers.notes[channel])
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
    series = read_mean_hit(control, setup, sample)
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


def estimate_bodies(
    mean: MeanHit, setup: RigSetup, sample: str, hammer: BodyEstimate
) -> tuple[ContactEstimate, BodyEstimate]:
    """Estimate the contact with `sample` and the sample itself: tau_p and k_eq, k2 and c2.

    Parameters
    ----------
    mean : MeanHit
        Of the hits on the sample.
    setup : RigSetup
        Masses and settings.
    sample : str
        Its name.
    hammer : BodyEstimate
        Of the control experiment; k1 NaN: not known yet, and then k2 and c2 are neither. Its
        notes come first among the sample's.

    Raises
    ------
    SignalError
        If the mean trace has no whole pulse.
    """
    series = read_mean_hit(mean, setup, sample)
    contact = _estimate_contact(series, setup, sample)
    moving_mass = setup.samples.find_moving_mass(sample)
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
    return contact, replace(body, notes=notes + body.notes)


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
