"""Everything known of one sample: the published method, what stands beside it, and warnings."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.errors import RigError
from impact_rig.core.estimation.comparison import ModelComparison, compare_with_model
from impact_rig.core.estimation.contact_law import (
    NO_LAW,
    ContactLaw,
    describe_contradiction,
    look_at_law,
)
from impact_rig.core.estimation.fits import (
    NO_DECAY,
    FittedModel,
    FreeDecayEstimate,
    estimate_decay,
    find_frequency,
    fit_models,
)
from impact_rig.core.estimation.paper_method import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    NAN,
    STIFFNESS,
    BodyEstimate,
    ContactEstimate,
    estimate_bodies,
)
from impact_rig.core.estimation.pulse_shape import (
    NO_SHAPE,
    PulseShapeEstimate,
    estimate_pulse_shape,
)
from impact_rig.core.estimation.sensor_check import check_sensors, explain_ringing
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse, measure_rise
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Quantity, describe
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.contact import LEAST_HITS, ONE_HIT
from impact_rig.core.uncertainty.propagation import make_rig_numbers
from impact_rig.core.uncertainty.results import compute_quantity, make_ensemble


@dataclass(frozen=True)
class TraceEstimates:
    """What the mean traces of a sample say whatever the hammer's stiffness is.

    Attributes
    ----------
    shape : PulseShapeEstimate
        Of the hammer's mean pulse.
    contact_law : ContactLaw
        Of hammer and sample.
    free_decay : FreeDecayEstimate
        Of the sample after the contact.
    notes : tuple of str
        Why they are not determined.
    """

    shape: PulseShapeEstimate
    contact_law: ContactLaw
    free_decay: FreeDecayEstimate
    notes: tuple[str, ...]


def estimate_traces(
    name: str, mean: MeanHit, setup: RigSetup, law: ContactLaw | None = None
) -> TraceEstimates:
    """Estimate pulse shape, contact law and free decay of one sample from its mean hit.

    The law of this mean hit may be given where it is known already.

    Raises
    ------
    SignalError
        If the hammer's mean trace has no whole pulse.
    """
    width = measure_pulse(mean.traces[0]).half_amplitude_width / mean.sampling_rate
    contact_time = setup.analysis.pulse_factor * width
    shape, shape_notes = look_at_shape(mean, setup)
    decay, decay_notes = _look_at_decay(mean, setup, name, contact_time)
    law = law or look_at_law(mean, setup, name)
    notes = shape_notes + (() if law.is_known else law.notes) + decay_notes
    return TraceEstimates(shape, law, decay, tuple(dict.fromkeys(notes)))


def look_at_shape(mean: MeanHit, setup: RigSetup) -> tuple[PulseShapeEstimate, tuple[str, ...]]:
    """Return the pulse's shape, or why it is not determined."""
    try:
        cutoff_frequency = setup.analysis.cutoff_frequency
        return estimate_pulse_shape(mean, cutoff_frequency, setup.responses[0]), ()
    except RigError as error:
        return NO_SHAPE, (str(error),)


def _look_at_decay(
    mean: MeanHit, setup: RigSetup, name: str, contact_time: float
) -> tuple[FreeDecayEstimate, tuple[str, ...]]:
    """Return the free decay, or why it is not determined."""
    if mean.traces.shape[0] <= 1:
        return NO_DECAY, ()
    try:
        decay = estimate_decay(mean, setup, name, contact_time)
    except RigError as error:
        return NO_DECAY, (str(error),)
    ringing = explain_ringing(decay.frequency, setup)
    return (NO_DECAY, (f"free decay: {ringing}",)) if ringing else (decay, ())


PEAK = describe("m/s^2", shown="m/s²")
TIME = describe("s", shown="µs")


@dataclass(frozen=True)
class SampleEstimate:
    """Everything known of one sample; NaN: not determined, see the notes.

    Attributes
    ----------
    name : str
        Of the sample.
    impacts_accepted, impacts_rejected : int
        Hits in the mean and left out.
    contact_time : Quantity
        tau_p of the mean trace [s].
    contact_time_spread : float
        Its standard deviation over the accepted hits [s].
    half_amplitude_width : float
        w50 [s].
    width_ratio : float
        w10 / w50 [-].
    equivalent_stiffness, stiffness : Quantity
        k_eq and k2 [N/m].
    damping_ratio, damping_coefficient : Quantity
        zeta2 [-] and c2 [N s/m].
    log_decrement : float
        Delta2 [-].
    first_peak, second_peak : float
        Magnitudes of U1 and U2, from which it is read [m/s^2].
    first_peak_time, second_peak_time : float
        Of U1 and U2 from the middle of the hammer pulse [s].
    hammer_peak, specimen_peak : float
        Of the mean traces [m/s^2].
    hammer_peak_spread_percent : float
        Standard deviation of the hammer's peaks over the accepted hits, over their mean [%]: how
        alike the hammer struck.
    peak_force : Quantity
        Largest force on the hammer, m1 max |a1| [N].
    rise_time : float
        Of the mean hammer pulse, from a tenth to nine tenths of its peak [s].
    mse_hammer_percent, mse_sample_percent : float
        Mean square error of the force-driven model over the record, as in Fig. 6 [%].
    contact_error_hammer_percent, contact_error_sample_percent : float
        RMS error of the same over the contact alone [%].
    shift_hammer, shift_sample : float
        Applied to that model's traces, later is positive [s].
    printed_mse_hammer_percent, printed_mse_sample_percent : float
        Mean square error of equations (1) and (2) as printed [%].
    pulse_shape : PulseShapeEstimate
        Of the hammer's mean pulse: whether it is a versed-sine, and what else it may be.
    contact_law : ContactLaw
        Of hammer and sample as free bodies, from the shape of the hammer's pulse.
    free_decay : FreeDecayEstimate
        Damping from the decay after the contact.
    identifications : tuple of FittedModel
        One for each variant that could be fitted; empty: none, or not asked for.
    warnings : tuple of str
        What a reader of the numbers must know.
    notes : tuple of str
        What could not be determined, and why.
    comparisons : tuple of ModelComparison
        The traces, one per model variant; empty: not possible, see the notes.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    contact_time_spread: float = field(default=NAN, metadata=TIME)
    half_amplitude_width: float = field(default=NAN, metadata=TIME)
    width_ratio: float = NAN
    equivalent_stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    log_decrement: float = NAN
    first_peak: float = field(default=NAN, metadata=PEAK)
    first_peak_time: float = field(default=NAN, metadata=TIME)
    second_peak: float = field(default=NAN, metadata=PEAK)
    second_peak_time: float = field(default=NAN, metadata=TIME)
    hammer_peak: float = field(default=NAN, metadata=PEAK)
    specimen_peak: float = field(default=NAN, metadata=PEAK)
    hammer_peak_spread_percent: float = field(default=NAN, metadata=describe(since=4))
    peak_force: Quantity = field(
        default=UNKNOWN, metadata=describe("N", "Fmax", "peak force", since=4)
    )
    rise_time: float = field(default=NAN, metadata=describe("s", since=4))
    mse_hammer_percent: float = NAN
    mse_sample_percent: float = NAN
    contact_error_hammer_percent: float = NAN
    contact_error_sample_percent: float = NAN
    shift_hammer: float = field(default=NAN, metadata=TIME)
    shift_sample: float = field(default=NAN, metadata=TIME)
    printed_mse_hammer_percent: float = NAN
    printed_mse_sample_percent: float = NAN
    pulse_shape: PulseShapeEstimate = NO_SHAPE
    contact_law: ContactLaw = field(default=NO_LAW, metadata=describe(since=4))
    free_decay: FreeDecayEstimate = NO_DECAY
    identifications: tuple[FittedModel, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    comparisons: tuple[ModelComparison, ...] = field(default=(), metadata=INTERNAL)

    @property
    def identification(self) -> FittedModel | None:
        """The preferred variant of the model."""
        return next((item for item in self.identifications if item.is_preferred), None)


def estimate_numbers(
    name: str,
    mean: MeanHit,
    contact_time_spread: float,
    impacts_rejected: int,
    hammer: BodyEstimate,
    setup: RigSetup,
    law: ContactLaw | None = None,
) -> SampleEstimate:
    """Estimate tau_p, k2 and c2 of one sample by equations (5) and (6b), and nothing beside them.

    Parameters
    ----------
    contact_time_spread : float
        Standard deviation of tau_p over the accepted hits [s]; NaN: of one hit.
    hammer : BodyEstimate
        Of the control experiment; k1 NaN: not known yet, and then k2 and c2 are neither.
    law : ContactLaw or None
        Of this mean hit, where it is known already.
    """
    contact, body = estimate_bodies(mean, setup, name, hammer, law)
    peaks = body.peaks
    return SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact_time=contact.contact_time,
        contact_time_spread=contact_time_spread,
        half_amplitude_width=contact.half_amplitude_width,
        width_ratio=contact.width_ratio,
        # Its budget is that of tau_p and the masses: it is not told again.
        equivalent_stiffness=replace(contact.equivalent_stiffness, budget=()),
        stiffness=body.stiffness,
        damping_ratio=body.damping_ratio,
        damping_coefficient=body.damping_coefficient,
        log_decrement=body.log_decrement,
        first_peak=peaks.first_peak if peaks else NAN,
        first_peak_time=_find_time(mean, peaks.first_index) if peaks else NAN,
        second_peak=peaks.second_peak if peaks else NAN,
        second_peak_time=_find_time(mean, peaks.second_index) if peaks else NAN,
        hammer_peak=float(np.abs(mean.traces[0]).max()),
        specimen_peak=_find_specimen_peak(mean),
        hammer_peak_spread_percent=_compute_peak_spread(mean),
        peak_force=_estimate_peak_force(name, mean, setup),
        rise_time=measure_rise(mean.traces[0]) / mean.sampling_rate,
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
    """Put pulse shape, contact law, free decay and comparison with the model beside the numbers.

    Most of the work of an estimate; the model is not fitted yet: see `add_models`.

    Parameters
    ----------
    traces : TraceEstimates or None
        Of this mean hit, where they are known already.
    """
    traces = traces or estimate_traces(estimate.name, mean, setup)
    checked = replace(
        estimate,
        pulse_shape=_add_stiffness(traces.shape, estimate),
        contact_law=traces.contact_law,
        free_decay=traces.free_decay,
        warnings=check_shape(traces.shape, traces.contact_law, estimate, setup)
        + check_damping(traces.free_decay, estimate.damping_ratio)
        + estimate.warnings,
        notes=estimate.notes + traces.notes,
    )
    return _add_comparisons(checked, mean, hammer, setup)


def _add_stiffness(shape: PulseShapeEstimate, estimate: SampleEstimate) -> PulseShapeEstimate:
    """Add k2 as each shape would make it: k_eq, k1 and with them k2 go as F^-2."""
    return replace(
        shape,
        fits=tuple(
            replace(
                fit,
                stiffness=estimate.stiffness.value
                * (estimate.contact_time.value / fit.contact_time) ** 2,
            )
            for fit in shape.fits
        ),
    )


def _find_specimen_peak(mean: MeanHit) -> float:
    return float(np.abs(mean.traces[1]).max()) if mean.traces.shape[0] > 1 else NAN


def _compute_peak_spread(mean: MeanHit) -> float:
    peaks = [hit.pulse.peak for hit in mean.hits]
    return 100.0 * float(np.std(peaks, ddof=1) / np.mean(peaks)) if len(peaks) > 1 else NAN


def _estimate_peak_force(name: str, mean: MeanHit, setup: RigSetup) -> Quantity:
    peak = float(np.abs(mean.traces[0]).max())
    if len(mean.hits) < LEAST_HITS:
        return Quantity(setup.hammer_mass * peak, notes=(ONE_HIT,))
    peaks = [hit.pulse.peak for hit in mean.hits]
    (number,) = make_ensemble(
        f"scatter of the peaks on {name}",
        [peak],
        np.array([[np.var(peaks, ddof=1) / mean.count]]),
        len(peaks) - 1,
        owner=name,
    )
    rig = make_rig_numbers(setup, name)
    force = rig.hammer_mass * rig.gains[0] * number
    return compute_quantity(setup.hammer_mass * peak, force)


def _find_time(mean: MeanHit, index: int) -> float:
    return (index - mean.origin) / mean.sampling_rate


def _gather_notes(contact: ContactEstimate, body: BodyEstimate) -> tuple[str, ...]:
    """Return the notes of all results, each once."""
    quantities = (
        contact.contact_time,
        contact.equivalent_stiffness,
        body.stiffness,
        body.damping_ratio,
        body.damping_coefficient,
    )
    notes = body.notes + tuple(note for item in quantities for note in item.notes)
    return tuple(dict.fromkeys(notes))


def add_models(
    estimate: SampleEstimate, mean: MeanHit, hammer: BodyEstimate, setup: RigSetup
) -> SampleEstimate:
    """Fit the model to the mean traces that `estimate` was made from; parameters as there.

    A tenth of a second's work: for a series that is complete, not after every hit.
    """
    if mean.traces.shape[0] <= 1:
        return estimate
    known = estimate.free_decay if estimate.free_decay.is_known else estimate
    start = StartingValues(
        stiffness=known.stiffness.value,
        damping_coefficient=known.damping_coefficient.value,
        hammer_stiffness=hammer.stiffness.value,
        hammer_damping_coefficient=hammer.damping_coefficient.value,
    )
    models, notes = fit_models(mean, setup, estimate.name, start)
    ringing = {
        explain_ringing(find_frequency(model, estimate.name, setup), setup)
        for model in models
        if model.stiffness.is_known
    } - {""}
    if ringing:
        models, notes = (), tuple(f"identification: {text}" for text in sorted(ringing))
    return replace(
        estimate,
        identifications=models,
        warnings=estimate.warnings + check_balance(models),
        notes=estimate.notes + notes,
    )


def _add_comparisons(
    estimate: SampleEstimate,
    mean: MeanHit,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    if not estimate.damping_coefficient.is_known:
        return estimate
    variants = [ModelVariant.DRIVEN]
    if hammer.damping_coefficient.is_known and math.isfinite(setup.impact_speed):
        variants.append(ModelVariant.PRINTED)
    model = ImpactModel(
        # The driven model does not use the hammer's damping, nor the speed.
        hammer=Body(
            setup.hammer_mass,
            hammer.stiffness.value,
            float(np.nan_to_num(hammer.damping_coefficient.value)),
        ),
        specimen=Body(
            setup.samples.get_moving_mass(estimate.name),
            estimate.stiffness.value,
            estimate.damping_coefficient.value,
        ),
        contact_time=estimate.contact_time.value,
        impact_speed=float(np.nan_to_num(setup.impact_speed)),
        peak_force=setup.hammer_mass * estimate.hammer_peak,
    )
    comparisons = tuple(
        compare_with_model(mean, model, variant, setup.analysis.cutoff_frequency, setup.responses)
        for variant in variants
    )
    driven, *printed = comparisons
    return replace(
        estimate,
        mse_hammer_percent=driven.hammer.mse_percent,
        mse_sample_percent=driven.specimen.mse_percent,
        contact_error_hammer_percent=driven.hammer.contact_error_percent,
        contact_error_sample_percent=driven.specimen.contact_error_percent,
        shift_hammer=driven.hammer.shift,
        shift_sample=driven.specimen.shift,
        printed_mse_hammer_percent=printed[0].hammer.mse_percent if printed else NAN,
        printed_mse_sample_percent=printed[0].specimen.mse_percent if printed else NAN,
        comparisons=comparisons,
    )


DITHER = 0.4
"""Noise over one count below which the converter's steps show in the mean [-]: their remainder
exp(-2 pi^2 0.4^2) is 4 % of that of a noiseless converter."""
LARGEST_MASS_DIFFERENCE = 0.2
"""Of control sample and hammer, over the hammer's mass [-], our choice: the published ones are 5 %
apart."""
LARGEST_IMBALANCE = 0.05
"""Of the forces on hammer and sample [-], our choice: accelerometers are calibrated to a few per
cent."""
STEPS = (
    "the noise is smaller than the converter's steps and does not average them out: the"
    " uncertainties of free decay and identification leave that out; amplify the signals, or use"
    " more bits"
)
DRIVEN_PEAK = (
    "damping by the log decrement and by the free decay differ by more than their uncertainties:"
    " the body is still driven at its largest peak, and the free decay is to be preferred"
)


def check_shape(
    shape: PulseShapeEstimate, law: ContactLaw, estimate: SampleEstimate, setup: RigSetup
) -> tuple[str, ...]:
    """Warn of sensors, of momenta, and unless the pulse is a versed-sine.

    By the contact's law, or else by the best shape.
    """
    others = check_sensors(setup, estimate.contact_time.value) + law.warnings
    contradiction = describe_contradiction(
        law, estimate.contact_time.value, setup.analysis.pulse_factor
    )
    best = contradiction or shape.warning
    return ((best,) if best else ()) + others


def check_damping(decay: FreeDecayEstimate, ratio: Quantity) -> tuple[str, ...]:
    """Warn unless the body, of this damping ratio, decays freely from its largest peak."""
    difference = abs(ratio.value - decay.damping_ratio.value)
    # Both come from the same hits: the sum is more than the uncertainty of the difference.
    together = ratio.expanded + decay.damping_ratio.expanded
    return (DRIVEN_PEAK,) if difference > together else ()


def check_steps(mean: MeanHit) -> tuple[str, ...]:
    """Warn unless the noise dithers the converter."""
    step, noise = mean.summary.largest_step, mean.summary.least_noise
    return (STEPS,) if np.any((step > 0.0) & (noise < DITHER * step)) else ()


def check_control(setup: RigSetup) -> tuple[str, ...]:
    """Warn unless control sample and hammer are alike."""
    control = setup.samples.control_sample
    if not control or setup.find_unknown_masses(control):
        return ()
    mass, hammer = setup.samples.get_moving_mass(control), setup.hammer_mass
    if abs(mass - hammer) <= LARGEST_MASS_DIFFERENCE * hammer:
        return ()
    warning = (
        f"the control sample {control!r} of {mass * 1e3:.4g} g is not alike to the hammer of"
        f" {hammer * 1e3:.4g} g, as k1 = 2 k_eq assumes: k1, and with it every k2 and c2, may be"
        " wrong"
    )
    return (warning,)


def check_balance(models: tuple[FittedModel, ...]) -> tuple[str, ...]:
    """Warn unless hammer and sample feel the same force."""
    for model in models:
        if (
            model.is_preferred
            and model.model == ModelVariant.DRIVEN.value
            and abs(model.force_balance - 1.0) > LARGEST_IMBALANCE
        ):
            warning = (
                f"by the identification the sample feels {model.force_balance:.3g} times the"
                " force of the hammer: check masses and calibrations"
            )
            return (warning,)
    return ()
