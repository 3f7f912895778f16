"""Contact time, stiffness and damping by the paper's procedure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.contact_law import NO_LAW, ContactLaw, look_at_law
from impact_rig.core.damping import (
    LogDecrement,
    estimate_damping_coefficient,
    estimate_damping_ratio,
    estimate_log_decrement,
)
from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.hits import MeanHit
from impact_rig.core.pulse_shape import LIMITS as SHAPE_LIMITS
from impact_rig.core.pulse_shape import (
    NO_SHAPE,
    PulseShapeEstimate,
    compute_unexplained,
    estimate_pulse_shape,
)
from impact_rig.core.pulse_width import PulseWidth, compute_quantisation_error, measure_pulse
from impact_rig.core.pulses import PULSE_SHAPES
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.setup import RigSetup
from impact_rig.core.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.uncertainty import (
    ContactNumbers,
    RigNumbers,
    compute_quantity,
    estimate_contact_numbers,
    make_input,
    make_rig_numbers,
)

DAMPING_NAMES = ("c1", "c2")
"""Of hammer and sample, for what is said about them."""
LARGEST_OWN_PART = 0.5
"""Of a second peak that the other body's trace does not have in proportion [-], up to which it is
no decay of the body's own, our choice: noise makes a quarter of the least peak."""
LEAST_SWING = 0.5
"""Of the trace between both peaks to the other side, over sqrt(U1 U2) [-], our choice: 1 for a
free decay; a sensor that rings with 5 % of the pulse makes a quarter."""


@dataclass(frozen=True)
class MeanReading:
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


@dataclass(frozen=True)
class HammerPulse:
    """What the hammer's mean pulse looks like.

    Attributes
    ----------
    shape : PulseShapeEstimate
        Which of the known shapes it has.
    law : ContactLaw
        Which law of contact makes such a pulse.
    notes : tuple of str
        Why the shape is not determined.
    """

    shape: PulseShapeEstimate
    law: ContactLaw
    notes: tuple[str, ...] = ()


UNSEEN = HammerPulse(NO_SHAPE, NO_LAW)
"""Of a pulse that is not looked at yet: its estimates have no uncertainty."""


def look_at_pulse(mean: MeanHit, setup: RigSetup, sample: str) -> HammerPulse:
    """Return shape and law of the mean pulse on `sample`."""
    law = look_at_law(mean, setup, sample)
    try:
        shape = estimate_pulse_shape(mean, setup.analysis.cutoff_frequency, setup.responses[0])
    except RigError as error:
        return HammerPulse(NO_SHAPE, law, (str(error),))
    return HammerPulse(shape, law)


def compute_shape_error(
    pulse: HammerPulse, noise: float, half_amplitude_width: float, contact_time: float
) -> tuple[float, float]:
    """Return what the shapes that the data allow make of tau_p: spread and what is unsure of it.

    The contact lasts anywhere between tau_p and the durations that are possible, evenly
    distributed. A law that the data allow, or the shapes that come nearest, say which these are.
    As they leave more of the pulse than noise, all other shapes become possible, too.

    Parameters
    ----------
    noise : float
        Of the mean trace, over its peak [-].
    half_amplitude_width, contact_time : float
        w50 and tau_p [s].

    Returns
    -------
    spread, standard : float
        Standard uncertainty by the shape, signed and alike on all samples, and of the law's
        duration [s].
    """
    law, shape = pulse.law, pulse.shape
    unexplained, own = shape.unexplained, 0.0
    durations = {
        item.name: item.pulse_factor * half_amplitude_width - contact_time for item in PULSE_SHAPES
    }
    nearest = [durations[name] for name in shape.possible]
    if law.is_known:
        durations["law"] = law.duration.value - contact_time
        nearest = [durations["law"]]
        unexplained = compute_unexplained(law.residual_percent / 100.0, noise)
        own = float(np.nan_to_num(law.duration.standard))
    near = max(nearest, key=abs, default=0.0)
    far = max(durations.values(), key=abs)
    if abs(near) < abs(far):
        near += (far - near) * min(unexplained / SHAPE_LIMITS.residual, 1.0)
    return near / math.sqrt(3.0), own


def read_mean_hit(
    mean: MeanHit, setup: RigSetup, sample: str, form: HammerPulse | None = None
) -> MeanReading:
    """Read pulse and peaks of the mean hit on `sample`, with their uncertainty.

    The same mean hit and set-up always give the same uncertain inputs. What its pulse looks like,
    which tells how far tau_p may be from the contact's duration, may be given where it is known
    already.

    Raises
    ------
    SignalError
        If the mean hammer trace has no whole pulse.
    """
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
        # Steps that no noise smooths make peaks of their own.
        step = compute_quantisation_error(
            float(mean.largest_step[channel]),
            float(mean.least_noise[channel]),
        )
        try:
            peaks = estimate_log_decrement(
                mean.traces[channel], max(float(mean.noise[channel]), step)
            )
            _check_own_decay(mean, channel, peaks)
            decrements[channel] = peaks
        except RigError as error:
            notes[channel] = f"{DAMPING_NAMES[channel]}: {error}"
    numbers, reason = None, ""
    width = pulse.half_amplitude_width / mean.sampling_rate
    noise = float(mean.noise[0]) / abs(pulse.peak)
    form = form or look_at_pulse(mean, setup, sample)
    try:
        if form is UNSEEN:
            raise NotDeterminedError("the pulse's shape, and with it the uncertainty, comes later")
        numbers = estimate_contact_numbers(
            mean,
            pulse,
            decrements,
            setup.analysis,
            setup.clock_uncertainty,
            sample,
            compute_shape_error(form, noise, width, setup.analysis.pulse_factor * width),
        )
    except NotDeterminedError as error:
        reason = str(error)
    rig = make_rig_numbers(setup, sample)
    return MeanReading(mean, pulse, decrements, notes, rig, numbers, reason)


def _check_own_decay(mean: MeanHit, channel: int, peaks: LogDecrement) -> None:
    """Refuse a second peak that is no decay of the body's own.

    The force on both bodies, by the end of a contact or by a second one, shows on both in
    proportion; the decay of one does not. A sample that decays from its first peak swings through
    -sqrt(U1 U2) on the way to the second; noise, a second contact or a sensor's ringing does not.

    Raises
    ------
    NotDeterminedError
        If it is none.
    """
    if mean.traces.shape[0] == 1:
        return
    ours, other = mean.traces[channel], mean.traces[1 - channel]
    first, second = peaks.first_index, peaks.second_index
    shared = ours[first] / other[first] * other[second]
    if abs(ours[second] - shared) < LARGEST_OWN_PART * peaks.second_peak:
        raise NotDeterminedError(
            "no log decrement, since the second peak is no decay of the body: the force on both"
            " bodies has it, as at the end of a contact or by a second one"
        )
    swing = -float(np.min(ours[first:second] * np.sign(ours[first])))
    if channel and swing < LEAST_SWING * math.sqrt(peaks.first_peak * peaks.second_peak):
        raise NotDeterminedError(
            "no log decrement, since the second peak is no decay of the body, which would swing"
            " to the other side before it: noise, a second contact or a sensor that rings"
        )


NAN = math.nan
STIFFNESS = describe("N/m", "k", "stiffness", shown="MN/m")
DAMPING_RATIO = describe("", "ζ", "damping ratio")
DAMPING_COEFFICIENT = describe("N s/m", "c", "damping coefficient")
CONTACT_TIME = describe("s", "τp", "contact time", shown="µs")
"""What several kinds of estimates tell of a body."""


@dataclass(frozen=True)
class BodyEstimate(Comparable):
    """Stiffness and damping of one body; NaN: not determined.

    Attributes
    ----------
    stiffness : Quantity
        [N/m]
    damping_ratio : Quantity
        [-]
    damping_coefficient : Quantity
        [N s/m]
    log_decrement : float
        [-]
    notes : tuple of str
        What could not be determined, and why.
    peaks : LogDecrement or None
        U1 and U2 in the mean trace; None: not determined.
    stiffness_number : UncertainNumber or None
        The stiffness with all that it depends on, for what is calculated from it; None: its
        uncertainty is not determined, or none was stated.
    """

    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    log_decrement: float = field(default=NAN, metadata=describe("", "Δ", "log decrement"))
    notes: tuple[str, ...] = ()
    peaks: LogDecrement | None = field(default=None, metadata=INTERNAL)
    stiffness_number: UncertainNumber | None = field(
        default=None, compare=False, repr=False, metadata=INTERNAL
    )


@dataclass(frozen=True)
class HammerEstimate(BodyEstimate):
    """What the control experiment says of the hammer: k1, zeta1, c1.

    Attributes
    ----------
    control_sample : str
        Sample of the control experiment; empty: the set has none.
    """

    control_sample: str = ""


@dataclass(frozen=True)
class ContactEstimate(Comparable):
    """What the hammer's mean trace says of the contact.

    Attributes
    ----------
    half_amplitude_width : float
        w50 [s].
    width_ratio : float
        w10 / w50 [-]; NaN where the pulse does not come down to a tenth.
    contact_time : Quantity
        tau_p [s].
    equivalent_stiffness : Quantity
        k_eq [N/m]; not known without both masses.
    equivalent_stiffness_number : UncertainNumber or None
        k_eq with all that it depends on; None: its uncertainty is not determined.
    """

    half_amplitude_width: float = NAN
    width_ratio: float = NAN
    contact_time: Quantity = UNKNOWN
    equivalent_stiffness: Quantity = UNKNOWN
    equivalent_stiffness_number: UncertainNumber | None = field(
        default=None, compare=False, repr=False
    )


def _state(
    value: float,
    number: UncertainNumber | None,
    reasons: tuple[str, ...],
    notes: tuple[str, ...] = (),
) -> Quantity:
    """Return a value with the uncertainty of a number; without a number, why there is none."""
    if number is None:
        return Quantity(value, notes=reasons)
    return compute_quantity(value, number, notes)


def _estimate_contact(series: MeanReading, setup: RigSetup, sample: str) -> ContactEstimate:
    rig, reasons = series.rig, (series.reason,)
    time_number = None if series.numbers is None else series.numbers.contact_time
    width = series.pulse.half_amplitude_width / series.mean.sampling_rate
    contact_time = setup.analysis.pulse_factor * width
    contact = ContactEstimate(
        half_amplitude_width=width,
        width_ratio=series.pulse.width_ratio,
        contact_time=_state(contact_time, time_number, reasons),
    )
    if setup.find_unknown_masses(sample):
        return contact
    stiffness = estimate_equivalent_stiffness(
        estimate_equivalent_mass(setup.hammer_mass, setup.samples.get_moving_mass(sample)),
        contact_time,
    )
    number = None
    if time_number is not None:
        mass_number = estimate_equivalent_mass(rig.hammer_mass, rig.moving_mass)
        number = estimate_equivalent_stiffness(mass_number, time_number)
    return replace(
        contact,
        equivalent_stiffness=_state(stiffness, number, reasons, rig.notes),
        equivalent_stiffness_number=number,
    )


def _estimate_body(
    series: MeanReading,
    channel: int,
    mass: float,
    stiffness: Quantity,
    number: UncertainNumber | None,
) -> BodyEstimate:
    """Estimate damping of one body (0: hammer, 1: sample) from its mean trace, given stiffness.

    Parameters
    ----------
    mass : float
        Of the body [kg].
    stiffness : Quantity
        Of the body; not determined: the damping coefficient is neither.
    number : UncertainNumber or None
        The stiffness with all that it depends on; None: the uncertainty is not determined, and
        that of the damping coefficient is neither.
    """
    if channel in series.notes:
        return BodyEstimate(stiffness, notes=(series.notes[channel],), stiffness_number=number)
    peaks, rig, numbers = series.decrements[channel], series.rig, series.numbers
    ratio = estimate_damping_ratio(peaks.log_decrement)
    coefficient = (
        estimate_damping_coefficient(ratio, stiffness.value, mass) if stiffness.is_known else NAN
    )
    reason = series.reason if numbers is None else numbers.notes.get(channel, "")
    uncertain, damping = None, None
    if numbers is not None and not reason:
        uncertain = estimate_damping_ratio(numbers.log_decrements[channel])
        if number is not None:
            moving = rig.moving_mass if channel else rig.hammer_mass
            damping = estimate_damping_coefficient(uncertain, number, moving)
    reasons = (reason,) if reason else stiffness.notes
    found = _state(ratio, uncertain, reasons), _state(coefficient, damping, reasons, rig.notes)
    return BodyEstimate(
        stiffness, *found, peaks.log_decrement, peaks=peaks, stiffness_number=number
    )


def estimate_hammer(
    control: MeanHit, setup: RigSetup, form: HammerPulse | None = None
) -> HammerEstimate:
    """Estimate k1 and c1 from the control experiment: hammer and sample alike, k1 = 2 k_eq.

    For the pulse's form see `read_mean_hit`.
    """
    sample = setup.samples.control_sample
    series = read_mean_hit(control, setup, sample, form)
    contact = _estimate_contact(series, setup, sample)
    stiffness = estimate_hammer_stiffness(contact.equivalent_stiffness.value)
    number = contact.equivalent_stiffness_number
    number = None if number is None else estimate_hammer_stiffness(number)
    known = _state(stiffness, number, (f"k1: {series.reason}",), series.rig.notes)
    body = _estimate_body(series, 0, setup.hammer_mass, known, number)
    return HammerEstimate(**vars(body), control_sample=sample)


def estimate_bodies(
    mean: MeanHit,
    setup: RigSetup,
    sample: str,
    hammer: BodyEstimate,
    form: HammerPulse | None = None,
) -> tuple[ContactEstimate, BodyEstimate]:
    """Estimate the contact with `sample` and the sample itself: tau_p and k_eq, k2 and c2.

    Parameters
    ----------
    mean : MeanHit
        Of the hits on the sample.
    hammer : BodyEstimate
        Of the control experiment; k1 NaN: not known yet, and then k2 and c2 are neither. Its
        notes come first among the sample's.
    form : HammerPulse or None
        Of this mean hit, where it is known already.

    Raises
    ------
    SignalError
        If the mean trace has no whole pulse.
    """
    series = read_mean_hit(mean, setup, sample, form)
    contact = _estimate_contact(series, setup, sample)
    notes = hammer.notes
    number: UncertainNumber | None = None
    if not contact.equivalent_stiffness.is_known:
        # Whose mass is not known is all that there is to say.
        stiffness, notes = UNKNOWN, ()
    elif not hammer.stiffness.is_known:
        stiffness = Quantity(notes=("k2: not determined without k1",))
        notes += stiffness.notes
    else:
        try:
            stiffness, number = _estimate_stiffness(contact, hammer, series.rig.notes)
        except NotDeterminedError as error:
            stiffness = Quantity(notes=(str(error),))
            notes += stiffness.notes
    body = _estimate_body(series, 1, setup.samples.get_moving_mass(sample), stiffness, number)
    return contact, replace(body, notes=notes + body.notes)


def _estimate_stiffness(
    contact: ContactEstimate, hammer: BodyEstimate, notes: tuple[str, ...]
) -> tuple[Quantity, UncertainNumber | None]:
    """Return k2, with all that it depends on if its uncertainty is determined."""
    value = estimate_sample_stiffness(contact.equivalent_stiffness.value, hammer.stiffness.value)
    if contact.equivalent_stiffness_number is None:
        return Quantity(value, notes=contact.equivalent_stiffness.notes), None
    hammer_number = hammer.stiffness_number
    if hammer_number is None:
        if hammer.stiffness.notes:
            return Quantity(value, notes=hammer.stiffness.notes), None
        # Given as a plain figure, not measured here: taken as exact.
        hammer_number = make_input("stiffness of the hammer", hammer.stiffness.value, 0.0)
    number = estimate_sample_stiffness(contact.equivalent_stiffness_number, hammer_number)
    return compute_quantity(value, number, notes), number
