"""What a campaign found, flat, with the names and units that leave the core.

The field names are those of results.json. Nothing in here depends on when, where or with which
libraries the numbers were found: the same hits give the same results, character by character.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from impact_rig.core.estimation.comparison import ModelComparison
from impact_rig.core.estimation.sample import ContactEstimate, SampleEstimate
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.session import SessionResults

NAN = math.nan


@dataclass(frozen=True)
class HammerResults:
    """What the control experiment says of the hammer; NaN: not determined.

    Attributes
    ----------
    control_sample : str
        Sample of the control experiment; empty: the set has none.
    stiffness_n_per_m : float
        k1 [N/m].
    damping_coefficient_n_s_per_m : float
        c1 [N s/m].
    damping_ratio, log_decrement : float
        zeta1, Delta1 [-].
    """

    control_sample: str = ""
    stiffness_n_per_m: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_ratio: float = NAN
    log_decrement: float = NAN


@dataclass(frozen=True)
class SampleResults:
    """What is known of one sample; NaN: not determined, see the notes.

    Attributes
    ----------
    name : str
        Of the sample.
    impacts_accepted, impacts_rejected : int
        Hits in the mean and left out.
    contact_time_s, contact_time_spread_s : float
        tau_p of the mean trace and its standard deviation over the hits [s].
    half_amplitude_width_s : float
        w50 [s].
    width_ratio : float
        w10 / w50 [-].
    equivalent_stiffness_n_per_m, stiffness_n_per_m : float
        k_eq and k2 [N/m].
    damping_coefficient_n_s_per_m : float
        c2 [N s/m].
    damping_ratio, log_decrement : float
        zeta2, Delta2 [-].
    hammer_peak_m_per_s2, specimen_peak_m_per_s2 : float
        Of the mean traces [m/s^2].
    mse_hammer_percent, mse_sample_percent : float
        Mean square error of the force-driven model over the record, as in Fig. 6 [%].
    contact_error_hammer_percent, contact_error_sample_percent : float
        RMS error of the same over the contact alone [%].
    shift_hammer_s, shift_sample_s : float
        Applied to that model's traces, later is positive [s].
    printed_mse_hammer_percent, printed_mse_sample_percent : float
        Mean square error of equations (1) and (2) as printed [%].
    notes : tuple of str
        What could not be determined, and why.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact_time_s: float = NAN
    contact_time_spread_s: float = NAN
    half_amplitude_width_s: float = NAN
    width_ratio: float = NAN
    equivalent_stiffness_n_per_m: float = NAN
    stiffness_n_per_m: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_ratio: float = NAN
    log_decrement: float = NAN
    hammer_peak_m_per_s2: float = NAN
    specimen_peak_m_per_s2: float = NAN
    mse_hammer_percent: float = NAN
    mse_sample_percent: float = NAN
    contact_error_hammer_percent: float = NAN
    contact_error_sample_percent: float = NAN
    shift_hammer_s: float = NAN
    shift_sample_s: float = NAN
    printed_mse_hammer_percent: float = NAN
    printed_mse_sample_percent: float = NAN
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RejectedHit:
    """One hit that was left out.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    impact, attempt, record : int
        Impact of the series, attempt at it, number of the arming; counted from 1.
    reasons : tuple of str
        Every reason, ``code: explanation``.
    injected_faults : tuple of str
        What the virtual rig did on purpose, by name; empty: nothing, or a real rig.
    """

    sample: str
    impact: int
    attempt: int
    record: int
    reasons: tuple[str, ...]
    injected_faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class Results:
    """Everything that a campaign or the analysis of its recording found.

    Attributes
    ----------
    hammer : HammerResults
        k1, c1.
    samples : tuple of SampleResults
        Those with hits, in the order of the sample set.
    rejections : tuple of RejectedHit
        By record.
    """

    hammer: HammerResults
    samples: tuple[SampleResults, ...]
    rejections: tuple[RejectedHit, ...]


def results_from_session(
    session: SessionResults, faults_by_record: Mapping[int, tuple[str, ...]]
) -> Results:
    """Flatten what a session found.

    Parameters
    ----------
    session : SessionResults
        Of the core.
    faults_by_record : mapping of int to tuple of str
        Injected faults by number of the arming; what is absent had none.
    """
    hammer = session.hammer
    return Results(
        hammer=HammerResults(
            control_sample=session.setup.samples.control_sample,
            stiffness_n_per_m=hammer.stiffness,
            damping_coefficient_n_s_per_m=hammer.damping_coefficient,
            damping_ratio=hammer.damping_ratio,
            log_decrement=hammer.log_decrement,
        ),
        samples=tuple(sample_results_from_estimate(item) for item in session.samples),
        rejections=tuple(
            rejected_hit_from_judged(hit, faults_by_record.get(hit.label.record, ()))
            for hit in sorted(session.rejected, key=lambda hit: hit.label.record)
        ),
    )


def sample_results_from_estimate(estimate: SampleEstimate) -> SampleResults:
    """Flatten the estimate of one sample."""
    contact = estimate.contact or ContactEstimate(NAN, NAN, NAN, NAN)
    driven = estimate.find_comparison(ModelVariant.DRIVEN)
    printed = estimate.find_comparison(ModelVariant.PRINTED)
    mse_hammer, mse_sample = _read_mse(driven)
    printed_mse_hammer, printed_mse_sample = _read_mse(printed)
    return SampleResults(
        name=estimate.name,
        impacts_accepted=estimate.impacts_accepted,
        impacts_rejected=estimate.impacts_rejected,
        contact_time_s=contact.contact_time,
        contact_time_spread_s=estimate.contact_time_spread,
        half_amplitude_width_s=contact.half_amplitude_width,
        width_ratio=contact.width_ratio,
        equivalent_stiffness_n_per_m=contact.equivalent_stiffness,
        stiffness_n_per_m=estimate.body.stiffness,
        damping_coefficient_n_s_per_m=estimate.body.damping_coefficient,
        damping_ratio=estimate.body.damping_ratio,
        log_decrement=estimate.body.log_decrement,
        hammer_peak_m_per_s2=estimate.hammer_peak,
        specimen_peak_m_per_s2=estimate.specimen_peak,
        mse_hammer_percent=mse_hammer,
        mse_sample_percent=mse_sample,
        contact_error_hammer_percent=driven.hammer.contact_error_percent if driven else NAN,
        contact_error_sample_percent=driven.specimen.contact_error_percent if driven else NAN,
        shift_hammer_s=driven.hammer.shift if driven else NAN,
        shift_sample_s=driven.specimen.shift if driven else NAN,
        printed_mse_hammer_percent=printed_mse_hammer,
        printed_mse_sample_percent=printed_mse_sample,
        notes=estimate.body.notes,
    )


def _read_mse(comparison: ModelComparison | None) -> tuple[float, float]:
    if comparison is None:
        return NAN, NAN
    return comparison.hammer.mse_percent, comparison.specimen.mse_percent


def rejected_hit_from_judged(hit: JudgedHit, injected_faults: tuple[str, ...]) -> RejectedHit:
    """Flatten the verdict on a rejected hit."""
    return RejectedHit(
        sample=hit.label.sample,
        impact=hit.label.impact,
        attempt=hit.label.attempt,
        record=hit.label.record,
        reasons=tuple(str(rejection) for rejection in hit.rejections),
        injected_faults=tuple(injected_faults),
    )
