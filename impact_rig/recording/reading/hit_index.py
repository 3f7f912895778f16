"""Where in a recording its hits lie, so that one of them is read without the others."""

from dataclasses import dataclass

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.recording.interfaces.block_heads import BlockHead, read_block_head
from impact_rig.recording.interfaces.messages import block_from_msg
from impact_rig.recording.reading.mcap_reader import BLOCK_TYPE, SETUP_TYPE, Recording
from impact_rig.recording.reading.raw_records import RawMessage


@dataclass(frozen=True)
class IndexedHit:
    """Where one hit lies.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    start_time, end_time : int
        When its first and its last block were received, nanoseconds since the epoch.
    """

    label: HitLabel
    start_time: int
    end_time: int


def index_hits(recording: Recording) -> tuple[tuple[IndexedHit, ...], ...]:
    """Find the hits of a recording; of its blocks no more than the heads are looked at.

    Parameters
    ----------
    recording : Recording
        It is read once; what its index shows to hold no hit is passed over.

    Returns
    -------
    tuple of tuple of IndexedHit
        The campaigns with hits, as `judge_recording` tells them apart, each with its hits in file
        order.

    Raises
    ------
    FileError
        If the file is damaged.
    """
    campaigns: list[list[IndexedHit]] = [[]]
    begun: IndexedHit | None = None
    next_sample = 0
    has_setup = False
    for raw in recording.raw_messages(SETUP_TYPE, BLOCK_TYPE):
        if raw.channel.type_name == SETUP_TYPE:
            # The first one holds for what came before it, too.
            if has_setup:
                campaigns.append([])
            has_setup, begun = True, None
            continue
        head = _read_head(recording, raw)
        is_next = begun is not None and begun.label == head.label
        if begun is None or not is_next or head.first_sample < next_sample:
            begun = IndexedHit(head.label, raw.log_time, raw.log_time)
            campaigns[-1].append(begun)
        else:
            start, end = begun.start_time, begun.end_time
            begun = IndexedHit(head.label, min(start, raw.log_time), max(end, raw.log_time))
            campaigns[-1][-1] = begun
        next_sample = head.first_sample + head.points
        if head.last:
            begun = None
    return tuple(tuple(hits) for hits in campaigns if hits)


def read_hit(recording: Recording, hit: IndexedHit) -> tuple[Block, ...]:
    """Return the blocks of a hit as they were recorded, in file order.

    Of a recording that was closed only the chunks of this hit are read.

    Raises
    ------
    FileError
        If the file is damaged, or is not the one that was indexed.
    """
    raws = recording.raw_messages(BLOCK_TYPE, start_time=hit.start_time, end_time=hit.end_time + 1)
    blocks = tuple(recording.convert(raw, block_from_msg) for raw in raws)
    found = tuple(block for block in blocks if block.label == hit.label)
    if not found:
        raise FileError(
            f"{recording.path} no longer holds record {hit.label.record} of"
            f" {hit.label.sample!r}: the file was changed"
        )
    return found


def _read_head(recording: Recording, raw: RawMessage) -> BlockHead:
    try:
        return read_block_head(raw.data)
    except FileError as error:
        raise FileError(f"{recording.path}: {raw.channel.topic}: {error}") from None
