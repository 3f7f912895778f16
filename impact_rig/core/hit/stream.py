"""Cuts impacts out of a running stream."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.given.errors import SignalError
from impact_rig.core.given.records import NOT_ARMED, Block, HitLabel
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.detection import (
    RELATIVE_LEVEL,
    Baseline,
    Continuity,
    Gap,
    Segment,
    compute_baseline,
    count_window_points,
    find_quietest,
)


@dataclass
class Arming:
    """A part of the stream with one label, which may be `NOT_ARMED`."""

    label: HitLabel
    start: int
    has_hit: bool  # its hit was found
    stop: int | None = None  # behind its last point; None: it goes on
    is_complete: bool = False  # its last block has come
    disarmed: str = ""  # that the hammer was, before a contact, and why
    missing: int = 0  # [points] lost in gaps

    @property
    def wants_hit(self) -> bool:
        """Whether an impact in it is its hit."""
        return not self.has_hit and self.label.record != NOT_ARMED.record


@dataclass(frozen=True)
class Window:
    """Part to be cut out: the points from `first` up to `last`, for an impact at `pulse`."""

    label: HitLabel
    first: int
    pulse: int
    last: int


QUIET_LEAD = 2
"""What a cut holds before its impact, in pre-triggers [-], our choice: one for the record, and one
before it, out of which the record's own baseline is read."""
BASELINE_RECORDS = 100
"""Interval between readings of the baseline, in record durations [-], our choice: 0.2 s,
for what drifts with the temperature and not with the hits."""


@dataclass
class StreamFlow:
    """Counts of what has come."""

    blocks: int = 0
    points: int = 0  # per channel
    gaps: int = 0
    missing_points: int = 0  # per channel
    other_impacts: int = 0  # while not armed, or after the hit of the arming


def cut_impacts(block: Block, settings: AnalysisSettings) -> list[tuple[int, Block]]:
    """Cut every impact out of a long record, as out of the running stream.

    Returns the first point of each hit in the record, and the hit. Where the record does not say
    the full scale, an impact has a tenth of the height of the largest.
    """
    hammer = block.hammer
    full_scale = hammer.full_scale
    if not full_scale > 0.0:
        # Every so many points give the zero: a file may have more points than memory.
        zero = np.median(hammer.output[:: 1 + hammer.output.size // 100_000])
        height = float(max(hammer.output.max() - zero, zero - hammer.output.min()))
        full_scale = RELATIVE_LEVEL * height * abs(hammer.scale) / settings.detection_level
        if not 0.0 < full_scale < np.inf:
            return []
    before, _ = count_window_points(settings, block.sampling_rate)
    segment = Segment(replace(block, hammer=replace(hammer, full_scale=full_scale)))
    cutter, hits = StreamCutter(settings), []
    while (pulse := cutter.find_pulse(segment, is_over=True)) is not None:
        first = pulse - QUIET_LEAD * before
        begin = max(first, 0)
        hit = block.cut(begin, segment.searched)
        hits.append((begin, replace(hit, first_sample=begin - first, last=True)))
    return hits


class StreamCutter:
    """Cuts the hit of each arming out of the running stream of one accelerometer pair.

    Feed it every block in order; it returns the hit as soon as its whole window has come: one
    block that counts from the beginning of the window, carries the label of the arming, and is the
    last of its record. A gap or the end of the stream cuts a hit off: an empty block after it
    shows the gap. An arming that ends without an impact gives one empty block. How
    the stream is split into blocks changes nothing.

    A stream may begin within a hit: its first baseline is that of the quietest part of its first
    record duration, and all of it is searched.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self.flow = StreamFlow()
        self.settings = settings
        self._continuity = Continuity(expected=None)
        self._segment: Segment | None = None
        self._baseline: Baseline | None = None
        self._next_baseline = 0
        self._armings: deque[Arming] = deque()  # not finished, in their order
        self._answered = NOT_ARMED  # whose hit was found last
        self._window: Window | None = None

    def feed(self, block: Block) -> tuple[Block, ...]:
        """Take the next block of the stream, and return the blocks of the hit that it completes.

        Raises
        ------
        SignalError
            If the stream does not state the hammer's full scale.
        """
        if not block.hammer.full_scale > 0.0:
            raise SignalError(
                "the stream does not say the hammer's full scale: a running stream needs it to"
                " find impacts"
            )
        self.flow.blocks += 1
        self.flow.points += block.hammer.output.size
        gap = self._continuity.follow(block)
        segment = self._segment
        cuts: list[Block] = []
        if segment is None:
            segment = Segment(block)
        elif gap is not None:
            cuts += self._break_off(segment, gap)
            searched = block.first_sample if gap.is_backward else segment.searched
            segment = Segment(block)
            segment.searched = max(searched, segment.start)
        elif block.hammer.output.size:
            segment.append(block)
        self._segment = segment
        self._follow(block)
        cuts += self._search(segment, is_over=block.ends_stream)
        if block.ends_stream:
            cuts += self._cut_off(segment)
        before, _ = count_window_points(self.settings, block.sampling_rate)
        needed = min(segment.searched, segment.stop) - QUIET_LEAD * before
        segment.forget(needed if self._window is None else self._window.first)
        return tuple(cuts)

    def _break_off(self, segment: Segment, gap: Gap) -> list[Block]:
        """Search a segment that a gap ends; the baseline holds if only points are missing."""
        self.flow.gaps += 1
        was_known = self._baseline is not None
        cuts = self._search(segment, is_over=True) + self._cut_off(segment)
        is_same = gap.high > gap.low and not gap.is_backward
        if not (is_same and was_known):
            self._baseline = None
        if gap.is_backward:
            self._armings.clear()
        else:
            self.flow.missing_points += gap.high - gap.low
            if self._armings and self._armings[-1].stop is None:
                self._armings[-1].missing += gap.high - gap.low
        return cuts

    def _follow(self, block: Block) -> None:
        """Take the label of the next block of the stream."""
        current = self._armings[-1] if self._armings else None
        if current is None or current.stop is not None or current.label != block.label:
            if current is not None and current.stop is None:
                current.stop = block.first_sample
            has_hit = block.label == self._answered
            current = Arming(block.label, block.first_sample, has_hit)
            self._armings.append(current)
        if block.last:
            current.stop = block.stop
            current.is_complete, current.disarmed = True, block.disarmed

    def _search(self, segment: Segment, *, is_over: bool) -> list[Block]:
        """Return the hits whose windows have come, and the armings that ended without one."""
        cuts: list[Block] = []
        while window := self._find_window(segment, is_over=is_over):
            cuts += self._end_armings(segment, window.pulse)
            if segment.stop < window.last:
                return cuts
            self._window = None
            cuts.append(replace(_read_window(segment, window), last=True))
        return [*cuts, *self._end_armings(segment, segment.searched)]

    def _find_window(self, segment: Segment, *, is_over: bool) -> Window | None:
        """Go on searching for the hit of an arming; return its window."""
        while self._window is None:
            pulse = self.find_pulse(segment, is_over=is_over)
            if pulse is None:
                return None
            earlier = (item for item in reversed(self._armings) if item.start <= pulse)
            arming = next(earlier, self._armings[0])
            if not arming.wants_hit:
                self.flow.other_impacts += 1
                continue
            arming.has_hit, self._answered = True, arming.label
            before, _ = count_window_points(self.settings, segment.first.sampling_rate)
            first = pulse - QUIET_LEAD * before
            self._window = Window(arming.label, first, pulse, segment.searched)
        return self._window

    def find_pulse(self, segment: Segment, *, is_over: bool) -> int | None:
        """Return the next pulse, and search on behind its window from then on.

        The baseline is read at points that no block border moves.
        """
        before, length = count_window_points(self.settings, segment.first.sampling_rate)
        if self._baseline is None:
            count = segment.stop - segment.start
            if count < length and not (is_over and count):
                return None
            opening = segment.read(segment.start, segment.start + length).hammer.output
            self._baseline = compute_baseline(find_quietest(opening, before))
            self._next_baseline = segment.start + BASELINE_RECORDS * length
        while segment.searched < segment.stop:
            if segment.searched >= self._next_baseline:
                if segment.searched - before >= segment.start:
                    quiet = segment.read(segment.searched - before, segment.searched)
                    self._baseline = compute_baseline(quiet.hammer.output)
                self._next_baseline = segment.searched + BASELINE_RECORDS * length
            end = min(segment.stop, self._next_baseline)
            pulse = segment.find_pulse(self._baseline, self.settings, end)
            if pulse is not None:
                segment.searched = self._next_baseline = pulse - before + length
                return pulse
            segment.searched = end
        return None

    def _cut_off(self, segment: Segment) -> list[Block]:
        """Return the points of a hit whose end will not come, and a gap up to its end."""
        window, self._window = self._window, None
        if window is None:
            return []
        part = _read_window(segment, window)
        end = replace(part.cut(0, 0), first_sample=window.last - window.first, last=True)
        return [part, end]

    def _end_armings(self, segment: Segment, point: int) -> list[Block]:
        """Return an empty block for each arming that ended, without a hit, before a point.

        It is a gap if points are missing, which may have held the hit; else it has no trigger.
        """
        cuts = []
        while self._armings and (stop := self._armings[0].stop) is not None and stop <= point:
            arming = self._armings.popleft()
            if arming.wants_hit and arming.is_complete:
                empty = replace(
                    segment.read(arming.start, arming.start),
                    label=arming.label,
                    first_sample=arming.missing,
                    triggered=arming.missing > 0 and not arming.disarmed,
                    disarmed=arming.disarmed,
                    last=True,
                    stamp=segment.get_time(stop or arming.start),
                )
                cuts.append(empty)
        return cuts


def _read_window(segment: Segment, window: Window) -> Block:
    part = segment.read(window.first, window.last)
    first_sample = part.first_sample - window.first
    return replace(part, label=window.label, first_sample=first_sample, last=False)
