"""Contact time, stiffness and damping by the paper's equations."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimates.damping import LogDecrement
from impact_rig.core.estimates.equations import (
    estimate_damping_coefficient,
    estimate_damping_ratio,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.estimates.mean_reading import MeanReading
from impact_rig.core.estimates.uncertainty import (
    LEAST_HITS,
    ONE_HIT,
    Known,
    compute_quantity,
    derive,
    make_input,
    make_rig_numbers,
    make_scatter,
)
from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import (
    INTERNAL,
    LARGEST,
    NOT_NEGATIVE,
    POSITIVE,
    UNKNOWN,
    Comparable,
    Quantity,
    describe,
)
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.pulse_width import measure_rise
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.core.mean.trends import follow_series

NAN = math.nan
STIFFNESS = describe("N/m", "k", "stiffness", shown="MN/m")
EQUIVALENT_STIFFNESS = describe("N/m", "k_eq", "equivalent stiffness", shown="MN/m")
DAMPING_RATIO = describe("", "ζ", "damping ratio", least=0.0)
DECREMENT = describe("", "Δ", "log decrement", least=POSITIVE)
DAMPING_COEFFICIENT = describe("N s/m", "c", "damping coefficient")
CONTACT_TIME = describe("s", "τp", "contact time", shown="µs")
WIDTH = describe("s", "w50", "width at half amplitude", shown="µs")
BASE_WIDTH = describe("s", "w1", "time above 1 % of the peak", shown="µs")
"""Estimates that several methods have in common."""


@dataclass(frozen=True)
class BodyEstimate(Comparable):
    """Stiffness and damping of one body; NaN: not determined."""

    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)  # [N/m]
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)  # [-]
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)  # [N s/m]
    log_decrement: float = field(default=NAN, metadata=DECREMENT)  # [-]
    notes: tuple[Note, ...] = ()  # what could not be determined, and why
    # U1 and U2 in the mean trace; None: not determined.
    peaks: LogDecrement | None = field(default=None, metadata=INTERNAL)
    # The stiffness with all that it depends on, for what is calculated from it; None: it is not
    # determined, or was stated without uncertainty.
    known_stiffness: Known | None = field(
        default=None, compare=False, repr=False, metadata=INTERNAL
    )


@dataclass(frozen=True)
class HammerEstimate(BodyEstimate):
    """The hammer's k1, zeta1 and c1, from the control experiment."""

    control_sample: str = ""  # sample of the control experiment; empty: the set has none


def _find_equivalent(series: MeanReading, setup: RigSetup, sample: str) -> Known | None:
    """Return k_eq [N/m]; None: a mass is not known."""
    if setup.find_unknown_masses(sample):
        return None
    masses = Known(series.rig.hammer_mass), Known(series.rig.moving_mass)
    mass = derive(estimate_equivalent_mass, *masses)
    return derive(estimate_equivalent_stiffness, mass, series.contact_time)


def _estimate_body(series: MeanReading, channel: int, known: Known | None) -> BodyEstimate:
    """Estimate damping of one body (0: hammer, 1: sample), given its stiffness, if it is known."""
    rig = series.rig
    stiffness = UNKNOWN if known is None else known.state(rig.notes)
    if channel in series.notes:
        return BodyEstimate(stiffness, notes=(series.notes[channel],), known_stiffness=known)
    peaks, change = series.decrements[channel]
    ratio = derive(estimate_damping_ratio, change)
    coefficient = UNKNOWN
    if known is not None:
        moving = Known(rig.moving_mass if channel else rig.hammer_mass)
        coefficient = derive(estimate_damping_coefficient, ratio, known, moving).state(rig.notes)
    return BodyEstimate(
        stiffness,
        ratio.state(),
        coefficient,
        peaks.log_decrement,
        peaks=peaks,
        known_stiffness=known,
    )


def estimate_hammer(control: MeanReading, setup: RigSetup) -> HammerEstimate:
    """Estimate k1 and c1 from the control experiment: hammer and sample alike, k1 = 2 k_eq.

    The masses are known.
    """
    sample = setup.samples.control_sample
    known = _find_equivalent(control, setup, sample)
    if known is not None:
        reasons = tuple(Note(Subject.K1, str(reason)) for reason in known.reasons)
        known = replace(derive(estimate_hammer_stiffness, known), reasons=reasons)
    return HammerEstimate(**vars(_estimate_body(control, 0, known)), control_sample=sample)


def estimate_body(
    series: MeanReading, setup: RigSetup, sample: str, hammer: BodyEstimate
) -> tuple[Quantity, BodyEstimate]:
    """Estimate k_eq of the contact with `sample`, and k2 and c2 of the sample.

    As long as k1 of the hammer is NaN, k2 and c2 are not determined. Its notes come last.
    """
    equivalent, known, notes = _find_equivalent(series, setup, sample), None, hammer.notes
    if equivalent is None:
        # Whose mass is not known is all that there is to say.
        notes = ()
    elif not hammer.stiffness.is_known:
        # What is to be stated comes last.
        notes = (Note(Subject.K2, "not determined without k1"), *notes)
    else:
        # Given as a plain figure, not measured here: taken as exact.
        k1 = hammer.known_stiffness or Known(
            make_input("stiffness of the hammer", hammer.stiffness.value, 0.0),
            hammer.stiffness.notes,
        )
        try:
            known = derive(estimate_sample_stiffness, equivalent, k1)
        except NotDeterminedError as error:
            notes += (Note(Subject.K2, str(error)),)
    body = _estimate_body(series, 1, known)
    stated = UNKNOWN if equivalent is None else equivalent.state(series.rig.notes)
    return stated, replace(body, notes=body.notes + notes)


OF_ONE_HIT = Note(
    Subject.UNCERTAINTY, "that of the one hit; what scatters from hit to hit is not in it"
)

LOG_DECREMENT, FREE_DECAY = "log decrement", "free decay"
"""Methods that a sample's damping is by."""

PEAK = describe("m/s^2", shown="m/s²")
TIME = describe("s", shown="µs")
MOMENT = describe("s", shown="µs", least=-LARGEST)
SPREAD = describe("s", shown="µs", least=0.0)


@dataclass(frozen=True)
class PaperEstimate(Comparable):
    """tau_p, k2, c2 and readings of the mean traces; NaN: not determined."""

    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)  # of the mean trace
    contact_time_spread: float = field(default=NAN, metadata=SPREAD)  # standard deviation of hits
    half_amplitude_width: Quantity = field(default=UNKNOWN, metadata=WIDTH)
    base_width: Quantity = field(default=UNKNOWN, metadata=BASE_WIDTH)
    width_ratio: float = field(default=NAN, metadata=describe(least=POSITIVE))  # w10 / w50
    equivalent_stiffness: Quantity = field(default=UNKNOWN, metadata=EQUIVALENT_STIFFNESS)
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)  # k2
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    damping_method: str = ""  # that damping ratio and coefficient are by; empty: not determined
    log_decrement: float = field(default=NAN, metadata=DECREMENT)
    first_peak: float = field(default=NAN, metadata=PEAK)  # U1
    first_peak_time: float = field(default=NAN, metadata=MOMENT)  # from the middle of the pulse
    second_peak: float = field(default=NAN, metadata=PEAK)  # U2
    second_peak_time: float = field(default=NAN, metadata=MOMENT)
    hammer_peak: float = field(default=NAN, metadata=PEAK)  # of the mean traces
    specimen_peak: float = field(default=NAN, metadata=PEAK)
    # Standard deviation of the hits over their mean.
    hammer_peak_spread_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    peak_force: Quantity = field(default=UNKNOWN, metadata=describe("N", "Fmax", "peak force"))
    rise_time: float = field(default=NAN, metadata=describe("s"))  # 10 % to 90 % of the peak
    warnings: tuple[Note, ...] = field(default=(), metadata=INTERNAL)
    notes: tuple[Note, ...] = field(default=(), metadata=INTERNAL)  # what is not determined: why

    def without_damping(self) -> "PaperEstimate":
        """Return it without what comes from the log decrement."""
        return replace(
            self,
            damping_ratio=UNKNOWN,
            damping_coefficient=UNKNOWN,
            damping_method="",
            log_decrement=NAN,
        )


NO_NUMBERS = PaperEstimate()
"""Estimate of a sample without an accepted hit."""


def estimate_paper(
    name: str,
    series: MeanReading,
    contact_time_spread: float,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> PaperEstimate:
    """Estimate tau_p, k2 and c2 of one sample by equations (5) and (6b).

    The standard deviation of tau_p over the accepted hits [s] is NaN of one hit. As long as k1 of
    the hammer is NaN, k2 and c2 are not determined.
    """
    mean, contact_time = series.mean, series.contact_time.state()
    equivalent, body = estimate_body(series, setup, name, hammer)
    peaks, tops = body.peaks, np.abs(mean.traces).max(axis=1).tolist()
    # What is said of c is said of ζ or k.
    noted = (contact_time, equivalent, body.stiffness, body.damping_ratio)
    one_hit = () if len(mean.hits) >= LEAST_HITS else (OF_ONE_HIT,)
    spread, heights = NAN, [hit.pulse.peak for hit in mean.hits]
    if len(heights) > 1:
        spread = 100.0 * float(np.std(heights, ddof=1) / abs(np.mean(heights)))
    notes = body.notes + one_hit + tuple(note for item in noted for note in item.notes)
    return PaperEstimate(
        contact_time=contact_time,
        contact_time_spread=contact_time_spread,
        # Their budgets are part of that of tau_p.
        half_amplitude_width=replace(series.width.state(), budget=()),
        base_width=replace(series.base_width.state(), budget=()) if series.base_width else UNKNOWN,
        width_ratio=series.width_ratio,
        # Its budget is that of tau_p and the masses: it is not told again.
        equivalent_stiffness=replace(equivalent, budget=()),
        stiffness=body.stiffness,
        damping_ratio=body.damping_ratio,
        damping_coefficient=body.damping_coefficient,
        damping_method=LOG_DECREMENT if body.damping_ratio.is_known else "",
        log_decrement=body.log_decrement,
        first_peak=peaks.first_peak if peaks else NAN,
        first_peak_time=_find_time(mean, peaks.first_index) if peaks else NAN,
        second_peak=peaks.second_peak if peaks else NAN,
        second_peak_time=_find_time(mean, peaks.second_index) if peaks else NAN,
        hammer_peak=tops[0],
        specimen_peak=tops[1] if len(tops) > 1 else NAN,
        hammer_peak_spread_percent=spread,
        peak_force=_estimate_peak_force(name, mean, setup),
        rise_time=measure_rise(mean.traces[0]) / mean.sampling_rate,
        warnings=tuple(filter(None, (check_steps(mean), check_control(setup)))),
        notes=tuple(dict.fromkeys(notes)),
    )


def _estimate_peak_force(name: str, mean: MeanHit, setup: RigSetup) -> Quantity:
    peak = float(np.abs(mean.traces[0]).max())
    if len(mean.hits) < LEAST_HITS:
        return Quantity(setup.hammer_load * peak, notes=(ONE_HIT,))
    peaks = [hit.pulse.peak for hit in mean.hits]
    number = make_scatter(f"scatter of the peaks on {name}", peak, peaks, mean.count)
    rig = make_rig_numbers(setup, name).follow(follow_series(mean))
    force = rig.load * rig.gains[0] * number
    return compute_quantity(setup.hammer_load * peak, force)


def _find_time(mean: MeanHit, index: int) -> float:
    return (index - mean.origin) / mean.sampling_rate


STEPS = Note(
    Subject.CONVERTER,
    "the noise is smaller than the converter's steps and does not average them out: the"
    " uncertainty of the free decay leaves that out; amplify the signals, or use more bits",
)


def check_steps(mean: MeanHit) -> Note | None:
    """Warn unless the noise dithers the converter."""
    step, noise = mean.largest_step, mean.least_noise
    # Of so much noise exp(-2 pi^2 0.4^2), 4 %, of the steps is left.
    return STEPS if np.any((step > 0.0) & (noise < 0.4 * step)) else None


def check_control(setup: RigSetup) -> Note | None:
    """Warn unless control sample and hammer are alike."""
    control = setup.samples.control_sample
    if not control or setup.find_unknown_masses(control):
        return None
    mass, hammer = setup.samples.get_moving_mass(control), setup.hammer_mass
    # The published control sample differs by 5 %.
    if abs(mass - hammer) <= 0.2 * hammer:
        return None
    return Note(
        Subject.CONTROL_SAMPLE,
        f"the control sample {control!r} of {mass * 1e3:.4g} g is not alike to the hammer of"
        f" {hammer * 1e3:.4g} g, as k1 = 2 k_eq assumes: k1, and with it every k2 and c2, may be"
        " wrong",
    )
