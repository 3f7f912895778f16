"""What is done for each hit, beside the low-pass of its traces alone."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.timing import compare_times, divide
from impact_rig.core.hits.hit import judge_hit
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.filtering import FILTER_ORDER
from impact_rig.core.signals.record import Block, FloatArray, HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

BLOCK_SIZE = 1000
"""Of each channel [points]: as the accelerometer node sends them."""
SAMPLING_RATE = VirtualRigSettings().digitizer.sampling_rate
CUTOFF = PAPER_SETUP.analysis.cutoff_frequency
"""Of the traces and of the low-pass [Hz]: the paper's."""
HITS = 24
"""In one turn [-], our choice: two of each of the paper's samples, tens of milliseconds."""
LARGEST_COST = 2.0
"""Over that of the low-pass [-], as asked for."""
LONGEST_TIME = 1.0
"""Of one hit [ms], as asked for."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time hits from blocks to verdicts, in the core alone, as all of its users do it."""
    streams = strike_hits(HITS)
    traces = [read_traces(blocks) for blocks in streams]
    sections = design_sections()
    bench.report(0, 1)
    ours, peers = compare_times(
        lambda: count_accepted(streams), lambda: filter_all(traces, sections), bench.extent.repeats
    )
    return (
        Figure(
            "time over that of the low-pass",
            divide(ours, peers),
            goal=at_most(LARGEST_COST),
            note=f"scipy.signal.sosfiltfilt of both channels, {1e6 * min(peers) / HITS:.0f} us"
            " at best",
        ),
        Figure(
            "one hit: detect, judge, filter, width",
            tuple(1e3 * time / HITS for time in ours),
            "ms",
            at_most(LONGEST_TIME),
            note=f"{traces[0].shape[1]} points of two channels in blocks of {BLOCK_SIZE}",
        ),
    )


def strike_hits(count: int) -> list[tuple[Block, ...]]:
    """Return the blocks of good hits on the paper's samples."""
    rig, names = VirtualRig(PAPER_SETUP, VirtualRigSettings()), PAPER_SETUP.samples.names
    labels = [
        HitLabel(names[number % len(names)], number + 1, number // len(names) + 1)
        for number in range(count)
    ]
    return [tuple(rig.strike(label).split(BLOCK_SIZE, 0)) for label in labels]


def read_traces(blocks: Sequence[Block]) -> FloatArray:
    """Return what both channels of a hit show, shape (2, n)."""
    return np.array(
        [
            np.concatenate([block.hammer.output for block in blocks]),
            np.concatenate([block.specimen.output for block in blocks]),
        ],
        dtype=np.float64,
    )


def count_accepted(streams: Sequence[Sequence[Block]]) -> int:
    """Find every hit in its blocks and judge it; return how many are accepted."""
    settings = PAPER_SETUP.analysis
    detector, accepted = ImpactDetector(settings), 0
    for blocks in streams:
        for block in blocks:
            for record in detector.feed(block):
                accepted += judge_hit(record, settings).accepted
    return accepted


def design_sections() -> FloatArray:
    """Return the second-order sections of the low-pass."""
    # Two passes of order n have -3 dB where one has -1.5 dB: at (sqrt(2) - 1)^(1 / 2n).
    one_pass = CUTOFF / (np.sqrt(2.0) - 1.0) ** (1.0 / (2 * FILTER_ORDER))
    sections: FloatArray = butter(FILTER_ORDER, one_pass, fs=SAMPLING_RATE, output="sos")
    return sections


def filter_all(traces: Sequence[FloatArray], sections: FloatArray) -> list[FloatArray]:
    """Filter every hit by the library's function alone, with the padding of ours."""
    padding = int(3 * SAMPLING_RATE / CUTOFF)
    return [sosfiltfilt(sections, both, padtype="even", padlen=padding) for both in traces]


PART = Part("hit", "A hit from blocks to verdict, beside the low-pass alone", measure, 1.0)
