"""What the tests of the core share: hits in counts, streams of blocks, a session to strike."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.records import Block, ChannelBlock, HitLabel, Record
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.hit.detection import ImpactDetector
from impact_rig.core.hit.judging import FilteredHit, JudgedHit
from impact_rig.core.mean.mean_hit import MeanHit, TraceSum, make_mean, shift_hit
from impact_rig.core.session import Session

RATE = 1e6
FULL_SCALE = 2000.0
SCALE = FULL_SCALE / 2048
WIDTH = 200
SETUP = RigSetup(
    SampleSet((Sample("alike", 0.097), Sample("heavy", 0.297), Sample("third", 0.2)), "alike"),
    hammer_mass=0.1,
    impact_speed=0.08,
)

Counts = NDArray[np.int32]


def make_counts(
    pulses: Iterable[tuple[int, float]],
    count: int,
    *,
    noise: float = 1.0,
    offset: float = 5.0,
    seed: int = 1,
) -> Counts:
    """Return versed-sine pulses of 200 points, in counts of 12 bits, on offset and noise."""
    signal = offset + noise * np.random.default_rng(seed).standard_normal(count)
    for start, height in pulses:
        shape = height * np.sin(np.pi * np.arange(WIDTH) / WIDTH) ** 2
        part = slice(start, min(start + WIDTH, count))
        signal[part] += shape[: part.stop - part.start]
    return np.clip(np.rint(signal), -2048, 2047).astype(np.int32)


def make_blocks(
    hammer: Counts,
    specimen: Counts,
    sizes: Iterable[int],
    *,
    label: HitLabel | None = None,
    full_scale: float = FULL_SCALE,
    rate: float = RATE,
    stamp: int = 1_000,
) -> list[Block]:
    """Cut two channels of counts into the blocks of one arming, the given sizes in turn."""
    steps = list(sizes)
    blocks: list[Block] = []
    start = 0
    while start < hammer.size:
        stop = min(start + steps[len(blocks) % len(steps)], hammer.size)
        blocks.append(
            Block(
                label=label or HitLabel("steel"),
                first_sample=start,
                sampling_rate=rate,
                hammer=ChannelBlock(hammer[start:stop], SCALE, 0.0, full_scale),
                specimen=ChannelBlock(specimen[start:stop], -SCALE, 0.0, full_scale),
                last=stop == hammer.size,
                stamp=stamp + round(start / rate * 1e9),
            )
        )
        start = stop
    return blocks


def make_record(
    hammer: NDArray[np.float64],
    specimen: NDArray[np.float64] | None = None,
    *,
    pulse_index: int | None = 200,
    full_scale: float = FULL_SCALE,
    resolution: float = 0.0,
    rate: float = RATE,
    flaws: tuple[str, ...] = (),
    triggered: bool = True,
) -> Record:
    """Return a record of accelerations; the pulse counts as found where the caller says."""
    channels = [
        ChannelBlock(
            np.rint(trace / resolution).astype(np.int32) if resolution else trace,
            resolution or 1.0,
            0.0,
            full_scale,
        )
        for trace in (hammer, np.empty(0) if specimen is None else specimen)
    ]
    return Record(
        0,
        rate,
        *channels,
        HitLabel("steel"),
        triggered=triggered,
        pulse_index=pulse_index,
        flaws=flaws,
    )


def detect(blocks: Iterable[Block]) -> list[Record]:
    """Feed the blocks of a stream to a detector; return every record that comes out."""
    detector = ImpactDetector(AnalysisSettings())
    return [record for block in blocks for record in detector.feed(block)]


def strike(
    session: Session,
    sample: str,
    record: int,
    *,
    height: float = 900.0,
    size: int = 400,
    place: int = 500,
) -> tuple[JudgedHit, ...]:
    """Feed a session one hit of 200 us at 1 MHz; the sample answers with a decaying wave."""
    hammer = make_counts([(place, height)], 2500, seed=record)
    heights = (800.0, -346.0, 150.0, -65.0, 28.0)
    answer = [(place + 150 * swing, height) for swing, height in enumerate(heights)]
    specimen = make_counts(answer, 2500, seed=1000 + record)
    blocks = make_blocks(hammer, specimen, [size], label=HitLabel(sample, record))
    return tuple(hit for block in blocks for hit in session.feed(block))


def strike_series(
    session: Session, heights: list[float], sample: str = "alike", first: int = 1
) -> list[JudgedHit]:
    """Strike a sample with these heights, one record after the other."""
    return [
        hit
        for record, height in enumerate(heights, start=first)
        for hit in strike(session, sample, record, height=height, place=500 + record % 7)
    ]


def make_plain_mean(
    traces: NDArray[np.float64], rate: float, origin: int = 0, noise: float = 0.0
) -> MeanHit:
    """Return a mean hit of which nothing but its traces is known."""
    levels, nothing = np.full(len(traces), noise), np.zeros(len(traces))
    known = (1, max(origin, 1), nothing, nothing, nothing, np.zeros(2))
    return MeanHit(traces, rate, origin, levels, levels, (), *known)


def average_hits(hits: Iterable[FilteredHit]) -> MeanHit:
    """Return the mean of hits, as a series takes it."""
    shifted = [shift_hit(hit) for hit in hits]
    return make_mean(TraceSum.of(shifted), shifted)
