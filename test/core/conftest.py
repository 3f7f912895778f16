"""What the tests of the core share: hits in counts, and streams of blocks."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.session import Session
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, ChannelBlock, HitLabel, Record, Trace

RATE = 1e6
FULL_SCALE = 2000.0
SCALE = FULL_SCALE / 2048
WIDTH = 200

Counts = NDArray[np.int32]
MakeCounts = Callable[..., Counts]
MakeBlocks = Callable[..., list[Block]]
MakeRecord = Callable[..., Record]
Strike = Callable[..., tuple[JudgedHit, ...]]


@pytest.fixture(scope="session")
def make_counts() -> MakeCounts:
    """Versed-sine pulses of 200 points, in counts of 12 bits at 1 MHz, on offset and noise."""

    def make(
        pulses: Iterable[tuple[int, float]],
        count: int,
        *,
        noise: float = 1.0,
        offset: float = 5.0,
        seed: int = 1,
    ) -> Counts:
        signal = offset + noise * np.random.default_rng(seed).standard_normal(count)
        for start, height in pulses:
            shape = height * np.sin(np.pi * np.arange(WIDTH) / WIDTH) ** 2
            part = slice(start, min(start + WIDTH, count))
            signal[part] += shape[: part.stop - part.start]
        return np.clip(np.rint(signal), -2048, 2047).astype(np.int32)

    return make


@pytest.fixture(scope="session")
def make_blocks() -> MakeBlocks:
    """Cut two channels of counts into the blocks of one arming, the given sizes in turn."""

    def make(
        hammer: Counts,
        specimen: Counts,
        sizes: Iterable[int],
        *,
        label: HitLabel | None = None,
        full_scale: float = FULL_SCALE,
        rate: float = RATE,
        stamp: int = 1_000,
    ) -> list[Block]:
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

    return make


@pytest.fixture(scope="session")
def make_record() -> MakeRecord:
    """Make a record of accelerations; the pulse counts as found where the caller says."""

    def make(
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
        return Record(
            label=HitLabel("steel"),
            sampling_rate=rate,
            hammer=Trace(hammer, full_scale, resolution),
            specimen=None if specimen is None else Trace(specimen, full_scale, resolution),
            pulse_index=pulse_index,
            flaws=flaws,
            triggered=triggered,
        )

    return make


@pytest.fixture(scope="session")
def detect() -> Callable[[Iterable[Block]], list[Record]]:
    """Feed the blocks of a stream to a detector; every record that comes out."""

    def run(blocks: Iterable[Block]) -> list[Record]:
        detector = ImpactDetector(AnalysisSettings())
        return [record for block in blocks for record in detector.feed(block)]

    return run


@pytest.fixture(scope="session")
def describe() -> Callable[[Record], tuple[object, ...]]:
    """Everything a record holds, to the last bit."""

    def make(record: Record) -> tuple[object, ...]:
        assert record.specimen is not None
        return (
            record.label,
            record.stamp,
            record.pulse_index,
            record.triggered,
            record.flaws,
            record.hammer.acceleration.tobytes(),
            record.specimen.acceleration.tobytes(),
        )

    return make


@pytest.fixture(scope="session")
def strike(make_counts: MakeCounts, make_blocks: MakeBlocks) -> Strike:
    """Feed a session one hit of 200 us at 1 MHz; the sample answers with a decaying wave."""

    def make(
        session: Session,
        sample: str,
        record: int,
        *,
        height: float = 900.0,
        size: int = 400,
        place: int = 500,
    ) -> tuple[JudgedHit, ...]:
        hammer = make_counts([(place, height)], 2500, seed=record)
        heights = (800.0, -346.0, 150.0, -65.0, 28.0)
        answer = [(place + 150 * swing, height) for swing, height in enumerate(heights)]
        specimen = make_counts(answer, 2500, seed=1000 + record)
        blocks = make_blocks(hammer, specimen, [size], label=HitLabel(sample, record))
        return tuple(hit for block in blocks for hit in session.feed(block))

    return make
