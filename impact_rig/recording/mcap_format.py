"""What the MCAP container format is made of, as far as recordings of ROS 2 need it.

Source: https://mcap.dev/spec. Every record is an opcode (1 byte), the length of its content
(8 bytes) and the content; integers are little-endian, strings and maps prefixed by their length
in bytes (4 bytes).
"""

import struct
from enum import IntEnum
from typing import NamedTuple

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of every file."""

RECORD_HEAD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time."""
CHUNK_HEAD = struct.Struct("<QQQI")
"""First and last log time, uncompressed size, CRC-32 of the uncompressed records."""
U16, U32, U64 = struct.Struct("<H"), struct.Struct("<I"), struct.Struct("<Q")


class Opcode(IntEnum):
    """Kinds of records used here."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class Channel(NamedTuple):
    """One topic of a file.

    Attributes
    ----------
    id : int
        Unique in the file.
    topic : str
        Full name.
    type_name : str
        For example `impact_rig_msgs/msg/Impact`.
    schema_encoding, schema : str
        "ros2msg" for the files written here, and the definition.
    encoding : str
        Of the messages; "cdr" for ROS 2.
    metadata : dict
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    """

    id: int
    topic: str
    type_name: str
    schema_encoding: str
    schema: str
    encoding: str
    metadata: dict[str, str]


class RawMessage(NamedTuple):
    """One message as it stands in the file.

    Attributes
    ----------
    channel : Channel
        Its topic.
    sequence : int
        Counted per channel.
    log_time, publish_time : int
        When it was received and sent, nanoseconds since the epoch.
    data : bytes
        Serialised.
    """

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes
