"""One sample's estimates by the paper's method, and what is read from its mean traces."""

from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.estimates.paper_method import (
    BASE_WIDTH,
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    EQUIVALENT_STIFFNESS,
    NAN,
    STIFFNESS,
    WIDTH,
    BodyEstimate,
    MeanReading,
    estimate_body,
)
from impact_rig.core.estimates.uncertainty import (
    LEAST_HITS,
    ONE_HIT,
    compute_quantity,
    make_rig_numbers,
    make_scatter,
)
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
    log_decrement: float = NAN
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
    noted = (
        contact_time,
        equivalent,
        body.stiffness,
        body.damping_ratio,
        body.damping_coefficient,
    )
    one_hit = () if len(mean.hits) >= LEAST_HITS else (OF_ONE_HIT,)
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
        hammer_peak_spread_percent=_compute_peak_spread(mean),
        peak_force=_estimate_peak_force(name, mean, setup),
        rise_time=measure_rise(mean.traces[0]) / mean.sampling_rate,
        warnings=tuple(filter(None, (check_steps(mean), check_control(setup)))),
        notes=tuple(dict.fromkeys(notes)),
    )


def _compute_peak_spread(mean: MeanHit) -> float:
    peaks = [hit.pulse.peak for hit in mean.hits]
    return 100.0 * float(np.std(peaks, ddof=1) / abs(np.mean(peaks))) if len(peaks) > 1 else NAN


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
