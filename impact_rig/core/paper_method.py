"""Contact time, stiffness and damping by the paper's procedure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.contact_law import NO_LAW, ContactLaw, look_at_law
from impact_rig.core.damping import LogDecrement, estimate_log_decrement
from impact_rig.core.equations import (
    estimate_damping_coefficient,
    estimate_damping_ratio,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
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
from impact_rig.core.pulse_width import compute_quantisation_error, measure_pulse
from impact_rig.core.pulses import PULSE_SHAPES
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.setup import RigSetup
from impact_rig.core.uncertainty import (
    Known,
    RigNumbers,
    estimate_contact_numbers,
    make_input,
    make_rig_numbers,
)

DAMPING_NAMES = ("c1", "c2")
"""Of hammer and sample, for what is said about them."""


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


@dataclass(frozen=True)
class MeanReading:
    """A mean hit, read once; its numbers are uncertain, and of one and the same hits."""

    width: float  # w50 [s]
    width_ratio: float
    rig: RigNumbers
    contact_time: Known  # tau_p [s]
    decrements: Mapping[int, tuple[LogDecrement, Known]]  # by channel, where determined
    notes: Mapping[int, str]  # by channel, where not: why


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
    peaks: dict[int, LogDecrement] = {}
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
            found = estimate_log_decrement(
                mean.traces[channel], max(float(mean.noise[channel]), step)
            )
            _check_own_decay(mean, channel, found)
            peaks[channel] = found
        except RigError as error:
            notes[channel] = f"{DAMPING_NAMES[channel]}: {error}"
    width = pulse.half_amplitude_width / mean.sampling_rate
    noise = float(mean.noise[0]) / abs(pulse.peak)
    form = form or look_at_pulse(mean, setup, sample)
    contact_time, changes = estimate_contact_numbers(
        mean,
        pulse,
        peaks,
        setup,
        sample,
        compute_shape_error(form, noise, width, setup.analysis.pulse_factor * width),
        reason="the pulse's shape, and with it the uncertainty, comes later"
        if form is UNSEEN
        else "",
    )
    return MeanReading(
        width,
        pulse.width_ratio,
        make_rig_numbers(setup, sample),
        contact_time,
        {channel: (peaks[channel], change) for channel, change in changes.items()},
        notes,
    )


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
    # Noise makes a quarter of the least peak.
    if abs(ours[second] - shared) < 0.5 * peaks.second_peak:
        raise NotDeterminedError(
            "no log decrement, since the second peak is no decay of the body: the force on both"
            " bodies has it, as at the end of a contact or by a second one"
        )
    swing = -float(np.min(ours[first:second] * np.sign(ours[first])))
    # The swing is 1 for a free decay; a sensor that rings with 5 % of the pulse makes a quarter.
    if channel and swing < 0.5 * math.sqrt(peaks.first_peak * peaks.second_peak):
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
    known_stiffness : Known or None
        The stiffness with all that it depends on, for what is calculated from it; None: it is
        not determined, or was stated without uncertainty.
    """

    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    log_decrement: float = field(default=NAN, metadata=describe("", "Δ", "log decrement"))
    notes: tuple[str, ...] = ()
    peaks: LogDecrement | None = field(default=None, metadata=INTERNAL)
    known_stiffness: Known | None = field(
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
    known_stiffness : Known or None
        k_eq with all that it depends on; None: its uncertainty is not determined.
    """

    half_amplitude_width: float = NAN
    width_ratio: float = NAN
    contact_time: Quantity = UNKNOWN
    equivalent_stiffness: Quantity = UNKNOWN
    known_stiffness: Known | None = field(default=None, compare=False, repr=False)


def _estimate_contact(series: MeanReading, setup: RigSetup, sample: str) -> ContactEstimate:
    contact = ContactEstimate(
        half_amplitude_width=series.width,
        width_ratio=series.width_ratio,
        contact_time=series.contact_time.state(),
    )
    if setup.find_unknown_masses(sample):
        return contact
    mass = estimate_equivalent_mass(series.rig.hammer_mass, series.rig.moving_mass)
    known = replace(
        series.contact_time,
        number=estimate_equivalent_stiffness(mass, series.contact_time.number),
    )
    return replace(
        contact, equivalent_stiffness=known.state(series.rig.notes), known_stiffness=known
    )


def _estimate_body(series: MeanReading, channel: int, known: Known | None) -> BodyEstimate:
    """Estimate damping of one body (0: hammer, 1: sample), given its stiffness, if it is known."""
    rig = series.rig
    stiffness = UNKNOWN if known is None else known.state(rig.notes)
    if channel in series.notes:
        return BodyEstimate(stiffness, notes=(series.notes[channel],), known_stiffness=known)
    peaks, change = series.decrements[channel]
    ratio = replace(change, number=estimate_damping_ratio(change.number))
    coefficient = UNKNOWN
    if known is not None:
        moving = rig.moving_mass if channel else rig.hammer_mass
        coefficient = Known(
            estimate_damping_coefficient(ratio.number, known.number, moving),
            ratio.reasons or known.reasons,
        ).state(rig.notes)
    return BodyEstimate(
        stiffness,
        ratio.state(),
        coefficient,
        peaks.log_decrement,
        peaks=peaks,
        known_stiffness=known,
    )


def estimate_hammer(
    control: MeanHit, setup: RigSetup, form: HammerPulse | None = None
) -> HammerEstimate:
    """Estimate k1 and c1 from the control experiment: hammer and sample alike, k1 = 2 k_eq.

    For the pulse's form see `read_mean_hit`. The masses are known.
    """
    sample = setup.samples.control_sample
    series = read_mean_hit(control, setup, sample, form)
    known = _estimate_contact(series, setup, sample).known_stiffness
    if known is not None:
        reasons = tuple(f"k1: {reason}" for reason in known.reasons)
        known = Known(estimate_hammer_stiffness(known.number), reasons)
    return HammerEstimate(**vars(_estimate_body(series, 0, known)), control_sample=sample)


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
    equivalent, known, notes = contact.known_stiffness, None, hammer.notes
    if equivalent is None:
        # Whose mass is not known is all that there is to say.
        notes = ()
    elif not hammer.stiffness.is_known:
        notes += ("k2: not determined without k1",)
    else:
        # Given as a plain figure, not measured here: taken as exact.
        k1 = hammer.known_stiffness or Known(
            make_input("stiffness of the hammer", hammer.stiffness.value, 0.0),
            hammer.stiffness.notes,
        )
        try:
            known = Known(
                estimate_sample_stiffness(equivalent.number, k1.number),
                equivalent.reasons or k1.reasons,
            )
        except NotDeterminedError as error:
            notes += (str(error),)
    body = _estimate_body(series, 1, known)
    return contact, replace(body, notes=notes + body.notes)
