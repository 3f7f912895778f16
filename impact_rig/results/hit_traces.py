"""Blocks of one record joined for the eye, the line broken where points are missing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import Block, ChannelBlock, FloatArray, HitLabel

Float32Array = NDArray[np.float32]

LARGEST_RECORD = 1_000_000
"""Most points of a record that are shown [-], our choice: 0.4 s at the paper's rate, two hundred
times its record. What follows is left out of the view only."""


@dataclass(frozen=True)
class Calibration:
    """How the output of one channel becomes acceleration: scale times output plus offset."""

    name: str  # "hammer" or "sample"
    sampling_rate: float  # [Hz]
    is_counted: bool  # the output is counts of a digitizer
    scale: float  # per unit of the output [m/s^2]
    offset: float  # at zero output [m/s^2]
    full_scale: float  # largest acceleration that it can show, either sign [m/s^2]; 0: not known


@dataclass(frozen=True)
class HitTraces:
    """Both channels of one record."""

    label: HitLabel
    time: FloatArray  # shape (n,), from the first point that came [s]
    # Shape (n, 2): hammer and sample [m/s^2]. A row of NaN breaks the line at a gap; a sample that
    # was not measured is NaN throughout.
    values: Float32Array
    calibrations: tuple[Calibration, ...] = ()  # of the channels that were measured


class TraceAssembler:
    """Joins the blocks of a record and hands them out with its last one.

    A record that is overtaken by the next one before its last block came is dropped.
    """

    def __init__(self) -> None:
        self._blocks: list[Block] = []
        self._length = 0

    def feed(self, block: Block) -> HitTraces | None:
        """Take the next block; return the record's traces if it was the last one."""
        if self._blocks and self._blocks[0].label.record != block.label.record:
            self._blocks, self._length = [], 0
        if self._length < LARGEST_RECORD:
            self._blocks.append(block)
            self._length += block.hammer.output.size
        if not block.last:
            return None
        blocks, self._blocks, self._length = self._blocks, [], 0
        return _join(blocks)


def _join(blocks: list[Block]) -> HitTraces:
    times: list[FloatArray] = []
    rows: list[Float32Array] = []
    origin = blocks[0].first_sample
    expected = None
    filled = [block for block in blocks if block.hammer.output.size]
    for block in filled:
        count = block.hammer.output.size
        first = block.first_sample - origin
        if expected is not None and first != expected:
            times.append(np.array([expected / block.sampling_rate]))
            rows.append(np.full((1, 2), np.nan, dtype=np.float32))
        times.append((first + np.arange(count)) / block.sampling_rate)
        hammer = _scale(block.hammer)
        specimen = _scale(block.specimen) if block.has_specimen else np.full_like(hammer, np.nan)
        rows.append(np.stack([hammer, specimen], axis=1))
        expected = first + count
    return HitTraces(
        label=blocks[0].label,
        time=np.concatenate(times) if times else np.empty(0),
        values=np.concatenate(rows) if rows else np.empty((0, 2), dtype=np.float32),
        calibrations=next(map(_list_calibrations, filled), ()),
    )


def _list_calibrations(block: Block) -> tuple[Calibration, ...]:
    return tuple(
        Calibration(
            name,
            block.sampling_rate,
            channel.resolution > 0.0,
            channel.scale,
            channel.offset,
            channel.full_scale,
        )
        for name, channel in (("hammer", block.hammer), ("sample", block.specimen))
        if channel.output.size
    )


def _scale(channel: ChannelBlock) -> Float32Array:
    # Calibrated in double, rounded once: a peak is right to six digits.
    return (channel.output * channel.scale + channel.offset).astype(np.float32)
