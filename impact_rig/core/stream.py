"""Cuts impacts out of a running stream."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.detection import (
    RELATIVE_LEVEL,
    Continuity,
    Gap,
    PulseSearch,
    Segment,
    compute_median,
    count_window_points,
    find_quietest,
)
from impact_rig.core.errors import SignalError
from impact_rig.core.records import NOT_ARMED, Block, HitLabel
from impact_rig.core.setup import AnalysisSettings


@dataclass
class Arming:
    """A part of the stream with one label; it may be that of no arming.

    Attributes
    ----------
    label : HitLabel
        Of its blocks.
    start : int
        Its first point.
    stop : int or None
        Behind its last point; None: it goes on.
    is_complete : bool
        It ended by itself, and was not given up.
    has_hit : bool
        Its hit was found.
    lost : tuple of Block
        What to hand out if the hit may have been lost in a gap.
    """

    label: HitLabel
    start: int
    stop: int | None = None
    is_complete: bool = False
    has_hit: bool = False
    lost: tuple[Block, ...] = ()

    @property
    def wants_hit(self) -> bool:
        """Whether an impact in it is its hit."""
        return not self.has_hit and self.label.record != NOT_ARMED.record


class Armings:
    """The armings of a running stream that have not been dealt with, in their order."""

    def __init__(self) -> None:
        self._armings: deque[Arming] = deque()
        self._answered = NOT_ARMED

    @property
    def current(self) -> Arming | None:
        """The part of the stream that goes on; None: the last one has ended."""
        last = self._armings[-1] if self._armings else None
        return last if last is not None and last.stop is None else None

    def follow(self, block: Block) -> None:
        """Take the labels of the next block of the stream."""
        current, start = self.current, block.first_sample
        if current is None or current.label != block.label:
            if current is not None:
                current.stop = start
            # An end alone is that of an arming before: its hit may have been found.
            is_end = not block.hammer.output.size
            current = Arming(block.label, start, has_hit=is_end and block.label == self._answered)
            self._armings.append(current)
        if block.last:
            current.stop = start + block.hammer.output.size
            current.is_complete = True

    def answer(self, arming: Arming) -> None:
        """Note that the hit of an arming was found."""
        arming.has_hit, self._answered = True, arming.label

    def rewind(self, point: int) -> None:
        """Let what is known reach back to where points are repeated, or counted anew."""
        for arming in self._armings:
            arming.start = min(arming.start, point)
            if arming.stop is not None:
                arming.stop = min(arming.stop, point)

    def find(self, point: int) -> Arming:
        """Return what a point belongs to."""
        return next(
            (item for item in reversed(self._armings) if item.start <= point), self._armings[0]
        )

    def take_ended(self, point: int) -> Iterator[Arming]:
        """Yield, and forget, those that ended before a point."""
        while self._armings and (stop := self._armings[0].stop) is not None and stop <= point:
            yield self._armings.popleft()


@dataclass(frozen=True)
class Window:
    """What is to be cut out.

    Attributes
    ----------
    label : HitLabel
        Whose hit it is.
    first, last : int
        First point, and the one behind the last.
    pulse : int
        The point for whose sake it is cut out.
    """

    label: HitLabel
    first: int
    pulse: int
    last: int


class StreamBuffer:
    """The newest segments of a stream, as far as a hit may still need them."""

    def __init__(self) -> None:
        self._segments: deque[Segment] = deque()

    @property
    def newest(self) -> Segment | None:
        """The segment that goes on; None: nothing has come."""
        return self._segments[-1] if self._segments else None

    @property
    def interrupted(self) -> Segment:
        """The segment before the newest; there must be one."""
        return self._segments[-2]

    def begin(self, block: Block, search_from: int) -> Segment:
        """Return a new segment for a block and those after it, see `Segment`."""
        self._segments.append(Segment(block, search_from))
        return self._segments[-1]

    def keep_newest(self) -> None:
        """Forget all segments but the newest."""
        self._segments = deque([self._segments[-1]])

    def forget(self, point: int) -> None:
        """Forget what lies before a point, as far as it came in one piece."""
        while len(self._segments) > 1 and self._segments[0].stop <= point:
            self._segments.popleft()
        self._segments[-1].forget(point)

    def read(self, window: Window) -> tuple[Block, ...]:
        """Return a block for each segment that has a part in a window, or ends it by a gap."""
        blocks: list[Block] = []
        for segment in self._segments:
            block = segment.block
            first = max(segment.start, window.first)
            last = min(segment.stop, window.last)
            if first < last:
                hammer, specimen = segment.read(first, last)
                overloads = segment.get_overloads(first, last)
            elif blocks:
                # Nothing of the window, but it says where the stream goes on: the gap shows.
                hammer, specimen = block.hammer.output[:0], block.specimen.output[:0]
                overloads = (False, False)
            else:
                continue
            blocks.append(
                Block(
                    label=window.label,
                    first_sample=first - window.first,
                    sampling_rate=block.sampling_rate,
                    hammer=replace(block.hammer, output=hammer, overloaded=overloads[0]),
                    specimen=replace(block.specimen, output=specimen, overloaded=overloads[1]),
                    stamp=segment.get_time(first),
                    origin=block.origin,
                )
            )
            if segment.stop >= window.last:
                break
        return (*blocks[:-1], replace(blocks[-1], last=True)) if blocks else ()

    def read_cut_off(self, window: Window) -> tuple[Block, ...]:
        """Return the same of a window whose end will not come: it ends by a gap."""
        *others, final = self.read(window)
        end = replace(
            self.make_empty(window.label, window.last),
            first_sample=window.last - window.first,
            triggered=True,
        )
        return (*others, replace(final, last=False), end)

    def make_empty(self, label: HitLabel, point: int) -> Block:
        """Return the block of an arming that ends at a point without a trigger."""
        segment = self._segments[-1]
        block = segment.block
        return replace(
            block,
            label=label,
            first_sample=0,
            hammer=replace(block.hammer, output=block.hammer.output[:0]),
            specimen=replace(block.specimen, output=block.specimen.output[:0]),
            triggered=False,
            last=True,
            stamp=segment.get_time(point),
        )


NANOSECONDS = 1_000_000_000
"""In a second [ns]."""
QUIET_LEAD = 2
"""What a cut holds before its impact, in pre-triggers [-], our choice: one for the record, and one
before it, out of which the record's own baseline is read."""
BASELINE_RECORDS = 100
"""How often the baseline is read anew, in record durations [-], our choice: five times a second,
for what drifts with the temperature and not with the hits."""


@dataclass
class StreamFlow:
    """What has come by, counted.

    Attributes
    ----------
    blocks, points : int
        Received, points per channel.
    gaps : int
        Places where the stream did not go on as it should.
    missing_points : int
        That were lost, per channel.
    other_impacts : int
        Impacts while not armed, or after the hit of the arming.
    """

    blocks: int = 0
    points: int = 0
    gaps: int = 0
    missing_points: int = 0
    other_impacts: int = 0


def cut_impacts(block: Block, settings: AnalysisSettings) -> list[tuple[int, Block]]:
    """Cut every impact out of a long record, as out of the running stream.

    Parameters
    ----------
    block : Block
        The record. Where it does not say the full scale, an impact has a tenth of the height of
        the largest.
    settings : AnalysisSettings
        `pre_trigger`, `record_duration` and `detection_level` are used.

    Returns
    -------
    list of tuple of int and Block
        First point in the record of each hit, and the hit.
    """
    hammer, count = block.hammer, block.hammer.output.size
    full_scale = hammer.full_scale
    if not full_scale > 0.0:
        height = float(np.abs(hammer.output - compute_median(hammer.output)).max())
        full_scale = RELATIVE_LEVEL * height * abs(hammer.scale) / settings.detection_level
        if not 0.0 < full_scale < np.inf:
            return []
    before, length = count_window_points(settings, block.sampling_rate)
    stream = replace(
        block, hammer=replace(hammer, full_scale=full_scale), last=False, stamp=NANOSECONDS
    )
    cutter = StreamCutter(settings)
    found: list[Block] = []
    # Each piece is a segment of its own, so short that the window of a hit covers the rest of it.
    for number, piece in enumerate(stream.split(max(length - before, 1)), start=1):
        found += cutter.feed(replace(piece, label=HitLabel("", record=number)))
    found += cutter.feed(replace(stream.cut(count, count), label=NOT_ARMED, last=True))
    hits = []
    for hit in found:
        if hit.hammer.output.size:
            first = round((hit.stamp - NANOSECONDS) * 1e-9 * block.sampling_rate)
            whole = block.cut(first, first + hit.hammer.output.size)
            hits.append((first, replace(whole, first_sample=hit.first_sample, last=True)))
    return hits


class StreamCutter:
    """Cuts the hit of each arming out of the running stream of one accelerometer pair.

    Feed it every block in order; it hands out the blocks of a hit as soon as its whole window has
    come: one block, or one for each piece that a gap leaves. They count from the beginning of the
    window, carry the label of the arming, and the final one is the last of its record. An arming
    that ends without an impact gives one block without a trigger; if points of it were lost, it
    gives what came before the gap, and the gap. A hit that the end of the stream cuts off is
    handed out with what there is of it. How the stream is split into blocks changes nothing.

    A stream may begin within a hit: its first baseline is that of the quietest part of its first
    record duration, and all of it is searched.

    Parameters
    ----------
    settings : AnalysisSettings
        `pre_trigger`, `record_duration` and `detection_level` are used.

    Attributes
    ----------
    flow : StreamFlow
        What has come by.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self.flow = StreamFlow()
        self._settings = settings
        self._continuity = Continuity(expected=None)
        self._search = PulseSearch(settings)
        self._baseline: float | None = None
        self._next_baseline = 0
        self._buffer = StreamBuffer()
        self._armings = Armings()
        self._window: Window | None = None

    def feed(self, block: Block) -> tuple[Block, ...]:
        """Take the next block of the stream, and return the blocks of the hit that it completes.

        Raises
        ------
        SignalError
            If the stream does not say the hammer's full scale, without which an impact cannot be
            told from what is none while the stream goes on.
        """
        if not block.hammer.full_scale > 0.0:
            raise SignalError(
                "the stream does not say the hammer's full scale: a running stream needs it to"
                " find impacts"
            )
        count = block.hammer.output.size
        self.flow.blocks += 1
        self.flow.points += count
        gap = self._continuity.follow(block)
        cuts: list[Block] = []
        segment = self._buffer.newest
        if gap is not None:
            self._count(gap)
            cuts += self._finish(segment)
        if gap is not None or segment is None:
            segment = self._begin_segment(block, gap)
        if count:
            segment.append(block)
        if gap is not None:
            self._note_loss(block, gap)
        self._armings.follow(block)
        if gap is not None and gap.is_backward:
            # Nothing more will come of what was before.
            cuts += self._cut()
            self._buffer.keep_newest()
        cuts += self._search_on(segment, is_over=block.ends_stream)
        if block.ends_stream and self._window is not None:
            window, self._window = self._window, None
            cuts += self._buffer.read_cut_off(window)
        self._forget(segment)
        return tuple(cuts)

    def _search_on(self, segment: Segment, *, is_over: bool) -> list[Block]:
        """Hand out the hits whose windows have come, and what has ended without one."""
        cuts: list[Block] = []
        while window := self._find_window(segment, is_over=is_over):
            cuts += self._end_armings(window.pulse)
            if segment.stop < window.last:
                return cuts
            cuts += self._cut()
        return [*cuts, *self._end_armings(segment.searched)]

    def _finish(self, segment: Segment | None) -> list[Block]:
        """Search what a gap has cut off; of less than an opening no baseline is kept."""
        if segment is None:
            return []
        is_opening = self._baseline is None
        cuts = self._search_on(segment, is_over=True)
        if is_opening:
            self._baseline = None
        return cuts

    def _count(self, gap: Gap) -> None:
        self.flow.gaps += 1
        if not gap.is_backward:
            self.flow.missing_points += gap.high - gap.low

    def _begin_segment(self, block: Block, gap: Gap | None) -> Segment:
        """Go on behind a gap; its baseline still holds, unless another stream has begun."""
        before, start = self._buffer.newest, block.first_sample
        is_same = gap is not None and not gap.is_backward and gap.high > gap.low
        if not is_same:
            self._baseline = None
        searched = before.searched if before is not None and is_same else start
        return self._buffer.begin(block, search_from=searched)

    def _note_loss(self, block: Block, gap: Gap) -> None:
        """Keep what leads to a gap, in case that the hit of the arming lies in it."""
        if gap.is_backward:
            self._armings.rewind(block.first_sample)
        arming = self._armings.current
        if arming is None or arming.lost or not arming.wants_hit:
            return
        before, _ = count_window_points(self._settings, block.sampling_rate)
        interrupted = self._buffer.interrupted
        first = max(interrupted.stop - before, interrupted.start)
        # One point more than there is: the window ends behind the gap.
        window = Window(arming.label, first, interrupted.stop, interrupted.stop + 1)
        arming.lost = self._buffer.read(window)

    def _find_window(self, segment: Segment, *, is_over: bool) -> Window | None:
        """Search on until an impact is found that is to be cut out; return its window."""
        while self._window is None:
            pulse = self._find_pulse(segment, is_over=is_over)
            if pulse is None:
                return None
            before, length = count_window_points(self._settings, segment.block.sampling_rate)
            last = pulse - before + length
            segment.searched = self._next_baseline = last
            arming = self._armings.find(pulse)
            if not arming.wants_hit:
                self.flow.other_impacts += 1
                continue
            self._armings.answer(arming)
            self._window = Window(arming.label, pulse - QUIET_LEAD * before, pulse, last)
        return self._window

    def _find_pulse(self, segment: Segment, *, is_over: bool) -> int | None:
        """Return the next pulse; the baseline is read at points that no block border moves."""
        before, length = count_window_points(self._settings, segment.block.sampling_rate)
        if self._baseline is None:
            count = segment.stop - segment.start
            if count < length and not (is_over and count):
                return None
            opening = segment.read(segment.start, segment.start + length)[0]
            self._baseline = self._search.learn(find_quietest(opening, before))
            self._next_baseline = segment.start + BASELINE_RECORDS * length
        while segment.searched < segment.stop:
            if segment.searched >= self._next_baseline:
                if segment.searched - before >= segment.start:
                    quiet = segment.read(segment.searched - before, segment.searched)[0]
                    self._baseline = self._search.learn(quiet)
                self._next_baseline = segment.searched + BASELINE_RECORDS * length
            end = min(segment.stop, self._next_baseline)
            pulse = self._search.find(segment, self._baseline, end)
            if pulse is not None:
                return pulse
            segment.searched = end
        return None

    def _cut(self) -> tuple[Block, ...]:
        """Hand out the window."""
        window, self._window = self._window, None
        return () if window is None else self._buffer.read(window)

    def _end_armings(self, searched: int) -> tuple[Block, ...]:
        """Hand out what there is of armings that have ended without a hit."""
        cuts: tuple[Block, ...] = ()
        for arming in self._armings.take_ended(searched):
            if not arming.wants_hit:
                continue
            if arming.lost:
                cuts += arming.lost
            elif arming.is_complete:
                cuts += (self._buffer.make_empty(arming.label, arming.stop or arming.start),)
        return cuts

    def _forget(self, segment: Segment) -> None:
        """Keep what the next hit may still need."""
        before, _ = count_window_points(self._settings, segment.block.sampling_rate)
        needed = min(segment.searched, segment.stop) - QUIET_LEAD * before
        if self._window is not None:
            needed = self._window.first
        self._buffer.forget(needed)
