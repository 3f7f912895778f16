"""Every reason against a hit, named."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.constants import g

from impact_rig.core.hits.clipping import find_dropout, find_longest_rail_run
from impact_rig.core.hits.pulse_width import PulseWidth
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.second_pulse import Kind, find_second_pulse
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import FloatArray, Record, Trace

DEAD_LEVEL = 0.005
"""Largest deviation of a channel that shows nothing, part of full scale [-], our choice: half of
the smallest signal worth a range."""
DEAD_NOISE = 6.0
"""The same in standard deviations of the channel's own pre-trigger noise [-], our choice: one
record of 100 000 has such a point by chance."""
QUIET_PART = 0.05
"""Part of a record in which its noise is looked for [-], our choice: half the default pre-trigger,
since a weak pulse has long begun when it reaches the detection level."""
HIGHEST_WANDER = 0.05
"""Height of a bump in a wandering zero that a hit may have, over the peak [-], our choice: it
changes tau_p by some 3 %."""
TAIL_CONTACTS = 1.0
"""What must follow the pulse, in its half-amplitude widths [-], our choice."""
CHANNELS = ("hammer", "sample")
"""For people; the first tells how strong a hit was."""
BASELINE_POINTS = 3
"""What must come before the pulse, in points, for a baseline."""


def check_stream(record: Record) -> tuple[Rejection, ...]:
    """Find what is wrong with a record before anyone looks for a pulse in it."""
    if not record.triggered:
        return (Rejection(Reason.NO_TRIGGER, "the arming ended without a trigger"),)
    found = [Rejection(Reason.GAP, flaw) for flaw in record.flaws]
    if record.hammer.acceleration.size == 0:
        return (*found, Rejection(Reason.NO_PULSE, "the record is empty"))
    for name, trace in _name_channels(record):
        if not all(map(math.isfinite, trace.extremes)):
            bad = int(np.count_nonzero(~np.isfinite(trace.acceleration)))
            found.append(
                Rejection(Reason.NON_FINITE, f"{bad} points of the {name} trace are no numbers")
            )
    return tuple(found)


def check_channels(record: Record, settings: AnalysisSettings) -> tuple[Rejection, ...]:
    """Find dead and overloaded channels of a finite record, and points that cannot be."""
    channels = _name_channels(record)
    quiet = int(QUIET_PART * record.hammer.acceleration.size)
    if record.pulse_index is not None:
        quiet = min(quiet, record.pulse_index)
    quiet = max(quiet, 1)
    dead = [name for name, trace in channels if _is_dead(trace, quiet)]
    found = []
    if dead and len(dead) < len(channels):
        found.append(Rejection(Reason.DEAD_CHANNEL, f"the {dead[0]} channel shows no signal"))
    elif record.pulse_index is None:
        found.append(Rejection(Reason.NO_PULSE, "the hammer trace never leaves its baseline"))
    for name, trace in channels:
        run = find_longest_rail_run(trace, quiet)
        if run >= settings.overload_run:
            rail = float(np.max(np.abs(trace.acceleration)))
            found.append(
                Rejection(
                    Reason.OVERLOAD,
                    f"{run} points in a row of the {name} at the rail of {rail:.4g} m/s^2"
                    f" ({rail / g:.4g} g)",
                )
            )
        elif trace.overloaded:
            found.append(
                Rejection(Reason.OVERLOAD, f"the device says that the {name} channel overloaded")
            )
        dropout = find_dropout(trace, quiet)
        if dropout is not None:
            place, off = dropout[0] / record.sampling_rate, dropout[1]
            found.append(
                Rejection(
                    Reason.DROPOUT,
                    f"a single point of the {name}, {place * 1e6:.0f} µs into the record, is"
                    f" {abs(off):.4g} m/s^2 off its neighbours",
                )
            )
    return tuple(found)


def check_strength(
    record: Record, peaks: Sequence[float], settings: AnalysisSettings, *, overloaded: bool
) -> tuple[Rejection, ...]:
    """Find whether a hit is too weak or too strong for the ranges of its channels.

    Parameters
    ----------
    peaks : sequence of float
        Largest |acceleration| after the low-pass of hammer, then sample where measured [m/s^2].
    settings : AnalysisSettings
        `minimum_peak` and `maximum_peak` are used; where full scale is not known, nothing is
        weak or strong.
    overloaded : bool
        A channel stood at its rail: then the peak is not known, and the overload says so.
    """
    found = []
    for (name, trace), peak in zip(_name_channels(record), peaks, strict=True):
        least, most = (
            part * trace.full_scale for part in (settings.minimum_peak, settings.maximum_peak)
        )
        if name == CHANNELS[0] and peak < least:
            found.append(
                Rejection(Reason.WEAK, f"{name} peak {peak:.4g} m/s^2 is below {least:.4g} m/s^2")
            )
        if trace.full_scale > 0.0 and peak > most and not overloaded:
            found.append(
                Rejection(Reason.STRONG, f"{name} peak {peak:.4g} m/s^2 is above {most:.4g} m/s^2")
            )
    return tuple(found)


def check_pulse(
    hammer: FloatArray,
    pulse: PulseWidth,
    noise: float,
    sampling_rate: float,
    settings: AnalysisSettings,
) -> tuple[tuple[Rejection, ...], tuple[Rejection, ...]]:
    """Find what is wrong with the course of a pulse that could be measured.

    Parameters
    ----------
    hammer : ndarray, shape (n,)
        Filtered hammer trace, baseline zero [m/s^2].
    noise : float
        Standard deviation of the trace [m/s^2].
    sampling_rate : float
        [Hz]
    settings : AnalysisSettings
        `double_hit_level` and `double_hit_window` are used.

    Returns
    -------
    tuple of tuple of Rejection
        What is against the hit, and what looks like it but cannot be told from what is harmless.
    """
    against, doubtful = [], []
    if pulse.fall + TAIL_CONTACTS * pulse.half_amplitude_width > hammer.size - 1:
        against.append(Rejection(Reason.TRUNCATED, "the record ends too soon after the pulse"))
    level, window = settings.double_hit_level, settings.double_hit_window
    second = find_second_pulse(hammer, pulse, level, noise, window * sampling_rate or math.inf)
    if second is not None:
        height = f"{float(f'{second.height * 100:.2g}'):g} % of the largest"
        place = (
            f"{'follows after' if second.delay > 0 else 'precedes it by'}"
            f" {abs(second.delay) / sampling_rate * 1e6:.0f} µs"
        )
        counts = f"from {level * 100:g} % on"
        counts += f" within {window * 1e6:g} µs one counts" if window else " one counts"
        if second.kind is Kind.CONTACT:
            text = f"a second pulse of {height} {place}; {counts}"
            against.append(Rejection(Reason.DOUBLE_HIT, text))
        elif second.kind is Kind.RINGING:
            text = f"a bump of {height} {place}: ringing, or a second contact in it"
            doubtful.append(Rejection(Reason.RINGING, text))
        else:
            text = (
                f"a bump of {height} {place}, as the zero wanders: noise of a cable, strain of the"
                " sensor's base"
            )
            target = against if second.height >= max(HIGHEST_WANDER, level) else doubtful
            target.append(Rejection(Reason.UNSTEADY_ZERO, text))
    return tuple(against), tuple(doubtful)


def _is_dead(trace: Trace, quiet_count: int) -> bool:
    values, quiet = trace.acceleration, trace.acceleration[:quiet_count]
    level = DEAD_LEVEL * trace.full_scale
    # No deviation is less than half the range of all, no standard deviation more than half the
    # range of the quiet part: a good hit is told from a dead channel by these alone.
    low, high = trace.extremes
    if high - low > max(2.0 * level, DEAD_NOISE * (float(quiet.max()) - float(quiet.min()))):
        return False
    largest = float(np.max(np.abs(values - np.median(quiet))))
    return largest <= max(level, DEAD_NOISE * float(np.std(quiet)))


def _name_channels(record: Record) -> list[tuple[str, Trace]]:
    traces = (record.hammer, record.specimen)
    return [(n, trace) for n, trace in zip(CHANNELS, traces, strict=True) if trace is not None]
