"""Impacts found in a running stream, and cut out of it as a trigger would have done."""

from dataclasses import dataclass

from impact_rig.core.errors import SignalError
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.armings import Armings
from impact_rig.core.signals.continuity import Continuity, Gap
from impact_rig.core.signals.kept_stream import KeptStream, Window
from impact_rig.core.signals.pulse_search import (
    PulseSearch,
    count_window_points,
    find_quietest,
)
from impact_rig.core.signals.record import Block
from impact_rig.core.signals.stretch import Stretch

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
        self._kept = KeptStream()
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
        stretch = self._kept.newest
        if gap is not None:
            self._count(gap)
            cuts += self._finish(stretch)
        if gap is not None or stretch is None:
            stretch = self._begin_stretch(block, gap)
        if count:
            stretch.append(block)
        if gap is not None:
            self._note_loss(block, gap)
        self._armings.follow(block)
        if gap is not None and gap.is_backward:
            # Nothing more will come of what was before.
            cuts += self._cut()
            self._kept.keep_newest()
        cuts += self._search_on(stretch, is_over=block.ends_stream)
        if block.ends_stream and self._window is not None:
            window, self._window = self._window, None
            cuts += self._kept.read_cut_off(window)
        self._forget(stretch)
        return tuple(cuts)

    def _search_on(self, stretch: Stretch, *, is_over: bool) -> list[Block]:
        """Hand out the hits whose windows have come, and what has ended without one."""
        cuts: list[Block] = []
        while window := self._find_window(stretch, is_over=is_over):
            cuts += self._end_armings(window.pulse)
            if stretch.stop < window.last:
                return cuts
            cuts += self._cut()
        return [*cuts, *self._end_armings(stretch.searched)]

    def _finish(self, stretch: Stretch | None) -> list[Block]:
        """Search what a gap has cut off; of less than an opening no baseline is kept."""
        if stretch is None:
            return []
        is_opening = self._baseline is None
        cuts = self._search_on(stretch, is_over=True)
        if is_opening:
            self._baseline = None
        return cuts

    def _count(self, gap: Gap) -> None:
        self.flow.gaps += 1
        if not gap.is_backward:
            self.flow.missing_points += gap.high - gap.low

    def _begin_stretch(self, block: Block, gap: Gap | None) -> Stretch:
        """Go on behind a gap; its baseline still holds, unless another stream has begun."""
        before, start = self._kept.newest, block.first_sample
        is_same = gap is not None and not gap.is_backward and gap.high > gap.low
        if not is_same:
            self._baseline = None
        searched = before.searched if before is not None and is_same else start
        return self._kept.begin(block, search_from=searched)

    def _note_loss(self, block: Block, gap: Gap) -> None:
        """Keep what leads to a gap, in case that the hit of the arming lies in it."""
        if gap.is_backward:
            self._armings.rewind(block.first_sample)
        arming = self._armings.current
        if arming is None or arming.lost or not arming.wants_hit:
            return
        before, _ = count_window_points(self._settings, block.sampling_rate)
        interrupted = self._kept.interrupted
        first = max(interrupted.stop - before, interrupted.start)
        # One point more than there is: the window ends behind the gap.
        window = Window(arming.label, first, interrupted.stop, interrupted.stop + 1)
        arming.lost = self._kept.read(window)

    def _find_window(self, stretch: Stretch, *, is_over: bool) -> Window | None:
        """Search on until an impact is found that is to be cut out; return its window."""
        while self._window is None:
            pulse = self._find_pulse(stretch, is_over=is_over)
            if pulse is None:
                return None
            before, length = count_window_points(self._settings, stretch.block.sampling_rate)
            last = pulse - before + length
            stretch.searched = self._next_baseline = last
            arming = self._armings.find(pulse)
            if not arming.wants_hit:
                self.flow.other_impacts += 1
                continue
            self._armings.answer(arming)
            self._window = Window(arming.label, pulse - QUIET_LEAD * before, pulse, last)
        return self._window

    def _find_pulse(self, stretch: Stretch, *, is_over: bool) -> int | None:
        """Return the next pulse; the baseline is read at points that no block border moves."""
        before, length = count_window_points(self._settings, stretch.block.sampling_rate)
        if self._baseline is None:
            count = stretch.stop - stretch.start
            if count < length and not (is_over and count):
                return None
            opening = stretch.read(stretch.start, stretch.start + length)[0]
            self._baseline = self._search.learn(find_quietest(opening, before))
            self._next_baseline = stretch.start + BASELINE_RECORDS * length
        while stretch.searched < stretch.stop:
            if stretch.searched >= self._next_baseline:
                if stretch.searched - before >= stretch.start:
                    quiet = stretch.read(stretch.searched - before, stretch.searched)[0]
                    self._baseline = self._search.learn(quiet)
                self._next_baseline = stretch.searched + BASELINE_RECORDS * length
            end = min(stretch.stop, self._next_baseline)
            pulse = self._search.find(stretch, self._baseline, end)
            if pulse is not None:
                return pulse
            stretch.searched = end
        return None

    def _cut(self) -> tuple[Block, ...]:
        """Hand out the window."""
        window, self._window = self._window, None
        return () if window is None else self._kept.read(window)

    def _end_armings(self, searched: int) -> tuple[Block, ...]:
        """Hand out what there is of armings that have ended without a hit."""
        cuts: tuple[Block, ...] = ()
        for arming in self._armings.take_ended(searched):
            if not arming.wants_hit:
                continue
            if arming.lost:
                cuts += arming.lost
            elif arming.is_complete:
                cuts += (self._kept.make_empty(arming.label, arming.stop or arming.start),)
        return cuts

    def _forget(self, stretch: Stretch) -> None:
        """Keep what the next hit may still need."""
        before, _ = count_window_points(self._settings, stretch.block.sampling_rate)
        needed = min(stretch.searched, stretch.stop) - QUIET_LEAD * before
        if self._window is not None:
            needed = self._window.first
        self._kept.forget(needed)
