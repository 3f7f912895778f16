"""Impacts found in a stream of blocks, and cut out with pre-trigger.

A pulse begins where the hammer's raw output leaves its baseline. A stream may have gaps: what one
cuts off is still handed out, with the gap named, so that no hit is lost unseen.
"""

import math
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import Block, ChannelBlock, FloatArray, RawArray, Record, Trace
from impact_rig.core.signals.segment import Continuity, Gap, Segment

RELATIVE_LEVEL = 0.1
"""Where full scale is unknown, the part of the largest deviation that starts a pulse [-], our
choice: a hit recorded as a whole always has one."""
PULSE_NOISE = 6.0
"""Least height of a pulse, in standard deviations of the noise [-], our choice: noise alone
reaches it in one record of 100 000."""
QUIET_END, LEAST_END = 0.05, 8
"""Part of a record, and points at least, that tell its baseline and noise, our choice: half the
default pre-trigger."""
LOUD_BEGINNING = 2.0
"""Noise of a record's beginning over that of its end from which a pulse is there [-], our choice:
of 125 points each, noise alone differs by less."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""


class PulseSearch:
    """Finds the next pulse in a segment of the stream.

    Baseline and level are numbers of the raw output, and whole blocks are held against them by
    their largest and smallest count: nothing is converted where there is no pulse.

    Parameters
    ----------
    settings : AnalysisSettings
        `detection_level` is used.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._noise = 0.0

    def learn(self, quiet: RawArray) -> float:
        """Take the noise from what holds no pulse, and return its baseline."""
        baseline, self._noise = compute_baseline(quiet)
        return baseline

    def find(self, segment: Segment, baseline: float, last: int) -> int | None:
        """Find the first pulse that is not searched yet, up to the point `last`.

        Parameters
        ----------
        segment : Segment
            Searched from its `searched` on, which is not changed.
        baseline : float
            Of the hammer's raw output.
        last : int
            Behind the last point to be looked at.

        Returns
        -------
        int or None
            The first point at or above the level; None: there is none.
        """
        channel = segment.block.hammer
        if channel.full_scale > 0.0:
            level = self._settings.detection_level * abs(channel.full_scale / channel.scale)
        else:
            # Without a full scale the level is a part of the largest pulse: of the whole segment.
            deviation = np.abs(segment.read(segment.start, last)[0] - baseline)
            # A constant trace has no pulse, and no noise to stand out of.
            level = RELATIVE_LEVEL * float(deviation.max()) or math.inf
        level = max(level, PULSE_NOISE * self._noise, channel.resolution / abs(channel.scale))
        for start, output in segment.read_hammer(segment.searched, last):
            index = _find_departure(output, baseline, level)
            if index is not None:
                return start + index
        return None


def count_window_points(settings: AnalysisSettings, sampling_rate: float) -> tuple[int, int]:
    """Return pre-trigger and length of a hit's window [points] at a rate [Hz]."""
    before, length = settings.pre_trigger * sampling_rate, settings.record_duration * sampling_rate
    return max(round(before), 1), max(round(length), 1)


def to_acceleration(channel: ChannelBlock, output: RawArray) -> FloatArray:
    """Return raw output of a channel as acceleration [m/s^2], read-only."""
    acceleration: FloatArray = np.multiply(channel.scale, output, dtype=np.float64)
    acceleration += channel.offset
    acceleration.setflags(write=False)
    return acceleration


def compute_median(values: NDArray[Any]) -> float:
    """Return what `numpy.median` does, of short arrays in a third of its time.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of at least one number.
    """
    low, high = (values.size - 1) // 2, values.size // 2
    ordered = np.partition(values, (low, high, values.size - 1))
    largest = float(ordered[-1])
    # Numbers that are none lie at the end, and leave no median.
    return largest if math.isnan(largest) else (float(ordered[low]) + float(ordered[high])) / 2


def find_quietest(output: RawArray, count: int) -> RawArray:
    """Return that part of `count` points in which least happens; all, if there are no more.

    Parameters
    ----------
    output : ndarray, shape (n,)
        Cut into parts from its beginning on; what is left over at its end is left out.
    count : int
        Points of a part.
    """
    parts = output.size // count
    if not parts:
        return output
    split = output[: parts * count].reshape(parts, count)
    # Counts of 32 bits may lie further apart than 32 bits hold.
    span = np.subtract(split.max(axis=1), split.min(axis=1), dtype=np.float64)
    # Where numbers are none, much happens.
    quietest: RawArray = split[int(np.nan_to_num(span, nan=np.inf).argmin())]
    return quietest


def find_quiet_end(output: RawArray) -> RawArray:
    """Return what tells baseline and noise of a record: its beginning, or its end.

    Before the impact nothing happens, unless the pulse begins at once; then what follows is
    quieter. How long the pulse lasts and rings does not matter.
    """
    count = max(int(QUIET_END * output.size), LEAST_END)
    first, last = output[:count], output[-count:]
    noises = [compute_baseline(end)[1] for end in (first, last)]
    return last if noises[0] > LOUD_BEGINNING * noises[1] else first


def compute_baseline(quiet: RawArray) -> tuple[float, float]:
    """Return median, and standard deviation by the median absolute deviation."""
    baseline = compute_median(quiet)
    return baseline, SPREAD_OF_MEDIAN * compute_median(np.abs(quiet - baseline))


def _find_departure(output: RawArray, baseline: float, level: float) -> int | None:
    """Find the first point that deviates from the baseline by `level` or more."""
    if output.dtype == np.int32:
        # Of whole numbers these differences are exact, as those of the points below are.
        top, bottom = int(np.maximum.reduce(output)), int(np.minimum.reduce(output))
        if top - baseline < level and baseline - bottom < level:
            return None
    above = np.abs(output - baseline) >= level
    index = int(above.argmax())
    return index if above[index] else None


EMPTY = np.empty(0)
QUIET_RECORDS = 10
"""How much of an arming without a pulse is kept, in record durations [-], our choice: enough to
see which channel is dead."""


class ImpactDetector:
    """Cuts hits out of what the armings of one accelerometer pair hold.

    Feed it every block in order; it hands out a `Record` as soon as a hit's whole window has
    arrived, or the arming ends, or a gap cuts it off. An arming that ends without any pulse
    gives one record of its last ten record durations. How the stream is split into blocks
    changes nothing.

    Parameters
    ----------
    settings : AnalysisSettings
        `pre_trigger`, `record_duration` and `detection_level` are used.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._reset()

    def _reset(self) -> None:
        self._continuity = Continuity(expected=0)
        self._search = PulseSearch(self._settings)
        self._segment: Segment | None = None
        self._is_broken = False
        self._before = self._length = 0
        self._resume = 0
        self._baseline: float | None = None
        self._hit: RawArray | None = None
        self._pulse: int | None = None
        self._found = False
        self._gaps: list[Gap] = []

    def feed(self, block: Block) -> tuple[Record, ...]:
        """Take the next block, and return the hits that it completes, oldest first."""
        records: list[Record] = []
        previous = self._continuity.previous
        if previous is not None and (block.label != previous.label or not block.triggered):
            records += self._break_off(previous)
        if not block.triggered:
            return (*records, self._make_record(block, triggered=False))
        if gap := self._continuity.follow(block):
            self._gaps.append(gap)
            records += self._cut(end=True)
            self._is_broken = True
        if block.hammer.output.size:
            if self._segment is None or self._is_broken:
                self._is_broken = False
                self._segment = Segment(block, search_from=self._resume)
                self._before, self._length = count_window_points(
                    self._settings, block.sampling_rate
                )
            self._segment.append(block)
        records += self._cut(end=block.last)
        if block.last:
            records += self._finish(block)
        return tuple(records)

    def _break_off(self, previous: Block) -> list[Record]:
        """End an arming whose last block never came."""
        place = self._continuity.expected or 0
        self._gaps.append(Gap(place, sys.maxsize, f"the stream breaks off at point {place}"))
        return self._cut(end=True) + self._finish(previous)

    def _finish(self, block: Block) -> list[Record]:
        """Forget the arming; one record of what there is if it had no pulse."""
        records = [] if self._found else [self._cut_quiet(block)]
        self._reset()
        return records

    def _cut(self, *, end: bool) -> list[Record]:
        """Cut out every hit whose window is complete; at the `end`, what there is of it."""
        records: list[Record] = []
        segment = self._segment
        while segment is not None:
            if self._pulse is None:
                self._pulse = self._find_pulse(segment, end=end)
            if self._pulse is None:
                break
            wanted = self._pulse - self._before
            first = max(wanted, segment.start)
            last = first + self._length
            if segment.stop < last and not end:
                break
            gaps = [gap for gap in self._gaps if gap.high > wanted and gap.low < last]
            hammer, specimen = segment.read(first, min(last, segment.stop))
            overloads = segment.get_overloads(first, last)
            records.append(self._make_hit(segment, first, hammer, specimen, gaps, overloads))
            if segment.stop >= last:
                self._hit = hammer
            # Where a gap cut the hit off, the rest of its window still belongs to it.
            segment.searched = self._resume = last
            self._found = True
            self._pulse = None
        return records

    def _find_pulse(self, segment: Segment, *, end: bool) -> int | None:
        if segment.stop <= segment.searched:
            return None
        before = self._before
        is_long = segment.stop - segment.start >= before
        complete = is_long and segment.block.hammer.full_scale > 0.0
        if not (complete or end):
            return None
        if self._hit is not None:
            self._baseline, self._hit = compute_median(self._hit), None
        baseline = self._baseline
        if baseline is None:
            # Without a full scale all of the arming is there.
            quiet = (
                segment.read(segment.start, segment.start + before)[0]
                if segment.block.hammer.full_scale > 0.0
                else find_quiet_end(segment.read(segment.start, segment.stop)[0])
            )
            baseline = self._search.learn(quiet)
            self._baseline = baseline if complete else None
        pulse = self._search.find(segment, baseline, segment.stop)
        if pulse is None:
            segment.searched = segment.stop
            keep = max(before, 0 if self._found else QUIET_RECORDS * self._length)
            segment.forget(segment.stop - keep)
        return pulse

    def _make_hit(
        self,
        segment: Segment,
        first: int,
        hammer: RawArray,
        specimen: RawArray,
        gaps: Iterable[Gap],
        overloads: tuple[bool, bool],
    ) -> Record:
        block = segment.block
        return self._make_record(
            block,
            hammer=to_acceleration(block.hammer, hammer),
            specimen=to_acceleration(block.specimen, specimen) if block.has_specimen else None,
            pulse_index=None if self._pulse is None else self._pulse - first,
            gaps=gaps,
            overloads=overloads,
            delay=round((first - segment.start) / block.sampling_rate * 1e9),
        )

    def _cut_quiet(self, block: Block) -> Record:
        """Make one record of an arming without a pulse."""
        segment = self._segment
        if segment is None:
            return self._make_record(block, gaps=self._gaps)
        first = max(segment.start, segment.stop - QUIET_RECORDS * self._length)
        hammer, specimen = segment.read(first, segment.stop)
        overloads = segment.get_overloads(first, segment.stop)
        return self._make_hit(segment, first, hammer, specimen, self._gaps, overloads)

    @staticmethod
    def _make_record(
        block: Block,
        *,
        hammer: FloatArray = EMPTY,
        specimen: FloatArray | None = EMPTY,
        pulse_index: int | None = None,
        triggered: bool = True,
        gaps: Iterable[Gap] = (),
        overloads: tuple[bool, bool] = (False, False),
        delay: int = 0,
    ) -> Record:
        return Record(
            label=block.label,
            sampling_rate=block.sampling_rate,
            hammer=Trace(hammer, block.hammer.full_scale, block.hammer.resolution, overloads[0]),
            specimen=None
            if specimen is None
            else Trace(
                specimen, block.specimen.full_scale, block.specimen.resolution, overloads[1]
            ),
            pulse_index=pulse_index,
            triggered=triggered,
            flaws=tuple(gap.description for gap in gaps),
            stamp=block.stamp + delay,
            origin=block.origin,
        )


def find_pulse_start(trace: Trace, settings: AnalysisSettings) -> int | None:
    """Find where a trace that was recorded as a whole first leaves its baseline.

    Parameters
    ----------
    trace : Trace
        The hammer's.
    settings : AnalysisSettings
        `detection_level` is used: of full scale where that is known, else a tenth of the
        trace's own largest deviation, which must then stand out of the noise.

    Returns
    -------
    int or None
        Index of the first point at or above the level; None: the trace never leaves its
        baseline, or is not finite.
    """
    acceleration = trace.acceleration
    if acceleration.size == 0 or not np.all(np.isfinite(acceleration)):
        return None
    baseline, noise = compute_baseline(find_quiet_end(acceleration))
    deviation = np.abs(acceleration - baseline)
    level = (
        settings.detection_level * trace.full_scale
        if trace.full_scale > 0.0
        else RELATIVE_LEVEL * float(deviation.max()) or math.inf
    )
    above = deviation >= max(level, PULSE_NOISE * noise)
    index = int(np.argmax(above))
    return index if above[index] else None
