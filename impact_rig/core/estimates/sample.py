"""Everything that is estimated of one sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimates.checks import (
    NO_CHECKS,
    Checks,
    check_momenta,
    check_speed,
    use_measured_speed,
)
from impact_rig.core.estimates.contact_law import NO_LAW, ContactLaw
from impact_rig.core.estimates.mean_reading import HammerPulse, look_at_pulse
from impact_rig.core.estimates.model import (
    Body,
    ImpactModel,
    ModelComparison,
    ModelVariant,
    compare_with_model,
)
from impact_rig.core.estimates.paper_method import (
    MOMENT,
    NAN,
    NO_NUMBERS,
    BodyEstimate,
    PaperEstimate,
)
from impact_rig.core.estimates.pulse_shape import NO_SHAPE, PulseShapeEstimate
from impact_rig.core.estimates.ringing import (
    NO_DECAY,
    SAME_FREQUENCY,
    FreeDecayEstimate,
    estimate_decay,
    find_shared_ringing,
    reach,
    settle_damping,
)
from impact_rig.core.estimates.uncertainty import make_rig_numbers
from impact_rig.core.given.errors import RigError
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import INLINE, INTERNAL, NOT_NEGATIVE, UNKNOWN, Comparable
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.pulse_width import find_ends, measure_pulse
from impact_rig.core.mean.mean_hit import MeanHit

NEAR_LOW_PASS = 2.0
"""Lowest harmless resonance [cutoff frequencies]; at twice the cutoff a sixteenth is left."""


def check_sensors(setup: RigSetup, contact_time: float) -> tuple[Note, ...]:
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
    return tuple(Note(Subject.SENSOR, warning) for warning in warnings)


@dataclass(frozen=True)
class TraceEstimates:
    """Estimates from a sample's mean traces, independent of the hammer's stiffness."""

    pulse: HammerPulse
    checks: Checks
    free_decay: FreeDecayEstimate
    notes: tuple[Note, ...]  # why any of it is not determined


def estimate_traces(name: str, mean: MeanHit, setup: RigSetup) -> TraceEstimates:
    """Estimate pulse shape, contact law and free decay of one sample from its mean hit.

    Raises
    ------
    SignalError
        If the hammer's mean trace has no whole pulse.
    """
    shape, rate = measure_pulse(mean.traces[0]), mean.sampling_rate
    pulse = look_at_pulse(mean, setup, name)
    contact_end = max(
        # A pulse that falls half as long again as it rises ends a twentieth later than tau_p says.
        0.55 * setup.analysis.pulse_factor * shape.half_amplitude_width / rate,
        pulse.law.separation,
        # Without a law a long foot is still the contact; what stays above 1 % is no foot.
        float(np.nan_to_num(find_ends(mean.traces[0], shape)[1] - shape.middle)) / rate,
    )
    notes = pulse.notes + (() if pulse.law.is_known else pulse.law.notes)
    decay = NO_DECAY
    if mean.traces.shape[0] > 1:
        try:
            decay = estimate_decay(mean, setup, name, contact_end)
        except RigError as error:
            notes = (*notes, Note(Subject.FREE_DECAY, str(error)))
    checks = check_momenta(mean, setup, make_rig_numbers(setup, name), name)
    notes = (*notes, *decay.notes, *checks.notes)
    return TraceEstimates(pulse, checks, decay, tuple(dict.fromkeys(notes)))


@dataclass(frozen=True)
class ModelErrors(Comparable):
    """Distance between the model by the paper's numbers and the mean traces; NaN: not known."""

    # of the driven model over the record, as in Fig. 6
    mse_hammer_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    mse_sample_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    # RMS of the same over the contact alone
    contact_error_hammer_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    contact_error_sample_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    shift_hammer: float = field(default=NAN, metadata=MOMENT)  # of the model, later is positive
    shift_sample: float = field(default=NAN, metadata=MOMENT)
    # of equations (1) and (2) as printed
    printed_mse_hammer_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    printed_mse_sample_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)


NOT_COMPARED = ModelErrors()
"""Where there is no model to compare with."""


@dataclass(frozen=True)
class SampleEstimate(Comparable):
    """Everything known of one sample; NaN: not determined, see the notes."""

    name: str
    impacts_accepted: int
    impacts_rejected: int
    paper: PaperEstimate = field(default=NO_NUMBERS, metadata=INLINE)
    errors: ModelErrors = field(default=NOT_COMPARED, metadata=INLINE)
    pulse_shape: PulseShapeEstimate = NO_SHAPE
    contact_law: ContactLaw = NO_LAW  # of hammer and sample as free bodies
    checks: Checks = NO_CHECKS
    free_decay: FreeDecayEstimate = NO_DECAY
    warnings: tuple[Note, ...] = ()
    notes: tuple[Note, ...] = ()  # what could not be determined, and why
    comparisons: tuple[ModelComparison, ...] = field(default=(), metadata=INTERNAL)


@dataclass(frozen=True)
class SampleParts:
    """Parts from which a sample's estimate is put together."""

    name: str
    impacts_rejected: int
    mean: MeanHit
    paper: PaperEstimate
    hammer: BodyEstimate
    warnings: tuple[Note, ...] = ()  # of the series as a whole
    notes: tuple[Note, ...] = ()
    traces: TraceEstimates | None = None  # None: not looked at yet
    decay: FreeDecayEstimate = NO_DECAY  # that is known of the sample, of these hits or of fewer

    def without_ringing(self, shared: float) -> "SampleParts":
        """Return it without what comes from a sensor that rings at a frequency [Hz]."""
        if self.traces is None or not self.traces.free_decay.is_known:
            return self
        told = (
            f"what rings at {shared * 1e-3:.2g} kHz does so on all samples, though their masses"
            " differ: it is a sensor or its mount, and no sample's k, zeta or c comes from it"
        )
        paper = self.paper
        period = paper.second_peak_time - paper.first_peak_time
        if period and abs(1.0 / period - shared) < SAME_FREQUENCY * shared:
            paper = paper.without_damping()
        notes = (*self.traces.notes, Note(Subject.SENSOR, told))
        traces = replace(self.traces, free_decay=NO_DECAY, notes=notes)
        return replace(self, paper=paper, traces=traces, decay=NO_DECAY)

    def assemble(self, setup: RigSetup) -> SampleEstimate:
        """Return the estimate, with every part's warnings and notes."""
        paper, traces = settle_damping(self.paper, self.decay), self.traces
        counts = self.mean.count, self.impacts_rejected
        if traces is None:
            return SampleEstimate(
                self.name, *counts, paper,
                warnings=paper.warnings + self.warnings, notes=paper.notes + self.notes,
            )  # fmt: skip
        checks, setup = traces.checks, use_measured_speed(setup, self.mean)
        speed_is = "measured" if self.mean.impact_speeds.size else "stated"
        shape, contact_time = traces.pulse.shape, paper.contact_time.value
        law = settle_restitution(traces.pulse.law, checks)
        # Where a law contradicts the versed-sine, its note suffices for the shape.
        is_said = law.is_known and law.excludes_versed_sine
        warnings = (
            None if is_said else shape.warning,
            *check_sensors(setup, contact_time),
            check_speed(traces.pulse.law.impact_speed, checks.stated_restitution, setup, speed_is),
            *checks.warnings,
            *traces.free_decay.warnings,
            *law.warnings,
            check_delay(self.mean, checks, contact_time),
            *paper.warnings,
            *self.warnings,
        )
        # As each shape would make k2: k_eq, k1 and with them k2 go as F^-2.
        k2 = paper.stiffness.value
        fits = (
            replace(it, stiffness=k2 * (contact_time / it.contact_time) ** 2) for it in shape.fits
        )
        comparisons = compare_models(self.name, paper, self.mean, self.hammer, setup)
        return SampleEstimate(
            self.name,
            *counts,
            paper,
            _read_errors(comparisons),
            replace(shape, fits=tuple(fits)),
            law,
            checks,
            traces.free_decay,
            tuple(filter(None, warnings)),
            paper.notes + self.notes + traces.notes,
            comparisons,
        )


BY_LAW = "what the contact law says"
"""Line of a budget."""


def settle_restitution(law: ContactLaw, checks: Checks) -> ContactLaw:
    """Return a law with e and v by the impact speed, where the two contradict each other.

    The form of the loss is the law's only witness of both, and pulses of a loss with memory are
    much like others. A speed by which no e from 0 to 1 is possible is no witness: `check_speed`
    names it.
    """
    by_speed, by_law = checks.stated_restitution, law.restitution
    found = reach(by_speed, by_law, BY_LAW)
    if found is by_speed or abs(by_speed.value - 0.5) > 0.5 + by_speed.expanded:
        return law
    told = (
        "e and v of the contact law go by it; by the loss that describes the pulse e would be"
        f" {by_law.value:.3f} ± {by_law.expanded:.3f}: the contact loses energy otherwise, or that"
        " speed, a gain or a mass is wrong, and the energy lost is not told"
    )
    return replace(
        law,
        restitution=found,
        impact_speed=reach(checks.impact_speed, law.impact_speed, BY_LAW),
        energy_loss=UNKNOWN,
        warnings=(*law.warnings, Note(Subject.IMPACT_SPEED, told)),
    )


def assemble_samples(parts: Sequence[SampleParts], setup: RigSetup) -> tuple[SampleEstimate, ...]:
    """Return the estimates of all samples, without what is a sensor's on all of them."""
    decays = {part.name: part.traces.free_decay for part in parts if part.traces is not None}
    shared = find_shared_ringing(decays, setup)
    if shared is not None:
        parts = [part.without_ringing(shared) for part in parts]
    return tuple(part.assemble(setup.for_series(part.name)) for part in parts)


def compare_models(
    name: str, paper: PaperEstimate, mean: MeanHit, hammer: BodyEstimate, setup: RigSetup
) -> tuple[ModelComparison, ...]:
    """Lay the model by the paper's numbers onto the mean traces: driven, then as printed."""
    if not (paper.stiffness.is_known and paper.damping_coefficient.is_known):
        return ()
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
            setup.samples.get_moving_mass(name),
            paper.stiffness.value,
            paper.damping_coefficient.value,
        ),
        contact_time=paper.contact_time.value,
        impact_speed=float(np.nan_to_num(setup.impact_speed)),
        peak_force=setup.hammer_mass * paper.hammer_peak,
    )
    return tuple(
        compare_with_model(mean, model, variant, setup.find_chains(mean.sampling_rate))
        for variant in variants
    )


def _read_errors(comparisons: Sequence[ModelComparison]) -> ModelErrors:
    if not comparisons:
        return NOT_COMPARED
    driven, *printed = comparisons
    names = ("mse_percent", "contact_error_percent", "shift")
    errors = [getattr(it, name) for name in names for it in (driven.hammer, driven.specimen)]
    errors += [body.mse_percent for one in printed for body in (one.hammer, one.specimen)]
    return ModelErrors(*errors)


def check_delay(mean: MeanHit, checks: Checks, contact_time: float) -> Note | None:
    """Warn unless hammer and sample, if it is free, pass half of their momenta at one time."""
    # A spring takes part of the momentum to its support.
    if not math.isclose(checks.momentum_ratio.value, 1.0, abs_tol=0.1):
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
    return Note(
        Subject.DELAY,
        f"the sample's momentum comes {abs(delay) * 1e6:.2g} µs {side} the hammer's: a channel is"
        " late, or points are missing",
    )
