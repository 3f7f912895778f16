"""The records of an MCAP file that are used here."""

from typing import NamedTuple


class Channel(NamedTuple):
    """One topic of a recording."""

    id: int  # unique in the recording
    topic: str
    type_name: str  # for example `impact_rig_msgs/msg/Impact`; empty: not described
    schema: str  # definition of the type, as `ros2msg`
    metadata: dict[str, str]  # `offered_qos_profiles` and `topic_type_hash` for ROS 2
    # Of messages and schema; others than those of ROS 2 cannot be decoded.
    encoding: tuple[str, str] = ("cdr", "ros2msg")

    @property
    def is_ros(self) -> bool:
        """Whether its messages are those of ROS 2."""
        return self.encoding == ("cdr", "ros2msg")


class RawMessage(NamedTuple):
    """One message, serialised."""

    channel: Channel
    sequence: int  # counted per channel
    log_time: int  # when it was received [ns since the epoch]
    publish_time: int  # when it was sent [ns since the epoch]
    data: bytes


class MetadataRecord(NamedTuple):
    """What was noted beside the messages: texts by their names; a record may come again."""

    name: str
    fields: dict[str, str]


class Attachment(NamedTuple):
    """A file kept inside the recording."""

    name: str  # for example `rig.toml`
    media_type: str  # for example `application/toml`
    log_time: int  # when it was attached [ns since the epoch]
    data: bytes


Item = RawMessage | MetadataRecord | Attachment
