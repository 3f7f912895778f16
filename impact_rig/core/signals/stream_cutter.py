"""Impacts found in a running stream, and cut out of it as a trigger would have done.

Gaps are kept: a cut has them where the stream has, and nothing is put in their place.
"""

from collections import deque
from dataclasses import dataclass, replace

from impact_rig.core.errors import SignalError
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.armings import Arming, Armings
from impact_rig.core.signals.continuity import Continuity, Gap
from impact_rig.core.signals.pulse_search import PulseSearch, count_window_points
from impact_rig.core.signals.record import Block, HitLabel
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


@dataclass(frozen=True)
class _Window:
    """What is to be cut out: points `first` up to `last`, for the sake of the one at `pulse`."""

    label: HitLabel
    first: int
    pulse: int
    last: int


class StreamCutter:
    """Cuts the hit of each arming out of the running stream of one accelerometer pair.

    Feed it every block in order; it hands out the blocks of a hit as soon as its whole window has
    come: one block, or one for each piece that a gap leaves. They count from the beginning of the
    window, carry the label of the arming, and the final one is the last of its record. An arming
    that ends without an impact gives one block without a trigger; if points of it were lost, it
    gives what came before the gap, and the gap. How the stream is split into blocks changes
    nothing.

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
        self._stretches: deque[Stretch] = deque()
        self._armings = Armings()
        self._window: _Window | None = None

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
        if gap is not None:
            self._count(gap)
        if gap is not None or not self._stretches:
            self._begin_stretch(block, gap)
        stretch = self._stretches[-1]
        if count:
            stretch.append(block)
        if gap is not None:
            self._note_loss(block, gap)
        self._armings.follow(block)
        cuts: list[Block] = []
        if gap is not None and gap.is_backward:
            # Nothing more will come of what was before.
            cuts += self._cut()
            self._stretches = deque([stretch])
        while window := self._find_window(stretch):
            cuts += self._end_armings(window.pulse)
            if stretch.stop < window.last:
                break
            cuts += self._cut()
        else:
            cuts += self._end_armings(stretch.searched)
        self._forget(stretch)
        return tuple(cuts)

    def _count(self, gap: Gap) -> None:
        self.flow.gaps += 1
        if not gap.is_backward:
            self.flow.missing_points += gap.high - gap.low

    def _begin_stretch(self, block: Block, gap: Gap | None) -> None:
        """Go on behind a gap; its baseline still holds, unless another stream has begun."""
        start = block.first_sample
        is_same = gap is not None and not gap.is_backward and gap.high > gap.low
        if not is_same:
            self._baseline = None
        searched = self._stretches[-1].searched if self._stretches and is_same else start
        self._stretches.append(Stretch(block, search_from=searched))

    def _note_loss(self, block: Block, gap: Gap) -> None:
        """Keep what leads to a gap, in case that the hit of the arming lies in it."""
        if gap.is_backward:
            self._armings.rewind(block.first_sample)
        arming = self._armings.current
        if arming is None or arming.lost or not arming.wants_hit:
            return
        before, _ = count_window_points(self._settings, block.sampling_rate)
        interrupted = self._stretches[-2]
        first = max(interrupted.stop - before, interrupted.start)
        # One point more than there is: the window ends behind the gap.
        window = _Window(arming.label, first, interrupted.stop, interrupted.stop + 1)
        arming.lost = self._read_window(window)

    def _find_window(self, stretch: Stretch) -> _Window | None:
        """Search on until an impact is found that is to be cut out; return its window."""
        while self._window is None:
            pulse = self._find_pulse(stretch)
            if pulse is None:
                return None
            before, length = count_window_points(self._settings, stretch.block.sampling_rate)
            last = pulse - before + length
            stretch.searched = self._next_baseline = last
            arming = self._armings.find(pulse)
            if not arming.wants_hit:
                self.flow.other_impacts += 1
                continue
            arming.has_hit = True
            self._window = _Window(arming.label, pulse - QUIET_LEAD * before, pulse, last)
        return self._window

    def _find_pulse(self, stretch: Stretch) -> int | None:
        """Return the next pulse; the baseline is read at points that no block border moves."""
        before, length = count_window_points(self._settings, stretch.block.sampling_rate)
        if self._baseline is None:
            if stretch.stop - stretch.start < before:
                return None
            self._baseline = self._learn(stretch, stretch.start, before)
            self._next_baseline = stretch.start + BASELINE_RECORDS * length
        while stretch.searched < stretch.stop:
            if stretch.searched >= self._next_baseline:
                if stretch.searched - before >= stretch.start:
                    self._baseline = self._learn(stretch, stretch.searched - before, before)
                self._next_baseline = stretch.searched + BASELINE_RECORDS * length
            end = min(stretch.stop, self._next_baseline)
            pulse = self._search.find(stretch, self._baseline, end)
            if pulse is not None:
                return pulse
            stretch.searched = end
        return None

    def _learn(self, stretch: Stretch, first: int, count: int) -> float:
        return self._search.learn(stretch.read(first, first + count)[0])

    def _cut(self) -> tuple[Block, ...]:
        """Hand out the window."""
        window, self._window = self._window, None
        return () if window is None else self._read_window(window)

    def _read_window(self, window: _Window) -> tuple[Block, ...]:
        """Return a block for each stretch that has a part in the window, or ends it by a gap."""
        blocks: list[Block] = []
        for stretch in self._stretches:
            block = stretch.block
            first = max(stretch.start, window.first)
            last = min(stretch.stop, window.last)
            if first < last:
                hammer, specimen = stretch.read(first, last)
                overloads = stretch.find_overloads(first, last)
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
                    stamp=stretch.find_time(first),
                )
            )
            if stretch.stop >= window.last:
                break
        return (*blocks[:-1], replace(blocks[-1], last=True)) if blocks else ()

    def _end_armings(self, searched: int) -> tuple[Block, ...]:
        """Hand out what there is of armings that have ended without a hit."""
        cuts: tuple[Block, ...] = ()
        for arming in self._armings.take_ended(searched):
            if not arming.wants_hit:
                continue
            if arming.lost:
                cuts += arming.lost
            elif arming.is_complete:
                cuts += (self._make_empty(arming),)
        return cuts

    def _make_empty(self, arming: Arming) -> Block:
        """Return the block of an arming without a trigger."""
        block = self._stretches[-1].block
        return replace(
            block,
            label=arming.label,
            first_sample=0,
            hammer=replace(block.hammer, output=block.hammer.output[:0]),
            specimen=replace(block.specimen, output=block.specimen.output[:0]),
            triggered=False,
            last=True,
            stamp=self._stretches[-1].find_time(arming.stop or arming.start),
        )

    def _forget(self, stretch: Stretch) -> None:
        """Keep what the next hit may still need."""
        before, _ = count_window_points(self._settings, stretch.block.sampling_rate)
        needed = min(stretch.searched, stretch.stop) - QUIET_LEAD * before
        if self._window is not None:
            needed = self._window.first
        while len(self._stretches) > 1 and self._stretches[0].stop <= needed:
            self._stretches.popleft()
        stretch.forget(needed)
