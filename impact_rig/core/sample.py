"""Everything that is estimated of one sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from impact_rig.core.comparison import ModelComparison, compare_with_model
from impact_rig.core.contact_law import NO_LAW, ContactLaw
from impact_rig.core.damping import estimate_free_decay
from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.hits import MeanHit
from impact_rig.core.identification import NAMES, Identification, identify_model
from impact_rig.core.model import Body, ImpactModel, ModelVariant
from impact_rig.core.paper_method import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    NAN,
    STIFFNESS,
    BodyEstimate,
    HammerPulse,
    MeanReading,
    estimate_body,
    look_at_pulse,
)
from impact_rig.core.pulse_shape import NO_SHAPE, PulseShapeEstimate
from impact_rig.core.pulse_width import measure_pulse, measure_rise
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.sensors import CHANNELS
from impact_rig.core.setup import RigSetup
from impact_rig.core.uncertainty import (
    LEAST_HITS,
    ONE_HIT,
    compute_quantity,
    find_decaying_body,
    find_identified_body,
    make_rig_numbers,
    make_scatter,
    propagate_fit,
)

NEAR_LOW_PASS = 2.0
"""Of a resonance, in cutoff frequencies [-]; at twice the cutoff a sixteenth is left."""
SAME_FREQUENCY = 0.05
"""Difference of two frequencies that are one [-]: a mount's moves so far."""
FEWEST_SAMPLES = 3
"""That ring at one frequency [-]; two samples may well have the same k/m."""


def check_sensors(setup: RigSetup, contact_time: float) -> tuple[str, ...]:
    """Warn of stated resonances near the low-pass or the spectrum of a contact [s]."""
    cutoff = setup.analysis.cutoff_frequency
    warnings = []
    for channel in CHANNELS:
        resonance = setup.find_sensor(channel).resonance
        what = f"the resonance of the {channel}'s sensor, {resonance * 1e-3:.4g} kHz, lies near"
        if resonance and cutoff and resonance < NEAR_LOW_PASS * cutoff:
            warnings.append(
                f"{what} the low-pass of {cutoff * 1e-3:.4g} kHz: the models are sent through it,"
                " widths and peaks are read with its ringing; a low-pass of"
                f" {resonance / NEAR_LOW_PASS * 1e-3:.3g} kHz leaves little of that"
            )
        # Beyond this a pulse has 1e-3 left.
        if 0.0 < resonance < 5.0 / contact_time:
            warnings.append(
                f"{what} the spectrum of a contact this short, which makes it ring: the models are"
                " sent through it, widths and peaks are not; take a sensor with a higher one"
            )
    return tuple(warnings)


def explain_ringing(frequency: float, setup: RigSetup) -> str | None:
    """Say why what rings at a frequency [Hz] is the sensor's and no body's; None: it may be."""
    sensor, cutoff = setup.find_sensor("specimen"), setup.analysis.cutoff_frequency
    rings = f"what rings at {frequency * 1e-3:.3g} kHz"
    if abs(frequency - sensor.resonance) < SAME_FREQUENCY * sensor.resonance:
        return f"{rings} is the sensor, by the resonance that is stated of it, and no body"
    if cutoff and frequency > 0.5 * cutoff:
        return (
            f"{rings}, above half the low-pass of {cutoff * 1e-3:.4g} kHz, is a sensor or its"
            " mount, and no body"
        )
    return None


@dataclass(frozen=True)
class FreeDecayEstimate(Comparable):
    """What the decay after the contact says of a sample; NaN: not determined."""

    # m2 times the natural angular frequency squared
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    frequency: float = field(default=NAN, metadata=describe("Hz", "f", "frequency", shown="kHz"))
    periods: float = NAN  # that stand out of the noise
    r_squared: float = NAN
    residual_over_noise: float = NAN  # RMS; 1: nothing but noise

    @property
    def is_known(self) -> bool:
        """Whether it is determined."""
        return self.damping_ratio.is_known


NO_DECAY = FreeDecayEstimate()
"""Where it is not determined."""


@dataclass(frozen=True)
class FittedModel(Comparable):
    """One variant of the model laid onto both traces of a sample; NaN: not determined."""

    model: str  # "driven": equation (4) on the hammer, the sample driven by F(t) alone
    is_preferred: bool = False
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    # Force on the sample over force on the hammer; 1 if masses, calibrations and model are right.
    force_balance: float = NAN
    residual_hammer_percent: float = NAN  # RMS over the trace's peak
    residual_sample_percent: float = NAN
    residual_over_noise: float = NAN  # RMS of both traces; 1: nothing but noise
    parameters: tuple[str, ...] = ()  # names of all fitted parameters
    values: tuple[float, ...] = ()  # of the parameters, in SI units
    covariance: tuple[float, ...] = ()  # by one mean trace's noise, row by row
    undetermined: tuple[str, ...] = ()  # combinations that the traces do not determine
    notes: tuple[str, ...] = ()
    identification: Identification | None = field(default=None, metadata=INTERNAL)


def _estimate_decay(
    mean: MeanHit, setup: RigSetup, sample: str, contact_end: float
) -> FreeDecayEstimate:
    """Estimate stiffness and damping of a sample from the decay after the contact.

    Raises
    ------
    NotDeterminedError
        If the tail does not show the sample's oscillation.
    """
    cutoff = setup.analysis.cutoff_frequency
    decay = estimate_free_decay(mean, 1, contact_end, cutoff)
    if ringing := explain_ringing(decay.frequency, setup):
        raise NotDeterminedError(f"free decay: {ringing}")
    body = propagate_fit(
        f"scatter of the hits on {sample}",
        decay.hit_values,
        find_decaying_body,
        make_rig_numbers(setup, sample),
        estimates=(decay.decay_rate, decay.angular_frequency),
        averaged=mean.count,
    )
    return FreeDecayEstimate(
        **body,
        frequency=decay.frequency,
        periods=decay.periods,
        r_squared=decay.r_squared,
        residual_over_noise=decay.residual_over_noise,
    )


def fit_model(mean: MeanHit, setup: RigSetup, sample: str) -> FittedModel:
    """Fit the driven model to both mean traces of a sample.

    A model that comes near them without describing them tells the force balance alone.

    Raises
    ------
    NotDeterminedError
        If it does not come near them.
    """
    found = identify_model(mean, setup, sample)
    described = FittedModel(
        model=ModelVariant.DRIVEN.value,
        is_preferred=True,
        force_balance=found.force_balance,
        residual_hammer_percent=found.residual_percent[0],
        residual_sample_percent=found.residual_percent[1],
        residual_over_noise=math.sqrt(found.chi_square),
    )
    if found.misfit is not None:
        return replace(described, notes=(found.misfit,))
    columns = [NAMES.index(name) for name in ("tau_p", "k2", "c2")]
    body: dict[str, Any] = propagate_fit(
        f"scatter of the hits on {sample}",
        found.hit_values[:, columns],
        find_identified_body,
        make_rig_numbers(setup, sample),
        estimates=found.values[columns].tolist(),
        averaged=mean.count,
    )
    is_open = set(found.undetermined)
    for name, parameters in (
        ("contact_time", {"tau_p"}),
        ("stiffness", {"k2"}),
        ("damping_coefficient", {"c2"}),
        ("damping_ratio", {"k2", "c2"}),
    ):
        if is_open & parameters:
            body[name] = UNKNOWN
    return replace(
        described,
        **body,
        parameters=NAMES,
        values=tuple(
            math.nan if name in is_open else value
            for name, value in zip(NAMES, found.values.tolist(), strict=True)
        ),
        covariance=tuple(found.covariance.ravel().tolist()),
        undetermined=tuple(
            f"{name}: not determined by these traces" for name in found.undetermined
        ),
        identification=found,
    )


def find_frequency(model: FittedModel, sample: str, setup: RigSetup) -> float:
    """Return the frequency at which a fitted body swings on its spring [Hz]."""
    stiffness = model.stiffness.value / setup.samples.get_moving_mass(sample)
    return math.sqrt(stiffness) / (2.0 * math.pi)


@dataclass(frozen=True)
class TraceEstimates:
    """What the mean traces of a sample say, independent of the hammer's stiffness."""

    pulse: HammerPulse
    free_decay: FreeDecayEstimate
    notes: tuple[str, ...]  # why any of it is not determined


def estimate_traces(name: str, mean: MeanHit, setup: RigSetup) -> TraceEstimates:
    """Estimate pulse shape, contact law and free decay of one sample from its mean hit.

    Raises
    ------
    SignalError
        If the hammer's mean trace has no whole pulse.
    """
    width = measure_pulse(mean.traces[0]).half_amplitude_width / mean.sampling_rate
    pulse = look_at_pulse(mean, setup, name)
    # A pulse that falls half as long again as it rises ends a twentieth later than tau_p says.
    contact_end = max(0.55 * setup.analysis.pulse_factor * width, pulse.law.separation)
    notes = pulse.notes + (() if pulse.law.is_known else pulse.law.notes)
    decay = NO_DECAY
    if mean.traces.shape[0] > 1:
        try:
            decay = _estimate_decay(mean, setup, name, contact_end)
        except RigError as error:
            notes = (*notes, str(error))
    return TraceEstimates(pulse, decay, tuple(dict.fromkeys(notes)))


PEAK = describe("m/s^2", shown="m/s²")
TIME = describe("s", shown="µs")


@dataclass(frozen=True)
class SampleEstimate(Comparable):
    """Everything known of one sample; NaN: not determined, see the notes."""

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)  # of the mean trace
    contact_time_spread: float = field(default=NAN, metadata=TIME)  # standard deviation of hits
    half_amplitude_width: float = field(default=NAN, metadata=TIME)  # w50
    width_ratio: float = NAN  # w10 / w50
    equivalent_stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)  # k_eq
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)  # k2
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    log_decrement: float = NAN
    first_peak: float = field(default=NAN, metadata=PEAK)  # U1
    first_peak_time: float = field(default=NAN, metadata=TIME)  # from the middle of the pulse
    second_peak: float = field(default=NAN, metadata=PEAK)  # U2
    second_peak_time: float = field(default=NAN, metadata=TIME)
    hammer_peak: float = field(default=NAN, metadata=PEAK)  # of the mean traces
    specimen_peak: float = field(default=NAN, metadata=PEAK)
    hammer_peak_spread_percent: float = NAN  # standard deviation of the hits over their mean
    peak_force: Quantity = field(default=UNKNOWN, metadata=describe("N", "Fmax", "peak force"))
    rise_time: float = field(default=NAN, metadata=describe("s"))  # 10 % to 90 % of the peak
    mse_hammer_percent: float = NAN  # of the driven model over the record, as in Fig. 6
    mse_sample_percent: float = NAN
    contact_error_hammer_percent: float = NAN  # RMS of the same over the contact alone
    contact_error_sample_percent: float = NAN
    shift_hammer: float = field(default=NAN, metadata=TIME)  # of the model, later is positive
    shift_sample: float = field(default=NAN, metadata=TIME)
    printed_mse_hammer_percent: float = NAN  # of equations (1) and (2) as printed
    printed_mse_sample_percent: float = NAN
    pulse_shape: PulseShapeEstimate = NO_SHAPE
    contact_law: ContactLaw = NO_LAW  # of hammer and sample as free bodies
    free_decay: FreeDecayEstimate = NO_DECAY
    identifications: tuple[FittedModel, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what could not be determined, and why
    comparisons: tuple[ModelComparison, ...] = field(default=(), metadata=INTERNAL)

    @property
    def identification(self) -> FittedModel | None:
        """The preferred variant of the model."""
        return next((item for item in self.identifications if item.is_preferred), None)


def estimate_numbers(
    name: str,
    series: MeanReading,
    contact_time_spread: float,
    impacts_rejected: int,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    """Estimate tau_p, k2 and c2 of one sample by equations (5) and (6b), and nothing beside them.

    The standard deviation of tau_p over the accepted hits [s] is NaN of one hit. As long as k1 of
    the hammer is NaN, k2 and c2 are not determined.
    """
    mean, contact_time = series.mean, series.contact_time.state()
    equivalent, body = estimate_body(series, setup, name, hammer)
    peaks, tops = body.peaks, np.abs(mean.traces).max(axis=1).tolist()
    noted = (
        contact_time,
        equivalent,
        body.stiffness,
        body.damping_ratio,
        body.damping_coefficient,
    )
    notes = body.notes + tuple(note for item in noted for note in item.notes)
    return SampleEstimate(
        name=name,
        impacts_accepted=mean.count,
        impacts_rejected=impacts_rejected,
        contact_time=contact_time,
        contact_time_spread=contact_time_spread,
        half_amplitude_width=series.width,
        width_ratio=series.width_ratio,
        # Its budget is that of tau_p and the masses: it is not told again.
        equivalent_stiffness=replace(equivalent, budget=()),
        stiffness=body.stiffness,
        damping_ratio=body.damping_ratio,
        damping_coefficient=body.damping_coefficient,
        log_decrement=body.log_decrement,
        first_peak=peaks.first_peak if peaks else NAN,
        first_peak_time=_find_time(mean, peaks.first_index) if peaks else NAN,
        second_peak=peaks.second_peak if peaks else NAN,
        second_peak_time=_find_time(mean, peaks.second_index) if peaks else NAN,
        hammer_peak=tops[0],
        specimen_peak=tops[1] if len(tops) > 1 else NAN,
        hammer_peak_spread_percent=_compute_peak_spread(mean),
        peak_force=_estimate_peak_force(name, mean, setup),
        rise_time=measure_rise(mean.traces[0]) / mean.sampling_rate,
        warnings=tuple(filter(None, (check_steps(mean), check_control(setup)))),
        notes=tuple(dict.fromkeys(notes)),
    )


def add_checks(
    estimate: SampleEstimate,
    mean: MeanHit,
    hammer: BodyEstimate,
    setup: RigSetup,
    traces: TraceEstimates,
) -> SampleEstimate:
    """Put pulse shape, contact law, free decay and comparison with the model beside the numbers.

    The model is not fitted yet: see `add_model`.
    """
    shape, law, contact_time = traces.pulse.shape, traces.pulse.law, estimate.contact_time.value
    # A law that contradicts the versed-sine says all that there is to say of the shape.
    is_said = law.is_known and law.excludes_versed_sine
    warnings = (
        None if is_said else shape.warning,
        *check_sensors(setup, contact_time),
        *law.warnings,
        check_delay(mean, law, contact_time),
    )
    checked = replace(
        estimate,
        pulse_shape=_add_stiffness(shape, estimate),
        contact_law=law,
        free_decay=traces.free_decay,
        warnings=tuple(filter(None, warnings)) + estimate.warnings,
        notes=estimate.notes + traces.notes,
    )
    return _add_comparisons(checked, mean, hammer, setup)


def _add_stiffness(shape: PulseShapeEstimate, estimate: SampleEstimate) -> PulseShapeEstimate:
    """Add k2 as each shape would make it: k_eq, k1 and with them k2 go as F^-2."""
    k2, tau = estimate.stiffness.value, estimate.contact_time.value
    fits = (replace(fit, stiffness=k2 * (tau / fit.contact_time) ** 2) for fit in shape.fits)
    return replace(shape, fits=tuple(fits))


def _compute_peak_spread(mean: MeanHit) -> float:
    peaks = [hit.pulse.peak for hit in mean.hits]
    return 100.0 * float(np.std(peaks, ddof=1) / abs(np.mean(peaks))) if len(peaks) > 1 else NAN


def _estimate_peak_force(name: str, mean: MeanHit, setup: RigSetup) -> Quantity:
    peak = float(np.abs(mean.traces[0]).max())
    if len(mean.hits) < LEAST_HITS:
        return Quantity(setup.hammer_mass * peak, notes=(ONE_HIT,))
    peaks = [hit.pulse.peak for hit in mean.hits]
    number = make_scatter(f"scatter of the peaks on {name}", peak, peaks, mean.count)
    rig = make_rig_numbers(setup, name)
    force = rig.hammer_mass * rig.gains[0] * number
    return compute_quantity(setup.hammer_mass * peak, force)


def _find_time(mean: MeanHit, index: int) -> float:
    return (index - mean.origin) / mean.sampling_rate


def add_model(estimate: SampleEstimate, mean: MeanHit, setup: RigSetup) -> SampleEstimate:
    """Fit the model to the mean traces that `estimate` was made from.

    For a series that is complete, not after every hit.
    """
    if mean.traces.shape[0] <= 1:
        return estimate
    try:
        model = fit_model(mean, setup, estimate.name)
    except RigError as error:
        return replace(estimate, notes=(*estimate.notes, str(error)))
    if model.stiffness.is_known:
        ringing = explain_ringing(find_frequency(model, estimate.name, setup), setup)
        if ringing:
            return replace(estimate, notes=(*estimate.notes, f"identification: {ringing}"))
    return replace(estimate, identifications=(model,), notes=(*estimate.notes, *model.notes))


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
        compare_with_model(mean, model, variant, setup.find_chains(mean.sampling_rate))
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


STEPS = (
    "the noise is smaller than the converter's steps and does not average them out: the"
    " uncertainties of free decay and identification leave that out; amplify the signals, or use"
    " more bits"
)


def check_delay(mean: MeanHit, law: ContactLaw, contact_time: float) -> str | None:
    """Warn unless hammer and sample, if it is free, pass half of their momenta at one time."""
    # A spring takes part of the momentum to its support.
    if not (law.is_known and math.isclose(law.momentum_ratio.value, 1.0, abs_tol=0.1)):
        return None
    pulse, rate = measure_pulse(mean.traces[0]), mean.sampling_rate
    reach = pulse.half_amplitude_width
    first, last = max(int(pulse.rise - reach), 0), math.ceil(pulse.fall + reach)
    halves = []
    for trace in mean.traces[:, first:last]:
        passed = np.abs(np.cumsum(trace))
        halves.append(float(np.interp(0.5 * passed[-1], passed, np.arange(passed.size))))
    delay = (halves[-1] - halves[0]) / rate
    # Sound needs so long for 20 mm of steel.
    if abs(delay) <= 0.02 * contact_time:
        return None
    side = "after" if delay > 0.0 else "before"
    return (
        f"the sample's momentum comes {abs(delay) * 1e6:.2g} µs {side} the hammer's: a channel is"
        " late, or points are missing"
    )


def check_steps(mean: MeanHit) -> str | None:
    """Warn unless the noise dithers the converter."""
    step, noise = mean.largest_step, mean.least_noise
    # Of so much noise exp(-2 pi^2 0.4^2), 4 %, of the steps is left.
    return STEPS if np.any((step > 0.0) & (noise < 0.4 * step)) else None


def check_control(setup: RigSetup) -> str | None:
    """Warn unless control sample and hammer are alike."""
    control = setup.samples.control_sample
    if not control or setup.find_unknown_masses(control):
        return None
    mass, hammer = setup.samples.get_moving_mass(control), setup.hammer_mass
    # The published control sample differs by 5 %.
    if abs(mass - hammer) <= 0.2 * hammer:
        return None
    return (
        f"the control sample {control!r} of {mass * 1e3:.4g} g is not alike to the hammer of"
        f" {hammer * 1e3:.4g} g, as k1 = 2 k_eq assumes: k1, and with it every k2 and c2, may be"
        " wrong"
    )


def withdraw_shared_ringing(
    samples: Sequence[SampleEstimate], setup: RigSetup
) -> tuple[SampleEstimate, ...]:
    """Take free decay, damping and model from samples that all ring at one frequency."""
    rings = [sample for sample in samples if sample.free_decay.is_known]
    masses = [setup.samples.get_moving_mass(sample.name) for sample in rings]
    if len(rings) < FEWEST_SAMPLES or not max(masses) >= 1.5 * min(masses):
        return tuple(samples)
    shared = float(np.median([sample.free_decay.frequency for sample in rings]))

    def is_shared(frequency: float) -> bool:
        return abs(frequency - shared) < SAME_FREQUENCY * shared

    if not all(is_shared(sample.free_decay.frequency) for sample in rings):
        return tuple(samples)
    note = (
        f"what rings at {shared * 1e-3:.2g} kHz does so on all samples, though their masses"
        " differ: it is a sensor or its mount, and no sample's k, zeta or c comes from it"
    )

    def withdraw(sample: SampleEstimate) -> SampleEstimate:
        if not sample.free_decay.is_known:
            return sample
        sample = replace(sample, free_decay=NO_DECAY, notes=(*sample.notes, note))
        period = sample.second_peak_time - sample.first_peak_time
        if is_shared(1.0 / period if period else 0.0):
            sample = replace(
                sample, damping_ratio=UNKNOWN, damping_coefficient=UNKNOWN, log_decrement=NAN
            )
        model = sample.identification
        if model is None or not model.stiffness.is_known:
            return sample
        is_same = is_shared(find_frequency(model, sample.name, setup))
        return replace(sample, identifications=()) if is_same else sample

    return tuple(map(withdraw, samples))
