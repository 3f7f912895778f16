"""Impacts found in a stream of blocks, and cut out with pre-trigger.

A stream may have gaps: they are found, named and never bridged. What a gap cuts off is still
handed out, with the gap named, so that no hit vanishes without a word.
"""

import sys
from collections.abc import Iterable

import numpy as np

from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.continuity import Continuity, Gap
from impact_rig.core.signals.pulse_search import (
    PulseSearch,
    count_window_points,
    find_median,
    find_relative_level,
    to_acceleration,
)
from impact_rig.core.signals.record import Block, FloatArray, RawArray, Record, Trace
from impact_rig.core.signals.stretch import Stretch

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
        self._stretch: Stretch | None = None
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
            if self._stretch is None or self._is_broken:
                self._is_broken = False
                self._stretch = Stretch(block, search_from=self._resume)
                self._before, self._length = count_window_points(
                    self._settings, block.sampling_rate
                )
            self._stretch.append(block)
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
        stretch = self._stretch
        while stretch is not None:
            if self._pulse is None:
                self._pulse = self._find_pulse(stretch, end=end)
            if self._pulse is None:
                break
            wanted = self._pulse - self._before
            first = max(wanted, stretch.start)
            last = first + self._length
            if stretch.stop < last and not end:
                break
            gaps = [gap for gap in self._gaps if gap.high > wanted and gap.low < last]
            hammer, specimen = stretch.read(first, min(last, stretch.stop))
            overloads = stretch.find_overloads(first, last)
            records.append(self._make_hit(stretch, first, hammer, specimen, gaps, overloads))
            if stretch.stop >= last:
                self._hit = hammer
            # Where a gap cut the hit off, the rest of its window still belongs to it.
            stretch.searched = self._resume = last
            self._found = True
            self._pulse = None
        return records

    def _find_pulse(self, stretch: Stretch, *, end: bool) -> int | None:
        if stretch.stop <= stretch.searched:
            return None
        before = self._before
        is_long = stretch.stop - stretch.start >= before
        complete = is_long and stretch.block.hammer.full_scale > 0.0
        if not (complete or end):
            return None
        if self._hit is not None:
            self._baseline, self._hit = find_median(self._hit), None
        baseline = self._baseline
        if baseline is None:
            quiet = stretch.read(stretch.start, stretch.start + before)[0]
            baseline = self._search.learn(quiet)
            self._baseline = baseline if complete else None
        pulse = self._search.find(stretch, baseline, stretch.stop)
        if pulse is None:
            stretch.searched = stretch.stop
            keep = max(before, 0 if self._found else QUIET_RECORDS * self._length)
            stretch.forget(stretch.stop - keep)
        return pulse

    def _make_hit(
        self,
        stretch: Stretch,
        first: int,
        hammer: RawArray,
        specimen: RawArray,
        gaps: Iterable[Gap],
        overloads: tuple[bool, bool],
    ) -> Record:
        block = stretch.block
        return self._make_record(
            block,
            hammer=to_acceleration(block.hammer, hammer),
            specimen=to_acceleration(block.specimen, specimen) if block.has_specimen else None,
            pulse_index=None if self._pulse is None else self._pulse - first,
            gaps=gaps,
            overloads=overloads,
            delay=round((first - stretch.start) / block.sampling_rate * 1e9),
        )

    def _cut_quiet(self, block: Block) -> Record:
        """Make one record of an arming without a pulse."""
        stretch = self._stretch
        if stretch is None:
            return self._make_record(block, gaps=self._gaps)
        first = max(stretch.start, stretch.stop - QUIET_RECORDS * self._length)
        hammer, specimen = stretch.read(first, stretch.stop)
        overloads = stretch.find_overloads(first, stretch.stop)
        return self._make_hit(stretch, first, hammer, specimen, self._gaps, overloads)

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
    peak = int(np.argmax(np.abs(acceleration - np.median(acceleration))))
    baseline = float(np.median(acceleration[: max(peak // 2, 1)]))
    deviation = np.abs(acceleration - baseline)
    above = deviation >= (
        settings.detection_level * trace.full_scale
        if trace.full_scale > 0.0
        else find_relative_level(deviation)
    )
    index = int(np.argmax(above))
    return index if above[index] else None
