"""What is found in a file that may be damaged: what is whole, and where it is not."""

from typing import NamedTuple

from mcap.records import Attachment, Metadata

from impact_rig.recording.recovery.found_topics import Topic


class Damage(NamedTuple):
    """Bytes that could not be read.

    Attributes
    ----------
    start, size : int
        Where, and how many [byte].
    reason : str
        What is wrong, in words.
    has_data : bool
        Whether messages or attachments may be among them; if not, only an index is.
    """

    start: int
    size: int
    reason: str
    has_data: bool = True


class FoundMessage(NamedTuple):
    """One message that is whole.

    Attributes
    ----------
    topic : Topic
        Whose it is.
    sequence : int
        Counted per topic.
    log_time, publish_time : int
        When it was received and sent, nanoseconds since the epoch.
    data : bytes
        Serialised.
    is_vouched : bool
        Whether it is what was written: a checksum says so, or there is none to ask and the
        records follow each other as they should.
    """

    topic: Topic
    sequence: int
    log_time: int
    publish_time: int
    data: bytes
    is_vouched: bool


class ChunkEnd(NamedTuple):
    """The messages before it stood in one chunk of this compression."""

    compression: str


Found = FoundMessage | ChunkEnd | Metadata | Attachment
