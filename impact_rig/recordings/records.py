"""The records of an MCAP file that are used here, and the quality of service kept with a topic."""

from dataclasses import dataclass
from typing import NamedTuple

RECORDER = "impact_rig"
"""Library that a recording of the rig's recorder names as its writer."""
PROVENANCE_RECORD = "impact_rig"
"""Metadata record of the software, the computer and the operator's notes."""
IMPORT_REMARKS = "import_remarks"
"""Its field of what an import assumed, in lines."""
PARAMETERS_RECORD = "impact_rig/parameters"
"""Metadata record of the parameters of all nodes: a YAML text by full node name."""
HEALTH_RECORD = "impact_rig/health"
"""Metadata record about the end of the recording."""
RECOVERY_RECORD = "impact_rig/recovery"
"""Metadata record about the source of a recovered recording, and its losses."""
Encoding = tuple[str, str]
"""Encodings of a topic's messages, and of the schema that describes them."""
ROS: Encoding = ("cdr", "ros2msg")
"""Encodings of ROS 2."""


class Channel(NamedTuple):
    """One topic of a recording."""

    id: int  # unique in the recording
    topic: str
    type_name: str  # for example `impact_rig_msgs/msg/Impact`; empty: not described
    # Definition of the type, as `ros2msg`; bytes that are no text are kept as surrogates.
    schema: str
    metadata: dict[str, str]  # `offered_qos_profiles` and `topic_type_hash` for ROS 2
    # Of messages and schema; others than those of ROS 2 cannot be decoded.
    encoding: Encoding = ROS

    @property
    def is_ros(self) -> bool:
        """Whether its messages are those of ROS 2."""
        return self.encoding == ROS


class RawMessage(NamedTuple):
    """One message, serialised."""

    channel: Channel
    sequence: int  # counted per channel
    log_time: int  # when it was received [ns since the epoch]
    publish_time: int  # when it was sent [ns since the epoch]
    data: bytes


class MetadataRecord(NamedTuple):
    """Metadata beside the messages: texts by their names; a record may come again."""

    name: str
    fields: dict[str, str]


class Attachment(NamedTuple):
    """A file kept inside the recording."""

    name: str  # for example `rig.toml`
    media_type: str  # for example `application/toml`
    log_time: int  # when it was attached [ns since the epoch]
    data: bytes


Item = RawMessage | MetadataRecord | Attachment


INFINITE = 2**63 - 1
"""A duration without limit in ROS 2 [ns]."""


@dataclass(frozen=True)
class OfferedQos:
    """The quality of service that a publisher offered, as far as subscriptions depend on it."""

    reliability: str = "reliable"  # "reliable" or "best_effort"
    durability: str = "volatile"  # "volatile" or "transient_local"
    history: str = "keep_last"  # or "keep_all", "unknown": publishers do not announce it
    depth: int = 10  # [messages], by default as in ROS 2; 0: not known
    lifespan: int = INFINITE  # [ns]


def format_offered_qos(profiles: tuple[OfferedQos, ...]) -> str:
    """Return `offered_qos_profiles` as rosbag2 of ROS 2 Jazzy writes it."""
    if not profiles:
        return ""
    content = [
        {
            "history": profile.history,
            "depth": profile.depth,
            "reliability": profile.reliability,
            "durability": profile.durability,
            "deadline": _describe_duration(INFINITE),
            "lifespan": _describe_duration(profile.lifespan),
            "liveliness": "automatic",
            "liveliness_lease_duration": _describe_duration(INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for profile in profiles
    ]
    import yaml

    # The same text five times as fast, where PyYAML was built with libyaml.
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(content, Dumper=dumper, sort_keys=False)).rstrip()


def _describe_duration(nanoseconds: int) -> dict[str, int]:
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return {"sec": seconds, "nsec": rest}
