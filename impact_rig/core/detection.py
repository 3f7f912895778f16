"""Impacts found in a stream of blocks, and cut out with pre-trigger.

A stream may have gaps: they are found, named and never bridged. What a gap cuts off is still
handed out, with the gap named, so that no hit vanishes without a word.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from impact_rig.core.record import Block, ChannelBlock, CountArray, FloatArray, HitLabel, Record, Trace
from impact_rig.core.settings import AnalysisSettings

EMPTY = np.empty(0)
RELATIVE_LEVEL = 0.1
"""Where full scale is unknown, the part of the largest deviation that starts a pulse [-], our
choice: a hit recorded as a whole always has one."""


@dataclass(frozen=True)
class _Gap:
    """A place where the stream does not go on as it should; points low to high of the arming."""

    low: int
    high: int
    description: str


@dataclass
class _Segment:
    """A contiguous stretch of the stream, kept as long as a hit may still begin in it."""

    start: int
    stamp: int
    hammer: list[CountArray] = field(default_factory=list)
    specimen: list[CountArray] = field(default_factory=list)
    length: int = 0

    def append(self, block: Block) -> None:
        self.hammer.append(block.hammer.counts)
        self.specimen.append(block.specimen.counts)
        self.length += block.hammer.counts.size

    @property
    def stop(self) -> int:
        return self.start + self.length

    def join(self) -> tuple[CountArray, CountArray]:
        """Return both channels as one array each, kept joined."""
        if len(self.hammer) > 1:
            self.hammer = [np.concatenate(self.hammer)]
            self.specimen = [np.concatenate(self.specimen)]
        return self.hammer[0], self.specimen[0]

    def drop_before(self, index: int, sampling_rate: float) -> None:
        """Forget what lies before the stream's point `index`."""
        surplus = min(index - self.start, self.length)
        if surplus <= 0:
            return
        hammer, specimen = self.join()
        self.hammer, self.specimen = [hammer[surplus:]], [specimen[surplus:]]
        self.start += surplus
        self.length -= surplus
        self.stamp += round(surplus / sampling_rate * 1e9)


class ImpactDetector:
    """Cuts hits out of the stream of one accelerometer pair.

    Feed it every block in order; it hands out a `Record` as soon as a hit's whole window has
    arrived, or the arming ends, or a gap cuts it off. An arming that ends without any pulse
    gives one record of what there is.

    Parameters
    ----------
    settings : AnalysisSettings
        `pre_trigger`, `record_duration` and `detection_level` are used.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._label: HitLabel | None = None
        self._reset()

    def _reset(self) -> None:
        self._segment: _Segment | None = None
        self._search_from = 0
        self._baseline: float | None = None
        self._pulse: int | None = None
        self._found = 0
        self._gaps: list[_Gap] = []

    def feed(self, block: Block) -> tuple[Record, ...]:
        """Take the next block, and return the hits that it completes, oldest first."""
        records: list[Record] = []
        if self._label is not None and block.label.record != self._label.record:
            self._reset()
        self._label = block.label
        if not block.triggered:
            self._reset()
            return (self._make_empty_record(block),)
        self._follow_gap(block, records)
        if block.hammer.counts.size:
            if self._segment is None:
                self._segment = _Segment(start=block.first_sample, stamp=block.stamp)
            self._segment.append(block)
        records.extend(self._cut(block, end=block.last))
        if block.last:
            if not self._found:
                records.append(self._cut_window(block, None))
            self._reset()
        return tuple(records)

    def _follow_gap(self, block: Block, records: list[Record]) -> None:
        expected = 0 if self._segment is None else self._segment.stop
        if self._segment is None and self._found:
            return
        if block.first_sample == expected:
            return
        missing = block.first_sample - expected
        what = f"{missing} points missing" if missing > 0 else f"{-missing} points repeated"
        self._gaps.append(
            _Gap(
                low=min(expected, block.first_sample),
                high=max(expected, block.first_sample),
                description=f"{what} at point {expected}",
            )
        )
        if self._segment is not None:
            records.extend(self._cut(block, end=True))
        self._segment = None
        self._search_from = block.first_sample
        self._baseline = None

    def _cut(self, block: Block, *, end: bool) -> Iterable[Record]:
        """Hand out every hit whose window is complete; at the `end`, what there is of it."""
        segment = self._segment
        if segment is None:
            return
        length = round(self._settings.record_duration * block.sampling_rate)
        before = round(self._settings.pre_trigger * block.sampling_rate)
        while True:
            if self._pulse is None:
                self._pulse = self._find_pulse(block, before, end=end)
            if self._pulse is None:
                if self._found:
                    segment.drop_before(self._search_from - before, block.sampling_rate)
                return
            stop = max(self._pulse - before, segment.start) + length
            if segment.stop < stop and not end:
                return
            yield self._cut_window(block, self._pulse)
            self._found += 1
            self._pulse = None
            self._search_from = min(stop, segment.stop)

    def _find_pulse(self, block: Block, before: int, *, end: bool) -> int | None:
        segment = self._segment
        if segment is None or segment.stop <= self._search_from:
            return None
        scale = abs(block.hammer.full_scale / block.hammer.scale)
        if not end and (scale == 0.0 or segment.length < before):
            return None
        hammer, _ = segment.join()
        if self._baseline is None:
            self._baseline = float(np.median(hammer[:before]))
        deviation = np.abs(hammer[self._search_from - segment.start :] - self._baseline)
        if scale > 0.0:
            level = self._settings.detection_level * scale
        else:
            level = max(RELATIVE_LEVEL * float(deviation.max()), 1.0)
        above = deviation >= level
        index = int(np.argmax(above))
        if above[index]:
            return self._search_from + index
        self._search_from = segment.stop
        return None

    def _cut_window(self, block: Block, pulse: int | None) -> Record:
        segment = self._segment
        if segment is None:
            return self._make_record(block, EMPTY, EMPTY, None, 0, self._gaps)
        hammer, specimen = segment.join()
        first, last = segment.start, segment.stop
        gaps = self._gaps
        if pulse is not None:
            wanted = pulse - round(self._settings.pre_trigger * block.sampling_rate)
            first = max(wanted, segment.start)
            wanted_last = first + round(self._settings.record_duration * block.sampling_rate)
            last = min(wanted_last, segment.stop)
            gaps = [gap for gap in gaps if gap.high >= wanted and gap.low <= wanted_last]
        window = slice(first - segment.start, last - segment.start)
        return self._make_record(
            block,
            _to_acceleration(block.hammer, hammer[window]),
            _to_acceleration(block.specimen, specimen[window]),
            None if pulse is None else pulse - first,
            segment.stamp + round((first - segment.start) / block.sampling_rate * 1e9),
            gaps,
        )

    def _make_record(
        self,
        block: Block,
        hammer: FloatArray,
        specimen: FloatArray,
        pulse_index: int | None,
        stamp: int,
        gaps: Iterable[_Gap],
    ) -> Record:
        return Record(
            label=block.label,
            sampling_rate=block.sampling_rate,
            hammer=Trace(hammer, block.hammer.full_scale),
            specimen=Trace(specimen, block.specimen.full_scale),
            pulse_index=pulse_index,
            flaws=tuple(gap.description for gap in gaps),
            stamp=stamp or block.stamp,
        )

    @staticmethod
    def _make_empty_record(block: Block) -> Record:
        return Record(
            label=block.label,
            sampling_rate=block.sampling_rate,
            hammer=Trace(EMPTY, block.hammer.full_scale),
            specimen=Trace(EMPTY, block.specimen.full_scale),
            pulse_index=None,
            triggered=False,
            stamp=block.stamp,
        )


def _to_acceleration(channel: ChannelBlock, counts: CountArray) -> FloatArray:
    return channel.scale * counts + channel.offset


def find_pulse_start(trace: Trace, settings: AnalysisSettings) -> int | None:
    """Find where a trace that was recorded as a whole first leaves its baseline.

    Parameters
    ----------
    trace : Trace
        The hammer's.
    settings : AnalysisSettings
        `detection_level` is used: of full scale where that is known, else of the trace's own
        largest deviation.

    Returns
    -------
    int or None
        Index of the first point at or above the level; None: the trace never leaves it.
    """
    acceleration = trace.acceleration
    if acceleration.size == 0 or not np.all(np.isfinite(acceleration)):
        return None
    peak = int(np.argmax(np.abs(acceleration - np.median(acceleration))))
    baseline = float(np.median(acceleration[: max(peak // 2, 1)]))
    deviation = np.abs(acceleration - baseline)
    if trace.full_scale > 0.0:
        level = settings.detection_level * trace.full_scale
    else:
        level = RELATIVE_LEVEL * float(deviation.max())
    above = deviation >= level
    index = int(np.argmax(above))
    return index if above[index] and level > 0.0 else None
