"""Reading a recording up to the estimation, beside `mcap.reader` doing nothing."""

from pathlib import Path

from mcap.reader import make_reader

from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.recordings import COMPRESSIONS, compress_anew
from impact_rig.bench.timing import compare_times, divide
from impact_rig.recording.reading.mcap_reader import read_recording

LARGEST_RATIO = 2.0
"""Time of reading over that of the peer [-]: half its speed is asked for."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time all set-ups and blocks of a campaign, as `analyze` gets them, in each compression."""
    original = bench.campaigns.take(1)[0].recording
    figures = []
    for number, compression in enumerate(COMPRESSIONS):
        bench.report(number, len(COMPRESSIONS))
        path = compress_anew(original, bench.folder / f"{compression}.mcap", compression)
        ours, peers = compare_times(
            lambda path=path: read_events(path),  # type: ignore[misc]
            lambda path=path: read_messages(path),  # type: ignore[misc]
            bench.extent.repeats,
        )
        figures.append(
            Figure(
                f"{compression}, time over that of mcap.reader",
                divide(ours, peers),
                goal=at_most(LARGEST_RATIO),
                note=f"{path.stat().st_size / 1e6:.1f} MB in {1e3 * min(ours):.0f} ms at best",
            )
        )
    return tuple(figures)


def read_events(path: Path) -> int:
    """Read as `impact-rig analyze` does, with the estimation switched off; return how many."""
    return sum(1 for _ in read_recording(path).events())


def read_messages(path: Path) -> int:
    """Read all messages with the library alone; return how many."""
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages())


PART = Part("read", "Reading a recording, beside mcap.reader doing nothing", measure, 3.0)
