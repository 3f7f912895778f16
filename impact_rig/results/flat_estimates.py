"""From the core's estimates to results, flat."""

import math
from collections.abc import Mapping
from dataclasses import replace

from impact_rig.core.estimation.comparison import ModelComparison
from impact_rig.core.estimation.fits import FittedModel, FreeDecayEstimate
from impact_rig.core.estimation.paper_method import BodyEstimate, ContactEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.session import SessionResults
from impact_rig.core.uncertainty.results import Uncertainty
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.cross_checks import (
    FreeDecayResults,
    IdentificationResults,
    PulseShapeResults,
    ShapeFitResults,
)
from impact_rig.results.estimates import NAN, BudgetLineResults, HammerResults, SampleResults
from impact_rig.results.setup_results import setup_results_from_setup


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
        setup=setup_results_from_setup(session.setup),
        hammer=hammer_results_from_body(session.hammer, session.setup.samples.control_sample),
        samples=tuple(map(sample_results_from_estimate, session.samples)),
        hits=tuple(
            hit_results_from_judged(hit, faults_by_record.get(hit.label.record, ()))
            for hit in sorted(
                session.accepted + session.rejected, key=lambda hit: hit.label.record
            )
        ),
    )


def hammer_results_from_body(hammer: BodyEstimate, control_sample: str) -> HammerResults:
    """Flatten what the control experiment says of the hammer."""
    return HammerResults(
        control_sample=control_sample,
        stiffness_n_per_m=hammer.stiffness,
        stiffness_u_n_per_m=hammer.stiffness_uncertainty.standard,
        stiffness_expanded_n_per_m=hammer.stiffness_uncertainty.expanded,
        damping_coefficient_n_s_per_m=hammer.damping_coefficient,
        damping_coefficient_u_n_s_per_m=hammer.damping_coefficient_uncertainty.standard,
        damping_coefficient_expanded_n_s_per_m=hammer.damping_coefficient_uncertainty.expanded,
        damping_ratio=hammer.damping_ratio,
        damping_ratio_u=hammer.damping_ratio_uncertainty.standard,
        damping_ratio_expanded=hammer.damping_ratio_uncertainty.expanded,
        log_decrement=hammer.log_decrement,
        budget=_flatten_body_budget(hammer),
        notes=hammer.notes,
    )


def sample_results_from_estimate(estimate: SampleEstimate) -> SampleResults:
    """Flatten the estimate of one sample."""
    contact = estimate.contact or ContactEstimate(NAN, NAN, NAN, NAN)
    body = estimate.body
    driven = estimate.find_comparison(ModelVariant.DRIVEN)
    printed = estimate.find_comparison(ModelVariant.PRINTED)
    mse_hammer, mse_sample = _read_mse(driven)
    printed_mse_hammer, printed_mse_sample = _read_mse(printed)
    return SampleResults(
        name=estimate.name,
        impacts_accepted=estimate.impacts_accepted,
        impacts_rejected=estimate.impacts_rejected,
        contact_time_s=contact.contact_time,
        contact_time_u_s=contact.contact_time_uncertainty.standard,
        contact_time_expanded_s=contact.contact_time_uncertainty.expanded,
        contact_time_spread_s=estimate.contact_time_spread,
        half_amplitude_width_s=contact.half_amplitude_width,
        width_ratio=contact.width_ratio,
        equivalent_stiffness_n_per_m=contact.equivalent_stiffness,
        equivalent_stiffness_u_n_per_m=contact.equivalent_stiffness_uncertainty.standard,
        equivalent_stiffness_expanded_n_per_m=contact.equivalent_stiffness_uncertainty.expanded,
        stiffness_n_per_m=body.stiffness,
        stiffness_u_n_per_m=body.stiffness_uncertainty.standard,
        stiffness_expanded_n_per_m=body.stiffness_uncertainty.expanded,
        damping_coefficient_n_s_per_m=body.damping_coefficient,
        damping_coefficient_u_n_s_per_m=body.damping_coefficient_uncertainty.standard,
        damping_coefficient_expanded_n_s_per_m=body.damping_coefficient_uncertainty.expanded,
        damping_ratio=body.damping_ratio,
        damping_ratio_u=body.damping_ratio_uncertainty.standard,
        damping_ratio_expanded=body.damping_ratio_uncertainty.expanded,
        log_decrement=body.log_decrement,
        first_peak_m_per_s2=body.peaks.first_peak if body.peaks else NAN,
        first_peak_time_s=estimate.first_peak_time,
        second_peak_m_per_s2=body.peaks.second_peak if body.peaks else NAN,
        second_peak_time_s=estimate.second_peak_time,
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
        budget=_flatten_budget("contact_time", contact.contact_time_uncertainty)
        + _flatten_body_budget(body),
        pulse_shape=_flatten_shape(estimate),
        free_decay=_flatten_decay(estimate.free_decay),
        identifications=tuple(map(_flatten_model, estimate.models)),
        warnings=estimate.warnings,
        notes=estimate.notes,
    )


def _flatten_body_budget(body: BodyEstimate) -> tuple[BudgetLineResults, ...]:
    return (
        _flatten_budget("stiffness", body.stiffness_uncertainty)
        + _flatten_budget("damping_ratio", body.damping_ratio_uncertainty)
        + _flatten_budget("damping_coefficient", body.damping_coefficient_uncertainty)
    )


def _flatten_budget(quantity: str, uncertainty: Uncertainty) -> tuple[BudgetLineResults, ...]:
    return tuple(
        BudgetLineResults(quantity, line.source, line.kind, line.contribution, line.share)
        for line in uncertainty.budget
    )


def _flatten_shape(estimate: SampleEstimate) -> PulseShapeResults:
    shape, contact = estimate.shape, estimate.contact
    if shape is None or contact is None:
        return PulseShapeResults()
    return PulseShapeResults(
        best_shape=shape.best_shape,
        is_told_apart=shape.is_told_apart,
        fall_over_rise=shape.fall_over_rise,
        fits=tuple(
            ShapeFitResults(
                shape=fit.name,
                residual_percent=fit.residual_percent,
                contact_time_s=fit.contact_time_from_width,
                # With another F for every contact time, k_eq, k1 and with them k2 go as F^-2.
                stiffness_n_per_m=estimate.body.stiffness
                * (contact.contact_time / fit.contact_time_from_width) ** 2,
                duration_s=fit.contact_time,
                asymmetry=fit.asymmetry,
            )
            for fit in shape.fits
        ),
    )


def _flatten_decay(found: FreeDecayEstimate | None) -> FreeDecayResults:
    if found is None:
        return FreeDecayResults()
    return FreeDecayResults(
        damping_ratio=found.damping_ratio,
        damping_ratio_u=found.uncertainties.damping_ratio.standard,
        damping_ratio_expanded=found.uncertainties.damping_ratio.expanded,
        damping_coefficient_n_s_per_m=found.damping_coefficient,
        damping_coefficient_u_n_s_per_m=found.uncertainties.damping_coefficient.standard,
        damping_coefficient_expanded_n_s_per_m=found.uncertainties.damping_coefficient.expanded,
        stiffness_n_per_m=found.stiffness,
        stiffness_u_n_per_m=found.uncertainties.stiffness.standard,
        stiffness_expanded_n_per_m=found.uncertainties.stiffness.expanded,
        frequency_hz=found.decay.frequency,
        periods=found.decay.periods,
        r_squared=found.decay.r_squared,
        residual_over_noise=found.decay.residual_over_noise,
    )


def _flatten_model(model: FittedModel) -> IdentificationResults:
    found = model.identification
    flat = IdentificationResults(
        model=found.variant.value,
        is_preferred=model.is_preferred,
        criterion=found.criterion,
        force_balance=found.force_balance,
        residual_hammer_percent=found.residual_percent[0],
        residual_sample_percent=found.residual_percent[1],
        residual_over_noise=math.sqrt(found.chi_square),
        parameters=found.names,
        values=tuple(found.values.tolist()),
        covariance=tuple(found.covariance.ravel().tolist()),
        undetermined=found.undetermined,
        notes=found.notes,
    )
    if not found.describes_traces:
        # The nearest parameters of a model that is not this body's are no measurement of it.
        return flat
    return replace(
        flat,
        contact_time_s=found.contact_time,
        contact_time_u_s=model.uncertainties.contact_time.standard,
        contact_time_expanded_s=model.uncertainties.contact_time.expanded,
        stiffness_n_per_m=found.stiffness,
        stiffness_u_n_per_m=model.uncertainties.stiffness.standard,
        stiffness_expanded_n_per_m=model.uncertainties.stiffness.expanded,
        damping_coefficient_n_s_per_m=found.damping_coefficient,
        damping_coefficient_u_n_s_per_m=model.uncertainties.damping_coefficient.standard,
        damping_coefficient_expanded_n_s_per_m=model.uncertainties.damping_coefficient.expanded,
        damping_ratio=model.damping_ratio,
        damping_ratio_u=model.uncertainties.damping_ratio.standard,
        damping_ratio_expanded=model.uncertainties.damping_ratio.expanded,
    )


def _read_mse(comparison: ModelComparison | None) -> tuple[float, float]:
    if comparison is None:
        return NAN, NAN
    return comparison.hammer.mse_percent, comparison.specimen.mse_percent


def hit_results_from_judged(hit: JudgedHit, injected_faults: tuple[str, ...]) -> HitResults:
    """Flatten the last word on one hit."""
    return HitResults(
        sample=hit.label.sample,
        impact=hit.label.impact,
        attempt=hit.label.attempt,
        record=hit.label.record,
        accepted=hit.accepted,
        reasons=tuple(str(rejection) for rejection in hit.rejections),
        contact_time_s=hit.contact_time,
        hammer_peak_m_per_s2=hit.hammer_peak,
        specimen_peak_m_per_s2=hit.specimen_peak,
        injected_faults=injected_faults,
    )
