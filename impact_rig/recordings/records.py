"""What a recording holds, as it stands in its files."""

from typing import NamedTuple


class Channel(NamedTuple):
    """One topic of a recording.

    Attributes
    ----------
    id : int
        Unique in the recording.
    topic : str
        Full name.
    type_name : str
        For example `impact_rig_msgs/msg/Impact`; empty: not described.
    schema : str
        Definition of the type, as `ros2msg`.
    metadata : dict
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    encoding : tuple of str
        Of the messages and of the schema; others than those of ROS 2 cannot be decoded.
    """

    id: int
    topic: str
    type_name: str
    schema: str
    metadata: dict[str, str]
    encoding: tuple[str, str] = ("cdr", "ros2msg")

    @property
    def is_ros(self) -> bool:
        """Whether its messages are those of ROS 2."""
        return self.encoding == ("cdr", "ros2msg")


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
    """What was noted beside the messages: texts by their names; a record may come again."""

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


Item = RawMessage | MetadataRecord | Attachment
