"""The input monitor: levels of each channel, and the range and trigger level that they suggest."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impact_rig.core.given.errors import check_not_negative
from impact_rig.core.given.quantity import describe
from impact_rig.core.given.records import Block, ChannelBlock

HIT = 20.0
"""A peak so many times the noise is a hit and no noise [-], our choice."""
ABOVE_NOISE = 10.0
"""Where a trigger level lies [-]: noise of a million points reaches five times its deviation."""


@dataclass(frozen=True)
class InputLevel:
    """Level of one channel while nothing is recorded."""

    # Median and standard deviation, the medians of short blocks [m/s^2]; a noise of 0: not known.
    zero: float = 0.0
    noise: float = field(default=0.0, metadata=describe("m/s^2"))
    # Largest distance from zero, either sign [m/s^2].
    peak: float = field(default=0.0, metadata=describe("m/s^2"))
    # Largest value, either sign, that can be shown [m/s^2]; 0: not known.
    full_scale: float = field(default=0.0, metadata=describe("m/s^2"))
    overloaded: bool = False  # at the rail

    def __post_init__(self) -> None:
        """Refuse what cannot be shown."""
        for name in ("noise", "peak", "full_scale"):
            check_not_negative(name, getattr(self, name), "m/s^2")

    def hold(self, before: "InputLevel") -> "InputLevel":
        """Return this level with the peak of one before, if that was larger."""
        overloaded = self.overloaded or before.overloaded
        return replace(self, peak=max(self.peak, before.peak), overloaded=overloaded)

    @property
    def has_hit(self) -> bool:
        """Whether its peak is more than noise."""
        return self.peak > HIT * self.noise


@dataclass(frozen=True)
class InputLevels:
    """Levels of the channels: the hammer's, then the sample's where it is measured."""

    channels: tuple[InputLevel, ...] = ()  # empty: the monitor does not run


class LevelMeter:
    """Measures a running source: one thread adds its blocks, another reads the levels."""

    def __init__(self) -> None:
        self._blocks: list[tuple[InputLevel, ...]] = []

    def add(self, block: Block) -> None:
        """Take a block; one without points, or with some that are not finite, has no levels."""
        channels = block.channels if block.hammer.output.size else ()
        extremes = [value for channel in channels for value in channel.extremes]
        if extremes and np.isfinite(extremes).all():
            self._blocks.append(tuple(map(_measure, channels)))

    def read(self) -> InputLevels:
        """Return the levels since they were read last; of no block none."""
        blocks, self._blocks = self._blocks, []
        return InputLevels(tuple(map(_join, zip(*blocks, strict=False))))


def _measure(channel: ChannelBlock) -> InputLevel:
    low, high = channel.extremes
    # Not the mean, which a hit moves; of every 16th point, as fast.
    zero = float(np.median(channel.acceleration[::16]))
    return InputLevel(
        zero=zero,
        noise=float(channel.acceleration.std()),
        peak=max(high - zero, zero - low),
        full_scale=channel.full_scale,
        overloaded=channel.overloaded,
    )


def _join(levels: tuple[InputLevel, ...]) -> InputLevel:
    """Return the levels of several blocks as one: a hit is in few of them."""
    zeros = [level.zero for level in levels]
    zero = float(np.median(zeros))
    return InputLevel(
        zero=zero,
        noise=float(np.median([level.noise for level in levels])),
        peak=max(level.peak + abs(level.zero - zero) for level in levels),
        full_scale=levels[-1].full_scale,
        overloaded=any(level.overloaded for level in levels),
    )


def suggest_range(peak: float) -> float:
    """Return a full scale that a hit of this peak fills by half [m/s^2], in two digits."""
    digit = 10.0 ** (math.floor(math.log10(2.0 * peak)) - 1)
    return math.ceil(2.0 * peak / digit) * digit


def suggest_trigger_level(peak: float, noise: float) -> float:
    """Return a level that noise never reaches and every hit does [m/s^2]; NaN: there is none."""
    level = max(0.1 * peak, ABOVE_NOISE * noise)
    return level if level <= 0.5 * peak else math.nan
