"""From the core's estimates to results, flat."""

from collections.abc import Mapping

from impact_rig.core.estimation.comparison import ModelComparison
from impact_rig.core.estimation.paper_method import BodyEstimate, ContactEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.session import SessionResults
from impact_rig.reporting.results import (
    NAN,
    HammerResults,
    RejectedHit,
    Results,
    SampleResults,
)


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
    return Results(
        hammer=hammer_results_from_body(session.hammer, session.setup.samples.control_sample),
        samples=tuple(sample_results_from_estimate(item) for item in session.samples),
        rejections=tuple(
            rejected_hit_from_judged(hit, faults_by_record.get(hit.label.record, ()))
            for hit in sorted(session.rejected, key=lambda hit: hit.label.record)
        ),
    )


def hammer_results_from_body(hammer: BodyEstimate, control_sample: str) -> HammerResults:
    """Flatten what the control experiment says of the hammer."""
    return HammerResults(
        control_sample=control_sample,
        stiffness_n_per_m=hammer.stiffness,
        damping_coefficient_n_s_per_m=hammer.damping_coefficient,
        damping_ratio=hammer.damping_ratio,
        log_decrement=hammer.log_decrement,
        notes=hammer.notes,
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
