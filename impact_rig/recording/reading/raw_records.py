"""What a recording holds, as it stands in its files."""

from typing import NamedTuple

from impact_rig.recording.interfaces.channel import Channel


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


class MetadataRecord(NamedTuple):
    """What was noted beside the messages.

    Attributes
    ----------
    name : str
        What it is about; the same name may come again.
    fields : dict
        Texts by their names.
    """

    name: str
    fields: dict[str, str]


class Attachment(NamedTuple):
    """A file kept inside the recording.

    Attributes
    ----------
    name, media_type : str
        Its name, for example `rig.toml`, and its kind, for example `application/toml`.
    log_time : int
        When it was attached, nanoseconds since the epoch.
    data : bytes
        Its content.
    """

    name: str
    media_type: str
    log_time: int
    data: bytes
