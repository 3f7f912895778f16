"""Nodes of programs that do something else meanwhile; one takes messages, whatever their types."""

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from importlib import import_module
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo

from impact_rig.core.given.errors import DeviceError, FileError
from impact_rig.nodes import interfaces
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.executor import accept_message_info, make_executor, spin_until

DISCOVERY_TIME = 3.5
"""How long publishers are looked for [s]: nodes of one computer find each other in 0.1 s, or where
the first packets are lost, when they are sent again, after 3 s."""
DEPTH = 2000
"""Messages that may wait [-]: half a second of one point each at 4 kHz."""


class BackgroundNode:
    """A node in a ROS context and a thread of its own.

    Parameters
    ----------
    name : str
        Of the node.
    domain : int, optional
        ROS domain; that of the environment by default.

    Raises
    ------
    DeviceError
        As `offer_profile`.
    """

    def __init__(self, name: str, domain: int | None = None) -> None:
        with offer_profile():
            self.context = rclpy.Context()
            rclpy.init(context=self.context, domain_id=domain, args=[])
            self.executor = make_executor(self.context)
            self.node = Node(name, context=self.context, enable_rosout=False)
        self.executor.add_node(self.node)
        self._stop = Future()
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)
        self._thread.start()

    def leave(self) -> None:
        """Close what is beside the node, once the thread has ended."""

    def close(self) -> None:
        """End the thread and the node."""
        self._stop.set_result(None)
        self._thread.join()
        self.executor.shutdown(timeout_sec=1.0)
        self.leave()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            spin_until(self.executor, self._stop)


def import_type(type_name: str) -> Any:
    """Return the class of a message type, for example `std_msgs/msg/Header`.

    Raises
    ------
    FileError
        If it is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise FileError(f"message type {type_name} is not installed") from None


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


OWN_TYPES = (
    "impact_rig_msgs/",
    "action_msgs/",
    "diagnostic_msgs/",
    "lifecycle_msgs/",
    "rcl_interfaces/",
    "rosgraph_msgs/",
)
"""Types of topics that the rig's nodes publish, and every node of ROS 2."""
OWN_NAMES = tuple(f"/{topic.name}" for topic in interfaces.RECORDED_TOPICS)


class Listener(BackgroundNode):
    """A node that listens to what others publish.

    Parameters
    ----------
    domain : int, optional
        As of `BackgroundNode`.
    patience : float
        How long publishers are looked for [s].
    """

    def __init__(self, domain: int | None = None, patience: float = DISCOVERY_TIME) -> None:
        super().__init__("listener", domain)
        self._patience = patience

    def list_topics(self) -> dict[str, str]:
        """Return the topics on which foreign nodes publish, with their types."""
        return {
            topic: types[0]
            for topic, types in sorted(self.node.get_topic_names_and_types())
            if self.count_publishers(topic)
            and not types[0].startswith(OWN_TYPES)
            and not topic.endswith(OWN_NAMES)
        }

    def count_publishers(self, topic: str) -> int:
        """Return how many publishers a topic has."""
        return int(self.node.count_publishers(topic))

    def subscribe(self, topic: str, take: Callable[[Any, Mapping[str, Any]], None]) -> None:
        """Call `take` with each message and its metadata.

        Raises
        ------
        DeviceError
            If not just one node publishes on the topic.
        FileError
            If its type is not installed.
        """
        deadline = time.monotonic() + self._patience
        while not self.count_publishers(topic) and time.monotonic() < deadline:
            time.sleep(0.01)  # the graph is asked, it tells nothing by itself
        publishers = self.node.get_publishers_info_by_topic(topic)
        if len(publishers) != 1:
            there = ", ".join(f"{name} ({of})" for name, of in self.list_topics().items())
            names = ", ".join(item.node_name for item in publishers)
            raise DeviceError(
                f"{len(publishers)} nodes publish on {topic} ({names}): one must" if publishers
                else f"no node publishes on {topic}: start it first; foreign topics are"
                f" {there or 'none'}"
            )  # fmt: skip
        message_type, qos = import_type(publishers[0].topic_type), adapt_qos(publishers, DEPTH)
        qos.durability = DurabilityPolicy.VOLATILE  # earlier messages are not wanted
        self.node.create_subscription(message_type, topic, accept_message_info(take), qos)
