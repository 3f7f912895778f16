"""The running stream to estimator and recorder: what is lost of it, and what it costs."""

from impact_rig.bench.disk import check_room
from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.stream_log import read_flow
from impact_rig.bench.stream_rig import COMPRESSION, POINT_SIZE, SETTLING, run_stream

SAMPLING_RATE = 2.5e6
"""Of each channel [Hz]: the paper's."""
FAST = 8
"""Times `SAMPLING_RATE` that must be held [-], as asked for."""
SLOW_PART = 0.25
"""Of the time at the fastest rate, for which the paper's is measured [-], our choice."""
LARGEST_SHARE = 0.6
"""Of one core, for all three processes at the paper's rate [-], as asked for."""
NANO = 1e-9


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Stream at the paper's rate and at a multiple of it, and count in the recordings."""
    seconds = bench.extent.seconds
    needed = FAST * SAMPLING_RATE * POINT_SIZE * (seconds + 2 * SETTLING)
    check_room(bench.folder, needed, f"{seconds:g} s of stream", "give fewer --seconds")
    bench.report(0, 2)
    slow = _measure_rate(bench, 1, SLOW_PART * seconds)
    bench.report(1, 2)
    return (*slow, *_measure_rate(bench, FAST, seconds))


def _measure_rate(bench: Bench, multiple: int, seconds: float) -> tuple[Figure, ...]:
    """Stream at a multiple of the paper's rate."""
    run = run_stream(bench.folder, multiple * SAMPLING_RATE, seconds)
    flow = read_flow(run.recording, run.begin, run.end)
    size = run.recording.stat().st_size
    run.recording.unlink()
    taken = NANO * (run.end - run.begin)
    name = f"{multiple} x"
    shares = ", ".join(f"{node} {share:.2f}" for node, share in run.shares.items())
    return (
        Figure(
            f"{name}, blocks lost in the recording",
            (float(flow.lost),),
            goal=at_most(0),
            note=f"of {flow.blocks + flow.lost} in {taken:.1f} s, {flow.points / 1e6:.0f} million"
            f" points of two channels, {size / 1e9:.1f} GB on the disk",
        ),
        Figure(
            f"{name}, points missed by the estimator",
            (float(flow.missed),),
            goal=at_most(0),
            note=f"it has seen {flow.seen} blocks",
        ),
        Figure(
            f"{name}, rate over 2.5 MS/s per channel",
            (flow.points / taken / SAMPLING_RATE,),
        ),
        Figure(
            f"{name}, processor time of all three",
            (sum(run.shares.values()),),
            "cores",
            at_most(LARGEST_SHARE) if multiple == 1 else None,
            note=f"{COMPRESSION}; {shares}",
        ),
    )


PART = Part("stream", "The running stream through three processes, two channels", measure, 45.0)
