"""Impacts found in a stream of blocks, and cut out with pre-trigger.

A stream may have gaps: they are found, named and never bridged. What a gap cuts off is still
handed out, with the gap named, so that no hit vanishes without a word.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import (
    Block,
    ChannelBlock,
    FloatArray,
    RawArray,
    Record,
    Trace,
)
from impact_rig.core.signals.stretch import Stretch

EMPTY = np.empty(0)
RELATIVE_LEVEL = 0.1
"""Where full scale is unknown, the part of the largest deviation that starts a pulse [-], our
choice: a hit recorded as a whole always has one."""
PULSE_NOISE = 6.0
"""Least height of a pulse, in standard deviations of the noise [-], our choice: noise alone
reaches it in one record of 100 000."""
SPREAD_OF_MEDIAN = 1.4826
"""Standard deviation over median absolute deviation of normal noise [-]."""
QUIET_RECORDS = 10
"""How much of an arming without a pulse is kept, in record durations [-], our choice: enough to
see which channel is dead."""


@dataclass(frozen=True)
class _Gap:
    """A place where the stream does not go on as it should: points low to high of the arming."""

    low: int
    high: int
    description: str


class ImpactDetector:
    """Cuts hits out of the stream of one accelerometer pair.

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
        self._previous: Block | None = None
        self._stretch: Stretch | None = None
        self._expected = 0
        self._resume = 0
        self._baseline: float | None = None
        self._noise = 0.0
        self._pulse: int | None = None
        self._found = False
        self._gaps: list[_Gap] = []

    def feed(self, block: Block) -> tuple[Record, ...]:
        """Take the next block, and return the hits that it completes, oldest first."""
        records: list[Record] = []
        previous = self._previous
        if previous is not None and (block.label != previous.label or not block.triggered):
            records += self._break_off(previous)
        if not block.triggered:
            return (*records, self._make_record(block, triggered=False))
        records += self._follow(block)
        self._previous = block
        self._expected = block.first_sample + block.hammer.output.size
        if block.hammer.output.size:
            if self._stretch is None:
                self._stretch = Stretch(block, search_from=self._resume)
            self._stretch.append(block)
        records += self._cut(end=block.last)
        if block.last:
            records += self._finish(block)
        return tuple(records)

    def _break_off(self, previous: Block) -> list[Record]:
        """End an arming whose last block never came."""
        place = self._expected
        self._gaps.append(_Gap(place, sys.maxsize, f"the stream breaks off at point {place}"))
        return self._cut(end=True) + self._finish(previous)

    def _finish(self, block: Block) -> list[Record]:
        """Forget the arming; one record of what there is if it had no pulse."""
        records = [] if self._found else [self._cut_quiet(block)]
        self._reset()
        return records

    def _follow(self, block: Block) -> list[Record]:
        """Find out whether `block` goes on where the stream stopped; if not, cut there."""
        expected, start = self._expected, block.first_sample
        if start > expected:
            what = f"{start - expected} points missing at point {expected}"
        elif start < expected:
            what = f"{expected - start} points repeated at point {start}"
        elif self._previous is not None and not _is_alike(self._previous, block):
            what = f"sampling rate, channels or calibration changed at point {start}"
        else:
            return []
        self._gaps.append(_Gap(min(expected, start), max(expected, start), what))
        records = self._cut(end=True)
        self._stretch = None
        return records

    def _cut(self, *, end: bool) -> list[Record]:
        """Cut out every hit whose window is complete; at the `end`, what there is of it."""
        records: list[Record] = []
        stretch = self._stretch
        while stretch is not None:
            if self._pulse is None:
                self._pulse = self._find_pulse(stretch, end=end)
            if self._pulse is None:
                break
            before, length = self._count_points(stretch.block)
            wanted = self._pulse - before
            first = max(wanted, stretch.start)
            last = first + length
            if stretch.stop < last and not end:
                break
            gaps = [gap for gap in self._gaps if gap.high > wanted and gap.low < last]
            record = self._cut_window(stretch, first, min(last, stretch.stop), gaps)
            records.append(record)
            if stretch.stop >= last:
                self._baseline = float(np.median(stretch.read(first, last)[0]))
            # Where a gap cut the hit off, the rest of its window still belongs to it.
            stretch.searched = self._resume = last
            self._found = True
            self._pulse = None
        return records

    def _count_points(self, block: Block) -> tuple[int, int]:
        """Return pre-trigger and length of a hit's window [points]."""
        settings, rate = self._settings, block.sampling_rate
        return (
            max(round(settings.pre_trigger * rate), 1),
            max(round(settings.record_duration * rate), 1),
        )

    def _find_pulse(self, stretch: Stretch, *, end: bool) -> int | None:
        channel = stretch.block.hammer
        before, length = self._count_points(stretch.block)
        full_scale = abs(channel.full_scale / channel.scale)
        complete = full_scale > 0.0 and stretch.stop - stretch.start >= before
        if stretch.stop <= stretch.searched or not (complete or end):
            return None
        baseline = self._baseline
        if baseline is None:
            quiet = stretch.read(stretch.start, stretch.start + before)[0]
            baseline = float(np.median(quiet))
            self._noise = SPREAD_OF_MEDIAN * float(np.median(np.abs(quiet - baseline)))
            self._baseline = baseline if complete else None
        # Without a full scale the level is a part of the largest pulse: of the whole stretch.
        from_point = stretch.searched if full_scale > 0.0 else stretch.start
        deviation = np.abs(stretch.read(from_point, stretch.stop)[0] - baseline)
        least = max(PULSE_NOISE * self._noise, channel.resolution / abs(channel.scale))
        level = max(_find_level(deviation, full_scale, self._settings), least)
        above = deviation[stretch.searched - from_point :] >= level
        index = int(np.argmax(above))
        if above[index]:
            return stretch.searched + index
        stretch.searched = stretch.stop
        stretch.forget(stretch.stop - max(before, 0 if self._found else QUIET_RECORDS * length))
        return None

    def _cut_window(self, stretch: Stretch, first: int, last: int, gaps: Iterable[_Gap]) -> Record:
        block, rate = stretch.block, stretch.block.sampling_rate
        hammer, specimen = stretch.read(first, last)
        return self._make_record(
            block,
            hammer=_to_acceleration(block.hammer, hammer),
            specimen=_to_acceleration(block.specimen, specimen) if block.has_specimen else None,
            pulse_index=None if self._pulse is None else self._pulse - first,
            gaps=gaps,
            delay=round((first - stretch.start) / rate * 1e9),
        )

    def _cut_quiet(self, block: Block) -> Record:
        """Make one record of an arming without a pulse."""
        stretch = self._stretch
        if stretch is None:
            return self._make_record(block, gaps=self._gaps)
        _, length = self._count_points(stretch.block)
        first = max(stretch.start, stretch.stop - QUIET_RECORDS * length)
        return self._cut_window(stretch, first, stretch.stop, self._gaps)

    @staticmethod
    def _make_record(
        block: Block,
        *,
        hammer: FloatArray = EMPTY,
        specimen: FloatArray | None = EMPTY,
        pulse_index: int | None = None,
        triggered: bool = True,
        gaps: Iterable[_Gap] = (),
        delay: int = 0,
    ) -> Record:
        return Record(
            label=block.label,
            sampling_rate=block.sampling_rate,
            hammer=Trace(hammer, block.hammer.full_scale, block.hammer.resolution),
            specimen=None
            if specimen is None
            else Trace(specimen, block.specimen.full_scale, block.specimen.resolution),
            pulse_index=pulse_index,
            triggered=triggered,
            flaws=tuple(gap.description for gap in gaps),
            stamp=block.stamp + delay,
        )


def _is_alike(block: Block, other: Block) -> bool:
    """Whether two blocks may be joined: equal rate, channels and calibration."""
    return (block.sampling_rate, block.has_specimen) == (
        other.sampling_rate,
        other.has_specimen,
    ) and all(
        (a.scale, a.offset, a.full_scale) == (b.scale, b.offset, b.full_scale)
        for a, b in ((block.hammer, other.hammer), (block.specimen, other.specimen))
    )


def _to_acceleration(channel: ChannelBlock, output: RawArray) -> FloatArray:
    acceleration: FloatArray = channel.scale * output.astype(np.float64) + channel.offset
    return acceleration


def _find_level(deviation: FloatArray, full_scale: float, settings: AnalysisSettings) -> float:
    """Return what a pulse must reach [unit of the deviation]; infinite: there is no pulse."""
    if full_scale > 0.0:
        return settings.detection_level * full_scale
    largest = float(deviation.max())
    noise = SPREAD_OF_MEDIAN * float(np.median(deviation))
    return RELATIVE_LEVEL * largest if largest > PULSE_NOISE * noise else np.inf


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
    peak = int(np.argmax(np.abs(acceleration - np.median(acceleration))))
    baseline = float(np.median(acceleration[: max(peak // 2, 1)]))
    deviation = np.abs(acceleration - baseline)
    above = deviation >= _find_level(deviation, trace.full_scale, settings)
    index = int(np.argmax(above))
    return index if above[index] else None
