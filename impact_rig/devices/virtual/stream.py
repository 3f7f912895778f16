"""The running stream of the virtual rig: noise at rest without end, and hits laid into it."""

from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from impact_rig.core.checks import check_between
from impact_rig.core.signals.record import ChannelBlock, RawArray
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.digitizer import (
    CountArray,
    DigitizerSettings,
    digitize,
    find_scale,
)
from impact_rig.devices.virtual.rig import VirtualHit

MOST_NOISE_BLOCKS = 50
"""Different blocks of noise [-], our choice: drawn once and handed out in turn, so that a fast
stream costs no more than handing them out. What a recorder compresses at a time holds none
twice."""
MOST_NOISE_POINTS = 2_500_000
"""The same in points per channel, where blocks are long: 20 MB in all."""
FEWEST_NOISE_BLOCKS = 2


@dataclass(frozen=True)
class _LaidHit:
    """A hit's record in the stream, from a point on."""

    point: int
    hit: VirtualHit

    @property
    def stop(self) -> int:
        return self.point + self.hit.hammer.output.size


class VirtualStream:
    """What the digitizer delivers, block by block, whether anything happens or not.

    Blocks are counted from 0 and may be asked for in rising order only: a hit is forgotten when
    the stream has passed it.

    Parameters
    ----------
    settings : DigitizerSettings
        The acquisition chain; `drift`, which belongs to a record, is left out between hits.
    block_size : int
        Points per block.
    seed : int
        Of the noise.

    Raises
    ------
    ParameterError
        If the block size is below one point.
    """

    def __init__(self, settings: DigitizerSettings, block_size: int, seed: int) -> None:
        check_between("stream block size", block_size, 1, 10_000_000)
        self.block_size = block_size
        self._settings = replace(settings, drift=0.0)
        fitting = max(MOST_NOISE_POINTS // block_size, FEWEST_NOISE_BLOCKS)
        generator = np.random.default_rng(np.random.SeedSequence((seed, crc32(b"stream"))))
        self.noise = tuple(
            tuple(
                self._draw_noise(full_scale, generator)
                for full_scale in (settings.hammer_full_scale, settings.specimen_full_scale)
            )
            for _ in range(min(fitting, MOST_NOISE_BLOCKS))
        )
        """Blocks without a hit, hammer and sample: block `n` of the stream is `n` modulo their
        number."""
        self._hits: list[_LaidHit] = []

    def _draw_noise(self, full_scale: float, generator: np.random.Generator) -> ChannelBlock:
        rest = np.zeros(self.block_size)
        counts = digitize(rest, full_scale, self._settings, generator)
        counts.setflags(write=False)
        return ChannelBlock(counts, find_scale(full_scale, self._settings.bits), 0.0, full_scale)

    def lay(self, hit: VirtualHit, point: int) -> None:
        """Let the record of a hit begin at a point of the stream; one without a trigger has none.

        Parameters
        ----------
        hit : VirtualHit
            As the virtual rig struck it.
        point : int
            Where its record begins, not before what has been handed out.
        """
        if Fault.MISSED_TRIGGER not in hit.faults:
            self._hits.append(_LaidHit(point, hit))

    def has_hit(self, number: int) -> bool:
        """Return whether a block holds a part of a hit; forget hits that lie before it."""
        if not self._hits:
            return False
        first = number * self.block_size
        self._hits = [laid for laid in self._hits if laid.stop > first]
        return any(laid.point < first + self.block_size for laid in self._hits)

    def is_lost(self, number: int) -> bool:
        """Return whether a block is lost on its way: the one with the middle of such a hit."""
        return any(
            Fault.LOST_BLOCK in laid.hit.faults
            and (laid.point + laid.stop) // 2 // self.block_size == number
            for laid in self._hits
        )

    def read(self, number: int) -> tuple[ChannelBlock, ChannelBlock]:
        """Return hammer and sample of a block, with the hits in it."""
        hammer, specimen = self.noise[number % len(self.noise)]
        if not self.has_hit(number):
            return hammer, specimen
        first = number * self.block_size
        return (
            _lay_into(hammer, [(laid.point - first, laid.hit.hammer) for laid in self._hits]),
            _lay_into(specimen, [(laid.point - first, laid.hit.specimen) for laid in self._hits]),
        )


def _lay_into(noise: ChannelBlock, records: list[tuple[int, ChannelBlock]]) -> ChannelBlock:
    """Return a block of noise with records, each from its own point on, in place of it."""
    counts: CountArray = np.array(noise.output, dtype=np.int32)
    for point, record in records:
        low, high = max(point, 0), min(point + record.output.size, counts.size)
        if low < high:
            part: RawArray = record.output[low - point : high - point]
            counts[low:high] = part
    counts.setflags(write=False)
    return replace(noise, output=counts)
