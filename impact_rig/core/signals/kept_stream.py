"""What is kept of a running stream, and cut into the blocks of a record.

Gaps are kept: a cut has them where the stream has, and nothing is put in their place.
"""

from collections import deque
from dataclasses import dataclass, replace

from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.core.signals.stretch import Stretch


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


class KeptStream:
    """The newest stretches of a stream, as far as a hit may still need them."""

    def __init__(self) -> None:
        self._stretches: deque[Stretch] = deque()

    @property
    def newest(self) -> Stretch | None:
        """The stretch that goes on; None: nothing has come."""
        return self._stretches[-1] if self._stretches else None

    @property
    def interrupted(self) -> Stretch:
        """The stretch before the newest; there must be one."""
        return self._stretches[-2]

    def begin(self, block: Block, search_from: int) -> Stretch:
        """Return a new stretch for a block and those after it, see `Stretch`."""
        self._stretches.append(Stretch(block, search_from))
        return self._stretches[-1]

    def keep_newest(self) -> None:
        """Forget all stretches but the newest."""
        self._stretches = deque([self._stretches[-1]])

    def forget(self, point: int) -> None:
        """Forget what lies before a point, as far as it came in one piece."""
        while len(self._stretches) > 1 and self._stretches[0].stop <= point:
            self._stretches.popleft()
        self._stretches[-1].forget(point)

    def read(self, window: Window) -> tuple[Block, ...]:
        """Return a block for each stretch that has a part in a window, or ends it by a gap."""
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
        stretch = self._stretches[-1]
        block = stretch.block
        return replace(
            block,
            label=label,
            first_sample=0,
            hammer=replace(block.hammer, output=block.hammer.output[:0]),
            specimen=replace(block.specimen, output=block.specimen.output[:0]),
            triggered=False,
            last=True,
            stamp=stretch.find_time(point),
        )
