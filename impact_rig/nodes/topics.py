"""Message types and QoS of topics that are not known before the node runs."""

import importlib
from collections.abc import Iterable
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from impact_rig.core.errors import FileError
from impact_rig.recordings.records import INFINITE, OfferedQos


def import_type(type_name: str) -> Any:
    """Return the class of a message type, for example `std_msgs/msg/Header`.

    Raises
    ------
    FileError
        If it is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise FileError(f"message type {type_name} is not installed") from None


def name_type(kind: Any) -> str:
    """Return the name of a message class."""
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


def describe_qos(profile: QoSProfile) -> OfferedQos:
    """Return a profile as it is kept in a recording."""
    return OfferedQos(
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        history=profile.history.name.lower(),
        depth=profile.depth,
        lifespan=profile.lifespan.nanoseconds or INFINITE,
    )


def adapt_qos(publishers: Iterable[TopicEndpointInfo], depth: int) -> QoSProfile:
    """Return the strictest profile that receives from all publishers, as rosbag2 does."""
    offers = [item.qos_profile for item in publishers]
    is_reliable = all(item.reliability == ReliabilityPolicy.RELIABLE for item in offers)
    is_latched = all(item.durability == DurabilityPolicy.TRANSIENT_LOCAL for item in offers)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
    )
