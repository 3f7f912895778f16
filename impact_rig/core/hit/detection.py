"""Baseline and the search for an impact in a trace."""

import math
import sys
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from impact_rig.core.given.records import NO_SPEED, Block, RawArray, Record
from impact_rig.core.given.setup import AnalysisSettings


@dataclass(frozen=True)
class Gap:
    """A place where the stream does not go on as it should.

    `low` is the first missing point, `high` the first that is there again; they are equal where
    nothing is missing and something else has changed.
    """

    low: int
    high: int
    description: str
    is_backward: bool = False  # points are repeated, or the stream has begun again


class Continuity:
    """Compares each block of a stream with the one before it.

    Parameters
    ----------
    expected : int or None
        First point of the first block; None: any.
    """

    def __init__(self, expected: int | None) -> None:
        self._previous: Block | None = None
        self._expected = expected

    def follow(self, block: Block) -> Gap | None:
        """Take the next block; return what is wrong between it and the one before."""
        previous, expected, start = self._previous, self._expected, block.first_sample
        self._previous, self._expected = block, block.stop
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
    """Return whether two blocks may be joined: equal rate, channels and calibration."""
    # A block without points does not show whether the sample is measured.
    shows_channels = block.hammer.output.size > 0 and other.hammer.output.size > 0
    return (
        block.sampling_rate == other.sampling_rate
        and (block.has_specimen == other.has_specimen or not shows_channels)
        and block.hammer.has_calibration_of(other.hammer)
        and block.specimen.has_calibration_of(other.specimen)
    )


class Segment:
    """Blocks that follow each other without a gap.

    `start` is its first point, `stop` the one behind its last; the search for a pulse goes on at
    `searched`.
    """

    def __init__(self, block: Block) -> None:
        self.first = block  # its rate, calibration and origin are those of the segment
        self.start = self.searched = block.first_sample
        self.stop = block.stop
        self._blocks = deque([block])

    def append(self, block: Block) -> None:
        """Take the block that follows."""
        self._blocks.append(block)
        self.stop = block.stop

    def read(self, first: int, last: int) -> Block:
        """Return the points from `first` up to `last`, as far as they are there, as one block."""
        parts = [
            block.cut(max(first - block.first_sample, 0), last - block.first_sample)
            for block in self._blocks
            if block.first_sample < last and block.stop > first
        ]
        if not parts:
            return self.first.cut(0, 0)
        if len(parts) == 1:
            return parts[0]
        hammer, specimen = (
            replace(
                channels[0],
                output=np.concatenate([channel.output for channel in channels]),
                overloaded=any(channel.overloaded for channel in channels),
            )
            for channels in ([part.hammer for part in parts], [part.specimen for part in parts])
        )
        # Only the block of the contact may have the hammer's speed.
        speeds = (part.impact_speed for part in parts if part.impact_speed.is_known)
        speed = next(speeds, NO_SPEED)
        return replace(parts[0], hammer=hammer, specimen=specimen, impact_speed=speed)

    def find_pulse(
        self, baseline: "Baseline", settings: AnalysisSettings, last: int
    ) -> int | None:
        """Return the first point at or above the detection level from `searched` up to `last`.

        Raw outputs are compared, whole blocks by their extremes: nothing is converted where there
        is no pulse.
        """
        channel = self.first.hammer
        if channel.full_scale > 0.0:
            level = settings.detection_level * abs(channel.full_scale / channel.scale)
        else:
            output = self.read(self.start, last).hammer.output
            # A constant trace has no pulse, and no noise to stand out of.
            largest = float(np.abs(output - baseline.level).max(initial=0.0))
            level = RELATIVE_LEVEL * largest or math.inf
        # Noise alone reaches six standard deviations in one record of 100 000.
        level = max(level, 6.0 * baseline.noise, channel.resolution / abs(channel.scale))
        for block in self._blocks:
            start = block.first_sample
            first = max(self.searched, start)
            output = block.hammer.output[first - start : max(last - start, 0)]
            index = _find_departure(output, baseline.level, level) if output.size else None
            if index is not None:
                return first + index
        return None

    def get_time(self, point: int) -> int:
        """Return when a point was taken, by the newest block [ns since the epoch]."""
        newest = self._blocks[-1]
        return newest.stamp + round((point - newest.first_sample) / newest.sampling_rate * 1e9)

    def forget(self, index: int) -> None:
        """Forget whole blocks that lie before the point `index`."""
        while self._blocks and self._blocks[0].stop <= index:
            self._blocks.popleft()


RELATIVE_LEVEL = 0.1
"""Level that starts a pulse where full scale is unknown, over the largest deviation [-], our
choice: every hit that is recorded as a whole reaches it."""
LOUD_BEGINNING = 2.0
"""Noise of a record's beginning over that of its end from which a pulse is there [-], our choice:
of 125 points each, noise alone differs by less."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""


class Baseline(NamedTuple):
    """The raw output without a pulse."""

    level: float
    noise: float  # standard deviation by the median absolute deviation


def compute_baseline(quiet: RawArray) -> Baseline:
    """Return the baseline of points without a pulse."""
    level = float(np.median(quiet))
    return Baseline(level, SPREAD_OF_MEDIAN * float(np.median(np.abs(quiet - level))))


def find_quietest(output: RawArray, count: int) -> RawArray:
    """Return that part of `count` points in which least happens; all, if there are no more.

    Parts are counted from the beginning; an incomplete part at the end is left out.
    """
    parts = output.size // count
    if not parts:
        return output
    split = output[: parts * count].reshape(parts, count)
    # Counts of 32 bits may lie further apart than 32 bits hold.
    span = np.subtract(split.max(axis=1), split.min(axis=1), dtype=np.float64)
    quietest: RawArray = split[int(np.nan_to_num(span, nan=np.inf).argmin())]
    return quietest


def _find_quiet_end(output: RawArray) -> Baseline:
    """Return the baseline of a record: of its beginning, or of its end.

    Before the impact nothing happens, unless the pulse begins at once; then what follows is
    quieter. How long the pulse lasts and rings does not matter.
    """
    # Half the default pre-trigger, our choice.
    count = max(int(0.05 * output.size), 8)
    first, last = compute_baseline(output[:count]), compute_baseline(output[-count:])
    return last if first.noise > LOUD_BEGINNING * last.noise else first


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


def count_window_points(settings: AnalysisSettings, sampling_rate: float) -> tuple[int, int]:
    """Return pre-trigger and length of a hit's window [points] at a rate [Hz]."""
    before, length = settings.pre_trigger * sampling_rate, settings.record_duration * sampling_rate
    return max(round(before), 1), max(round(length), 1)


class ImpactDetector:
    """Cuts the hit of each arming of one accelerometer pair out of its blocks.

    Feed it every block in order. When an arming has ended it returns one `Record`: the window of
    the first pulse, or all points if there is no pulse. How the stream is split into blocks
    changes nothing.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._blocks: list[Block] = []

    def feed(self, block: Block) -> tuple[Record, ...]:
        """Take the next block, and return the records of the armings that it ends."""
        records: list[Record] = []
        held = self._blocks
        if held and (block.label != held[0].label or not block.triggered):
            place = held[-1].stop
            broken = Gap(place, sys.maxsize, f"the stream breaks off at point {place}")
            records.append(self._finish([broken]))
        if not block.triggered:
            return (*records, _make_record(block, block))
        self._blocks.append(block)
        if block.last:
            records.append(self._finish([]))
        return tuple(records)

    def _finish(self, gaps_at_end: list[Gap]) -> Record:
        """Return the record of an arming, and forget its blocks."""
        blocks, self._blocks = self._blocks, []
        segments: list[Segment] = []
        gaps: list[Gap] = []
        continuity, is_broken = Continuity(expected=0), True
        for block in blocks:
            gap = continuity.follow(block)
            if gap is not None:
                gaps.append(gap)
                is_broken = True
            if not block.hammer.output.size:
                continue
            if is_broken:
                segments.append(Segment(block))
                is_broken = False
            else:
                segments[-1].append(block)
        gaps += gaps_at_end
        before, length = count_window_points(self._settings, blocks[0].sampling_rate)
        known: Baseline | None = None
        for segment in segments:
            baseline = known
            if baseline is None:
                output = segment.read(segment.start, segment.stop).hammer.output
                if segment.first.hammer.full_scale > 0.0:
                    # That of the first segment as long as a pre-trigger, as far as there is one.
                    baseline = compute_baseline(output[:before])
                    known = baseline if output.size >= before else None
                else:
                    baseline = _find_quiet_end(output)
            pulse = segment.find_pulse(baseline, self._settings, segment.stop)
            if pulse is not None:
                wanted = pulse - before
                first, last = max(wanted, segment.start), max(wanted, segment.start) + length
                near = [gap for gap in gaps if gap.high > wanted and gap.low < last]
                window = segment.read(first, last)
                return _make_record(segment.first, window, near, pulse - first)
        if not segments:
            return _make_record(blocks[-1], blocks[-1], gaps)
        final = segments[-1]
        return _make_record(final.first, final.read(final.start, final.stop), gaps)


def _make_record(
    first: Block, window: Block, gaps: Iterable[Gap] = (), pulse_index: int | None = None
) -> Record:
    """Return the record of a window, stamped by the first block of its segment."""
    delay = (window.first_sample - first.first_sample) / first.sampling_rate
    return Record(
        first_sample=window.first_sample,
        sampling_rate=first.sampling_rate,
        hammer=window.hammer,
        specimen=window.specimen,
        label=first.label,
        triggered=window.triggered,
        disarmed=window.disarmed,
        stamp=first.stamp + round(delay * 1e9),
        origin=first.origin,
        impact_speed=window.impact_speed,
        pulse_index=pulse_index,
        flaws=tuple(gap.description for gap in gaps),
    )


def find_pulse_start(block: Block, settings: AnalysisSettings) -> int | None:
    """Find where the hammer of a block that was recorded as a whole first leaves its baseline.

    None: it never does, or is not finite.
    """
    output = block.hammer.output
    if output.size == 0 or not np.all(np.isfinite(output)):
        return None
    pulse = Segment(block).find_pulse(_find_quiet_end(output), settings, block.stop)
    return None if pulse is None else pulse - block.first_sample
