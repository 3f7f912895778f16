"""What is read of a recording without an end."""

import contextlib
from pathlib import Path

import mcap.exceptions
import mcap.stream_reader
from mcap.records import Channel, Message


def read_by_stream(path: Path) -> list[tuple[str, Message]]:
    """Return each topic and message of a file without an end, by a reader that needs none."""
    topics, messages = {}, []
    with path.open("rb") as file, contextlib.suppress(mcap.exceptions.McapError):
        for record in mcap.stream_reader.StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                messages.append((topics[record.channel_id], record))
    return messages
