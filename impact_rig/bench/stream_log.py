"""What a recording tells of a running stream: which blocks it has, what the estimator missed."""

from dataclasses import dataclass
from pathlib import Path

from impact_rig.recording.interfaces.block_heads import read_stream_head
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.raw_records import RawMessage

STREAM = "/acceleration/stream"
DIAGNOSTICS = "/diagnostics"
ESTIMATOR = "/estimator"
SEEN = "stream blocks"
MISSED = "stream points missing"
"""Of the estimator's diagnostics."""


@dataclass(frozen=True)
class Flow:
    """What came of a stream from one moment to another.

    Attributes
    ----------
    blocks : int
        In the recording.
    lost : int
        That the recording lacks between them.
    points : int
        Per channel, from the first of these blocks to the last, lost ones included.
    seen : int
        Blocks that the estimator has counted, up to the last time it said so.
    missed : int
        Points that it lacked, counted by itself.
    """

    blocks: int
    lost: int
    points: int
    seen: int
    missed: int


def read_flow(recording: Path, begin: int, end: int) -> Flow:
    """Return what a recording has of the stream that was sent between two moments.

    Parameters
    ----------
    recording : Path
        With stream and diagnostics.
    begin, end : int
        Nanoseconds since the epoch.
    """
    decoder = SchemaDecoder()
    starts: list[int] = []
    size = 0
    counts = [(0, 0)]
    messages = McapFile(recording).read_messages(
        lambda channel: channel.topic in (STREAM, DIAGNOSTICS)
    )
    for raw in messages:
        if raw.channel.topic == STREAM:
            if begin <= raw.publish_time <= end:
                head = read_stream_head(raw.data)
                starts.append(head.first_sample)
                size = head.points
            continue
        for values in _read_diagnostics(decoder, raw):
            # From the last word before the beginning to the last word of all.
            if raw.publish_time < begin:
                counts.clear()
            counts.append((int(values.get(SEEN, 0)), int(values.get(MISSED, 0))))
    wanted = (starts[-1] - starts[0]) // size + 1 if starts else 0
    (seen_before, missed_before), (seen, missed) = counts[0], counts[-1]
    return Flow(
        blocks=len(starts),
        lost=wanted - len(set(starts)),
        points=wanted * size,
        seen=seen - seen_before,
        missed=missed - missed_before,
    )


def _read_diagnostics(decoder: SchemaDecoder, raw: RawMessage) -> list[dict[str, str]]:
    """Return what the estimator says of itself, if it does."""
    message = decoder.decode(raw.channel, raw.data)
    return [
        {pair.key: pair.value for pair in status.values}
        for status in message.status
        if status.name == ESTIMATOR
    ]
