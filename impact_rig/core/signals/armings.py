"""Which part of a running stream belongs to which arming."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from impact_rig.core.signals.record import NOT_ARMED, Block, HitLabel


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
