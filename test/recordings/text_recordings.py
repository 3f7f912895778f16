"""Recordings with a set-up and a stream of hits, all texts, and what is read of them."""

import contextlib
from pathlib import Path

import mcap.reader
import mcap.stream_reader
from mcap.records import Channel, Message
from mcap_ros2.decoder import DecoderFactory

from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import RecordingWriter

TEXT = MessageDefinition("std_msgs/msg/String", "string data\n")
STATE = (OfferedQos("reliable", "transient_local", "keep_last", 1),)
STREAM = (OfferedQos("reliable", "volatile", "keep_last", 200),)
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
HIT = b"x" * 3000


def encode(text: bytes) -> bytes:
    """Return a std_msgs/String in CDR."""
    return b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little") + text + b"\0"


class Writer:
    """A recording with a set-up and a stream of hits, ten in a second."""

    def __init__(self, output: Path, **options) -> None:
        self.writer = RecordingWriter(output, compression="none", **options)
        self.setup = self.writer.add_channel("/setup", TEXT, STATE)
        self.stream = self.writer.add_channel("/acceleration", TEXT, STREAM)
        self.time = START

    def add(self, channel: int, text: bytes) -> None:
        self.time += SECOND // 10
        self.writer.add_message(channel, encode(text), self.time, self.time - 1000)

    def add_hits(self, *numbers: int) -> None:
        for number in numbers:
            self.add(self.stream, b"%d " % number + HIT)


def read_by_mcap(path: Path) -> list:
    """Return topic, sequence and text of each message, by the index of one file."""
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        )
        found = list(reader.iter_decoded_messages())
    return [
        (item.channel.topic, item.message.sequence, item.decoded_message.data) for item in found
    ]


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


def list_hits(path: Path) -> list[int]:
    return [
        int(text.split()[0]) for topic, _, text in read_by_mcap(path) if topic == "/acceleration"
    ]
