"""Recordings of a few hits, what other libraries find in them, and their recovery."""

import io
import struct
from pathlib import Path
from typing import Any, NamedTuple

import mcap.reader
import mcap.stream_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from impact_rig.recordings.contents import Contents, inspect_run, recover_run
from impact_rig.recordings.run import Run

OURS = "impact_rig_msgs/msg/"
HITS = 4
"""Hits of the recordings, one for each chunk."""


class Raw(NamedTuple):
    """A message as another library reads it."""

    topic: str
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Place(NamedTuple):
    """A chunk of an undamaged file."""

    start: int
    data_start: int
    end: int
    messages: list[Raw]


def label(record: int) -> dict[str, Any]:
    """Return the fields that name a hit."""
    return {"record": record, "sample": "brass", "impact": record, "attempt": 1}


def add_hit(maker: Any, record: int) -> None:
    """Add what a recorder writes of a hit, in one chunk."""
    maker.add("release", OURS + "HammerRelease", {**label(record), "swing_time": 0.2})
    for first in (0, 100):
        maker.add_block(record, **label(record), first_sample=first, last=first > 0)
    counts = {"blocks": 2, "gaps": 0, "missing_points": 0}
    maker.add("recorder/stored", OURS + "RecordStored", {**label(record), **counts})
    weak = {"reason": "weak", "explanation": "too weak"}
    verdict = {"accepted": record % 2 == 1, "reasons": [] if record % 2 else [weak]}
    values = dict.fromkeys(("impact_time", "contact_time", "hammer_peak", "specimen_peak"), 1.0)
    maker.add("impact", OURS + "Impact", {**label(record), **verdict, **values})
    maker.writer.flush()


def write_original(make_recording: Any, **options: Any) -> Path:
    maker = make_recording("original.mcap", namespace="/lab", **options)
    maker.add_setup()
    maker.add("note", "std_msgs/msg/String", {"data": "a new sample, öiled"})
    maker.writer.flush()
    maker.writer.add_metadata("impact_rig", {"software_version": "0.1.0", "notes": "Grüße"})
    maker.writer.add_attachment("rig.toml", "application/toml", b"[rig]\nname = 'bench'\n")
    for record in range(1, HITS + 1):
        add_hit(maker, record)
    return Path(maker.close())


def read_raw(path: Path) -> list[Raw]:
    """Return all messages as the library's indexed reader gives them, in file order."""
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        return [
            Raw(channel.topic, item.sequence, item.log_time, item.publish_time, item.data)
            for _, channel, item in reader.iter_messages(log_time_order=False)
        ]


def find_chunks(path: Path) -> list[Place]:
    """Return the chunks of an undamaged file, as the library finds them."""
    chunks = []
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(file)
        summary = reader.get_summary()
        topics = {number: channel.topic for number, channel in summary.channels.items()}
        for index in summary.chunk_indexes:
            file.seek(index.chunk_start_offset + 9)
            content = file.read(index.chunk_length - 9)
            size = struct.unpack_from("<I", content, 28)[0]
            chunk = Chunk.read(mcap.stream_reader.ReadDataStream(io.BytesIO(content)))
            messages = [
                Raw(topics[m.channel_id], m.sequence, m.log_time, m.publish_time, m.data)
                for m in breakup_chunk(chunk)
                if isinstance(m, Message)
            ]
            start = index.chunk_start_offset
            end = start + index.chunk_length
            chunks.append(Place(start, start + 9 + 40 + size, end, messages))
    return chunks


def find_borders(path: Path) -> list[int]:
    """Return where the records of a file begin."""
    content, place, borders = path.read_bytes(), 8, []
    while place < len(content) - 8:
        borders.append(place)
        place += 9 + struct.unpack_from("<Q", content, place + 1)[0]
    return borders


def spoil(path: Path, content: bytes) -> Path:
    """Write bytes to a new file beside a recording."""
    damaged = path.with_name("damaged.mcap")
    damaged.write_bytes(content)
    return damaged


class Recovered(NamedTuple):
    """A damaged recording: what was found in it, and the sound one made of it."""

    contents: Contents
    output: Path

    @property
    def is_complete(self) -> bool:
        """Whether all that was in it is in the sound one."""
        contents = self.contents
        return not (contents.lost or any(damage.size for damage in contents.passes[0].damages))


def recover(damaged: Path) -> Recovered:
    """Recover to a new file, whatever was there before."""
    output = damaged.with_name("good.mcap")
    output.unlink(missing_ok=True)
    return Recovered(recover_run(Run(damaged), output), output)


def read_recovered(recovered: Recovered) -> list[Raw]:
    """Return the messages of a recovered recording, which must be sound."""
    assert inspect_run(Run(recovered.output)).problems == ()
    return read_raw(recovered.output)
