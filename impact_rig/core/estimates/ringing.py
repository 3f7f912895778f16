"""Free decay in a sample's tail, whether it is the sample's, and the damping by it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimates.damping import (
    SMALLEST_R_SQUARED,
    FreeDecay,
    estimate_free_decay,
    find_settled_velocity,
)
from impact_rig.core.estimates.paper_method import (
    DAMPING_COEFFICIENT,
    FREE_DECAY,
    NAN,
    STIFFNESS,
    PaperEstimate,
)
from impact_rig.core.estimates.uncertainty import make_rig_numbers, propagate_decay
from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import (
    INTERNAL,
    NOT_NEGATIVE,
    PART,
    POSITIVE,
    UNKNOWN,
    BudgetLine,
    Comparable,
    Quantity,
    describe,
)
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.momenta import Hold
from impact_rig.core.mean.mean_hit import MeanHit, follow_mean

SAME_FREQUENCY = 0.05
"""Difference of two frequencies that are one [-]: a mount's moves so far."""
FEWEST_SAMPLES = 3
"""That ring at one frequency [-]; two samples may well have the same k/m."""


def explain_ringing(frequency: float, setup: RigSetup) -> str | None:
    """Return why what rings at a frequency [Hz] is the sensor's and no body's; None: it may be."""
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
    """A sample's estimates from its decay after the contact; NaN: not determined."""

    # m2 times the natural angular frequency squared
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(
        default=UNKNOWN, metadata=describe("", "ζ", "damping ratio", least=POSITIVE)
    )
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    frequency: float = field(default=NAN, metadata=describe("Hz", "f", "frequency", shown="kHz"))
    # that stand out of the noise
    periods: float = field(default=NAN, metadata=NOT_NEGATIVE)
    r_squared: float = field(default=NAN, metadata=PART)
    # RMS; 1: nothing but noise
    residual_over_noise: float = field(default=NAN, metadata=NOT_NEGATIVE)
    hold: str = ""  # what holds what rings, of `Hold`: only what is on a spring has k and c
    notes: tuple[Note, ...] = field(default=(), metadata=INTERNAL)
    warnings: tuple[Note, ...] = field(default=(), metadata=INTERNAL)

    @property
    def is_known(self) -> bool:
        """Whether it is determined."""
        return self.damping_ratio.is_known

    @property
    def has_many_modes(self) -> bool:
        """Whether one damped oscillation does not explain the tail."""
        return self.r_squared < SMALLEST_R_SQUARED and not self.is_known


NO_DECAY = FreeDecayEstimate()
"""Where it is not determined."""


def estimate_decay(
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
        raise NotDeterminedError(ringing)
    if decay.has_many_modes:
        note = (
            f"one damped oscillation explains only {100.0 * decay.r_squared:.0f} % of the"
            f" tail; it must explain {100.0 * SMALLEST_R_SQUARED:.0f} %"
        )
        return FreeDecayEstimate(
            r_squared=decay.r_squared,
            residual_over_noise=decay.residual_over_noise,
            notes=(Note(Subject.FREE_DECAY, note),),
        )
    hold, persistence = _find_hold(mean, setup, decay)
    body = propagate_decay(
        f"scatter of the hits on {sample}",
        decay.hit_values,
        make_rig_numbers(setup, sample),
        estimates=(decay.decay_rate, decay.angular_frequency),
        averaged=mean.count,
        errors=_list_errors(decay),
    )
    if hold in {Hold.FREE, Hold.UNCLEAR}:
        body = {"damping_ratio": body["damping_ratio"]}
    return FreeDecayEstimate(
        **body,
        hold=hold.value,
        notes=_explain_hold(hold, persistence, decay.frequency),
        warnings=_explain_halves(decay),
        frequency=decay.frequency,
        periods=decay.periods,
        r_squared=decay.r_squared,
        residual_over_noise=decay.residual_over_noise,
    )


def _list_errors(decay: FreeDecay) -> list[tuple[str, FloatArray]]:
    """Return the errors of a and omega that all hits share."""
    errors = [("what the free decay leaves", decay.covariance)]
    if decay.halves:
        natural = math.hypot(decay.decay_rate, decay.angular_frequency)
        ratio = decay.decay_rate / natural
        # Half a decay tells ζ in its middle: at its end it is twice as far away.
        reach = 2.0 * max(abs(half - ratio) for half in decay.halves)
        variance = (reach * natural) ** 2 / 3.0
        errors.append(("damping that depends on the amplitude", np.diag([variance, 0.0])))
    return errors


def _explain_halves(decay: FreeDecay) -> tuple[Note, ...]:
    """Warn of damping that is not the same in both halves of a decay."""
    if not decay.halves:
        return ()
    first, second = decay.halves
    kind = "rises as the motion dies, as by dry friction"
    if second < first:
        kind = "falls as the motion dies, as by air"
    told = (
        f"damping depends on the amplitude: ζ {kind}, from {first:.2g} in the first"
        f" half of the decay to {second:.2g} in the second; the ± holds both"
    )
    return (Note(Subject.FREE_DECAY, told),)


def _find_hold(mean: MeanHit, setup: RigSetup, decay: FreeDecay) -> tuple[Hold, float]:
    """Return what holds what rings, and about which part of J / m2 it does.

    A body on a spring to the ground comes to rest; a sensor's mount and an inner mode ring about
    the velocity at which the body moves on.
    """
    rate = mean.sampling_rate
    found = follow_mean(mean, setup.find_chains(rate))
    if found is None:
        return Hold.UNKNOWN, NAN
    restored, _, passage = found
    point = decay.tail.step / rate
    ringing = point * np.array([decay.decay_rate, decay.angular_frequency])
    settled = find_settled_velocity(restored.traces[1], decay.tail, ringing, rate)
    passage = replace(passage, settled=settled)
    return passage.hold, passage.persistence


def _explain_hold(hold: Hold, persistence: float, frequency: float) -> tuple[Note, ...]:
    if hold not in {Hold.FREE, Hold.UNCLEAR}:
        return ()
    velocity = "the velocity at which the sample moves on, as a mount or an inner mode does"
    if hold is Hold.UNCLEAR:
        velocity = (
            f"{persistence:.2f} of the velocity of a free sample, neither 0 as on a spring nor 1"
        )
    told = f"what rings at {frequency * 1e-3:.4g} kHz does so about {velocity}: it has a frequency"
    return (Note(Subject.FREE_DECAY, f"{told} and ζ, but no k and no c"),)


def find_shared_ringing(decays: Mapping[str, FreeDecayEstimate], setup: RigSetup) -> float | None:
    """Return the frequency [Hz] at which all samples that ring do so, though they differ in mass.

    It is a sensor's or its mount's. None: there is none.
    """
    rings = {name: decay.frequency for name, decay in decays.items() if decay.is_known}
    masses = [setup.samples.get_moving_mass(name) for name in rings]
    if len(rings) < FEWEST_SAMPLES or not max(masses) >= 1.5 * min(masses):
        return None
    shared = float(np.median(list(rings.values())))
    farthest = max(abs(each - shared) for each in rings.values())
    return shared if farthest < SAME_FREQUENCY * shared else None


BY_FREE_DECAY = "what the free decay says"
"""Line of a budget."""
ONE_PERIOD = 0.25
"""Difference from a period of the decay at which U1 and U2 are one apart [-], our choice: the
contact that still drives the body at U1 makes up to 0.12."""


def reach(found: Quantity, other: Quantity, source: str) -> Quantity:
    """Return a value whose interval reaches what another method says, if both contradict.

    The value stays. The truth lies anywhere between both: half of a rectangle's width over the
    root of 3, which is a line of the budget called `source`. The ± of both must be known.
    """
    apart = other.value - found.value
    reaches = found.compute_half_width(other.value) + other.compute_half_width(found.value)
    if not abs(apart) > reaches:
        return found
    part = abs(apart) / math.sqrt(3.0)
    variance = found.standard**2 + part**2
    kept = found.standard**2 / variance
    lines = [replace(line, share=line.share * kept) for line in found.budget]
    lines.append(BudgetLine(source, "B", part, 1.0 - kept))
    lower, upper = min(found.lower, other.lower), max(found.upper, other.upper)
    return replace(
        found,
        standard=math.sqrt(variance),
        expanded=max(found.value - lower, upper - found.value),
        lower=lower,
        upper=upper,
        degrees_of_freedom=found.degrees_of_freedom / kept**2 if kept else math.inf,
        budget=tuple(sorted(lines, key=lambda line: -line.share)),
    )


def settle_damping(paper: PaperEstimate, decay: FreeDecayEstimate) -> PaperEstimate:
    """Return the paper's estimate with the damping that both methods together tell.

    The log decrement's value stays where one damped oscillation makes the tail, and reaches the
    free decay's. Where c is determined by the free decay alone, it leads.
    """
    if paper.damping_ratio.is_known and (reason := _find_objection(paper, decay)) is not None:
        note = Note(Subject.C2, f"no log decrement, since {reason}")
        paper = replace(paper.without_damping(), notes=(*paper.notes, note))
    if paper.damping_ratio.is_known and decay.damping_ratio.is_known:
        ratio = reach(paper.damping_ratio, decay.damping_ratio, BY_FREE_DECAY)
        paper = replace(paper, damping_ratio=ratio)
    if not decay.damping_coefficient.is_known:
        return paper
    if not paper.damping_coefficient.is_known:
        return replace(
            paper,
            damping_ratio=decay.damping_ratio,
            damping_coefficient=decay.damping_coefficient,
            damping_method=FREE_DECAY,
        )
    return replace(
        paper,
        damping_coefficient=reach(
            paper.damping_coefficient, decay.damping_coefficient, BY_FREE_DECAY
        ),
    )


def _find_objection(paper: PaperEstimate, decay: FreeDecayEstimate) -> str | None:
    """Return why equation (7b) does not hold of U1 and U2; None: it does, or nothing tells."""
    if decay.has_many_modes:
        return (
            f"one damped oscillation explains only {100.0 * decay.r_squared:.0f} % of the tail: U1"
            " and U2 are of several"
        )
    periods = (paper.second_peak_time - paper.first_peak_time) * decay.frequency
    if abs(periods - 1.0) > ONE_PERIOD:
        return f"U1 and U2 lie {periods:.2g} periods of the free decay apart, not one"
    return None
