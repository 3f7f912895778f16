"""Everything known of one sample: the paper's method, and what stands beside it."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimation.assumptions import (
    check_balance,
    check_control,
    check_damping,
    check_shape,
    check_steps,
)
from impact_rig.core.estimation.comparison import ModelComparison, compare_with_model
from impact_rig.core.estimation.fits import (
    FittedModel,
    FreeDecayEstimate,
    fit_models,
)
from impact_rig.core.estimation.paper_method import (
    NAN,
    BodyEstimate,
    ContactEstimate,
    estimate_bodies,
)
from impact_rig.core.estimation.pulse_shape import PulseShapeEstimate
from impact_rig.core.estimation.traces import TraceEstimates, estimate_traces, look_at_shape
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY, RigSetup
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.uncertainty.contact import estimate_contact_time_uncertainty


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
    first_peak_time, second_peak_time : float
        Of U1 and U2 of the sample from the middle of the hammer pulse [s].
    comparisons : tuple of ModelComparison
        One per model variant; empty: not possible, see the notes.
    shape : PulseShapeEstimate or None
        Of the hammer's mean pulse; None: not determined.
    free_decay : FreeDecayEstimate or None
        Of the sample after the contact; None: not determined.
    models : tuple of FittedModel
        One for each variant that could be fitted; empty: none, or not asked for.
    warnings : tuple of str
        What a reader of the numbers must know.
    notes : tuple of str
        What could not be determined, and why.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact: ContactEstimate | None = None
    contact_time_spread: float = NAN
    body: BodyEstimate = field(default_factory=BodyEstimate)
    hammer_peak: float = NAN
    specimen_peak: float = NAN
    first_peak_time: float = NAN
    second_peak_time: float = NAN
    comparisons: tuple[ModelComparison, ...] = ()
    shape: PulseShapeEstimate | None = None
    free_decay: FreeDecayEstimate | None = None
    models: tuple[FittedModel, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def find_comparison(self, variant: ModelVariant) -> ModelComparison | None:
        """Return the comparison with one model variant, if there is one."""
        return next((item for item in self.comparisons if item.variant is variant), None)


def estimate_numbers(
    name: str,
    mean: MeanHit,
    contact_time_spread: float,
    impacts_rejected: int,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    """Estimate tau_p, k2 and c2 of one sample by the paper's method, and nothing beside them.

    Parameters
    ----------
    name : str
        Of the sample.
    mean : MeanHit
        Its mean hit.
    contact_time_spread : float
        Standard deviation of tau_p over the accepted hits [s]; NaN: of one hit.
    impacts_rejected : int
        Hits left out.
    hammer : BodyEstimate
        Of the control experiment; k1 NaN: not known yet, and then k2 and c2 are neither.
    setup : RigSetup
        Masses and settings.
    """
    contact, body = estimate_bodies(mean, setup, name, hammer)
    first_peak_time, second_peak_time = _find_peak_times(mean, body)
    return SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact=contact,
        contact_time_spread=contact_time_spread,
        body=body,
        hammer_peak=float(np.abs(mean.traces[0]).max()),
        specimen_peak=_find_specimen_peak(mean),
        first_peak_time=first_peak_time,
        second_peak_time=second_peak_time,
        warnings=check_steps(mean) + check_control(setup),
        notes=_gather_notes(contact, body),
    )


def add_checks(
    estimate: SampleEstimate,
    mean: MeanHit,
    hammer: BodyEstimate,
    setup: RigSetup,
    traces: TraceEstimates | None = None,
) -> SampleEstimate:
    """Put pulse shape, free decay and comparison with the model beside the numbers.

    Most of the work of an estimate; the model is not fitted yet: see `add_models`.

    Parameters
    ----------
    estimate : SampleEstimate
        As `estimate_numbers` made it.
    mean : MeanHit
        What it was made from.
    hammer : BodyEstimate
        Likewise.
    setup : RigSetup
        Masses and settings.
    traces : TraceEstimates or None
        Of this mean hit, where they are known already.
    """
    traces = traces or estimate_traces(estimate.name, mean, setup)
    checked = replace(
        estimate,
        shape=traces.shape,
        free_decay=traces.free_decay,
        warnings=check_shape(traces.shape)
        + check_damping(traces.free_decay, estimate.body)
        + estimate.warnings,
        notes=estimate.notes + traces.notes,
    )
    return _add_comparisons(checked, mean, hammer, setup)


def estimate_contact_alone(
    name: str,
    mean: MeanHit,
    contact_time_spread: float,
    impacts_rejected: int,
    settings: AnalysisSettings,
) -> SampleEstimate:
    """Estimate what needs no mass: tau_p and the pulse's shape; parameters as above."""
    pulse = measure_pulse(mean.traces[0])
    width = pulse.half_amplitude_width / mean.sampling_rate
    uncertainty = estimate_contact_time_uncertainty(
        mean, settings, DEFAULT_CLOCK_UNCERTAINTY, name
    )
    shape, shape_notes = look_at_shape(mean, settings)
    return SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact=ContactEstimate(
            half_amplitude_width=width,
            width_ratio=pulse.width_ratio,
            contact_time=settings.pulse_factor * width,
            equivalent_stiffness=NAN,
            contact_time_uncertainty=uncertainty,
        ),
        contact_time_spread=contact_time_spread,
        hammer_peak=float(np.abs(mean.traces[0]).max()),
        specimen_peak=_find_specimen_peak(mean),
        shape=shape,
        warnings=check_shape(shape),
        notes=uncertainty.notes + shape_notes,
    )


def _find_specimen_peak(mean: MeanHit) -> float:
    return float(np.abs(mean.traces[1]).max()) if mean.traces.shape[0] > 1 else NAN


def _find_peak_times(mean: MeanHit, body: BodyEstimate) -> tuple[float, float]:
    if body.peaks is None:
        return NAN, NAN
    first, second = (
        (index - mean.origin) / mean.sampling_rate
        for index in (body.peaks.first_index, body.peaks.second_index)
    )
    return first, second


def _gather_notes(contact: ContactEstimate, body: BodyEstimate) -> tuple[str, ...]:
    """Return the notes of all results, each once."""
    uncertainties = (
        contact.contact_time_uncertainty,
        contact.equivalent_stiffness_uncertainty,
        body.stiffness_uncertainty,
        body.damping_ratio_uncertainty,
        body.damping_coefficient_uncertainty,
    )
    notes = body.notes + tuple(note for item in uncertainties for note in item.notes)
    return tuple(dict.fromkeys(notes))


def add_models(
    estimate: SampleEstimate, mean: MeanHit, hammer: BodyEstimate, setup: RigSetup
) -> SampleEstimate:
    """Fit the model to the mean traces that `estimate` was made from; parameters as there.

    A tenth of a second's work: for a series that is complete, not after every hit.
    """
    if mean.traces.shape[0] <= 1:
        return estimate
    body, decay = estimate.body, estimate.free_decay
    start = StartingValues(
        stiffness=decay.stiffness if decay else body.stiffness,
        damping_coefficient=decay.damping_coefficient if decay else body.damping_coefficient,
        hammer_stiffness=hammer.stiffness,
        hammer_damping_coefficient=hammer.damping_coefficient,
    )
    models, notes = fit_models(mean, setup, estimate.name, start)
    return replace(
        estimate,
        models=models,
        warnings=estimate.warnings + check_balance(models),
        notes=estimate.notes + notes,
    )


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
