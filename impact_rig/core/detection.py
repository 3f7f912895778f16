"""Baseline and the search for an impact in a trace."""

import math
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import Block, ChannelBlock, FloatArray, RawArray, Record, Trace
from impact_rig.core.setup import AnalysisSettings


class _Chunk(NamedTuple):
    """What one block brought: points from `start` up to `stop`."""

    start: int
    stop: int
    hammer: RawArray
    specimen: RawArray
    stamp: int
    overloads: tuple[bool, bool]


class Segment:
    """Blocks that follow each other without a gap.

    Parameters
    ----------
    block : Block
        The first one, not yet appended: rate, calibration and time of the segment are its.
    search_from : int
        What lies before this point belongs to a hit already.

    Attributes
    ----------
    block : Block
        The first one.
    start, stop : int
        First point of the segment, and the one behind its last.
    searched : int
        Where the search for the next pulse goes on.
    """

    def __init__(self, block: Block, search_from: int) -> None:
        self.block = block
        self.start = self.stop = block.first_sample
        self.searched = max(search_from, self.start)
        self._chunks: deque[_Chunk] = deque()

    def append(self, block: Block) -> None:
        """Take the block that follows."""
        stop = self.stop + block.hammer.output.size
        self._chunks.append(
            _Chunk(
                self.stop,
                stop,
                block.hammer.output,
                block.specimen.output,
                block.stamp,
                (block.hammer.overloaded, block.specimen.overloaded),
            )
        )
        self.stop = stop

    def read(self, first: int, last: int) -> tuple[RawArray, RawArray]:
        """Return hammer and sample from point `first` up to `last`, as far as they are there.

        At least one such point must be there, and none of them forgotten.
        """
        hammers: list[NDArray[Any]] = []
        specimens: list[NDArray[Any]] = []
        for chunk in reversed(self._chunks):
            if chunk.stop <= first:
                break
            window = slice(max(first - chunk.start, 0), max(last - chunk.start, 0))
            hammers.append(chunk.hammer[window])
            specimens.append(chunk.specimen[window])
        if len(hammers) == 1:
            return hammers[0], specimens[0]
        return np.concatenate(hammers[::-1]), np.concatenate(specimens[::-1])

    def read_hammer(self, first: int, last: int) -> Iterator[tuple[int, RawArray]]:
        """Yield what the hammer's blocks hold from point `first` up to `last`, and where."""
        # What has not been read yet lies at the end, most often in the last block.
        chunks = self._chunks
        index = len(chunks)
        while index and chunks[index - 1].stop > first:
            index -= 1
        for number in range(index, len(chunks)):
            chunk = chunks[number]
            if chunk.start >= last:
                break
            begin = max(first, chunk.start)
            yield begin, chunk.hammer[begin - chunk.start : last - chunk.start]

    def get_overloads(self, first: int, last: int) -> tuple[bool, bool]:
        """Return whether the device called hammer and sample overloaded from `first` to `last`."""
        hammers, specimens = [False], [False]
        for chunk in reversed(self._chunks):
            if chunk.stop <= first:
                break
            if chunk.start < last:
                hammers.append(chunk.overloads[0])
                specimens.append(chunk.overloads[1])
        return any(hammers), any(specimens)

    def get_time(self, point: int) -> int:
        """Return when a point was taken, by its own block, nanoseconds since the epoch."""
        for chunk in reversed(self._chunks):
            if chunk.start <= point:
                delay = (point - chunk.start) / self.block.sampling_rate
                return chunk.stamp + round(delay * 1e9)
        return self.block.stamp

    def forget(self, index: int) -> None:
        """Forget whole blocks that lie before the point `index`."""
        while self._chunks and self._chunks[0].stop <= index:
            self._chunks.popleft()


@dataclass(frozen=True)
class Gap:
    """A place where the stream does not go on as it should.

    Attributes
    ----------
    low, high : int
        First point that is concerned, and the one behind the last; equal where nothing is
        missing and something else has changed.
    description : str
        In words.
    is_backward : bool
        Points are repeated, or the stream has begun anew.
    """

    low: int
    high: int
    description: str
    is_backward: bool = False


class Continuity:
    """Holds each block of a stream against the one before it.

    Parameters
    ----------
    expected : int or None
        First point of the first block; None: whatever it is.

    Attributes
    ----------
    previous : Block or None
        The last block that came.
    expected : int or None
        First point of the next one.
    """

    def __init__(self, expected: int | None) -> None:
        self.previous: Block | None = None
        self.expected = expected

    def follow(self, block: Block) -> Gap | None:
        """Take the next block; return what lies between it and the one before, if it is bad."""
        previous, expected, start = self.previous, self.expected, block.first_sample
        self.previous = block
        self.expected = start + block.hammer.output.size
        if expected is None:
            return None
        if start > expected:
            what = f"{start - expected} points missing at point {expected}"
            return Gap(expected, start, what)
        if start < expected:
            what = f"{expected - start} points repeated at point {start}"
            return Gap(start, expected, what, is_backward=True)
        if previous is not None and not _is_alike(previous, block):
            what = f"sampling rate, channels or calibration changed at point {start}"
            return Gap(start, start, what)
        return None


def _is_alike(block: Block, other: Block) -> bool:
    """Whether two blocks may be joined: equal rate, channels and calibration."""
    # A block without points does not show whether the sample is measured.
    shows_channels = block.hammer.output.size > 0 and other.hammer.output.size > 0
    return (
        block.sampling_rate == other.sampling_rate
        and (block.has_specimen == other.has_specimen or not shows_channels)
        and block.hammer.has_calibration_of(other.hammer)
        and block.specimen.has_calibration_of(other.specimen)
    )


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
