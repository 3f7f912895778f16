"""Nodes of programs that do something else meanwhile; one takes messages, whatever their types."""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

from impact_rig.core.errors import DeviceError
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


class Listener(BackgroundNode):
    """A node that listens to what others publish.

    Parameters
    ----------
    domain : int, optional
        As of `BackgroundNode`.
    """

    def __init__(self, domain: int | None = None) -> None:
        super().__init__("listener", domain)

    def list_topics(self) -> dict[str, str]:
        """Return the topics that have a publisher, with their types."""
        return {
            topic: types[0]
            for topic, types in self.node.get_topic_names_and_types()
            if self.count_publishers(topic)
        }

    def count_publishers(self, topic: str) -> int:
        """Return how many publishers a topic has."""
        return int(self.node.count_publishers(topic))

    def subscribe(self, topic: str, take: Callable[[Any, Mapping[str, Any]], None]) -> None:
        """Call `take` with each message and its metadata.

        Raises
        ------
        DeviceError
            If not just one node publishes on the topic, or its type is not installed.
        """
        deadline = time.monotonic() + DISCOVERY_TIME
        while not self.count_publishers(topic) and time.monotonic() < deadline:
            time.sleep(0.01)  # the graph is asked, it tells nothing by itself
        publishers = self.node.get_publishers_info_by_topic(topic)
        if len(publishers) != 1:
            there = ", ".join(sorted(self.list_topics())) or "none"
            names = ", ".join(item.node_name for item in publishers)
            raise DeviceError(
                f"{len(publishers)} nodes publish on {topic} ({names}): one must" if publishers
                else f"no node publishes on {topic}: start it first; topics are {there}"
            )  # fmt: skip
        (publisher,) = publishers
        package, _, kind = publisher.topic_type.partition("/msg/")
        try:
            message_type = getattr(import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError):
            raise DeviceError(
                f"{topic} has messages of the type {publisher.topic_type}, and the package"
                f" {package} is not installed here"
            ) from None
        # A reliable subscription hears nothing of a publisher that makes its best effort.
        qos = QoSProfile(depth=DEPTH, reliability=publisher.qos_profile.reliability)
        self.node.create_subscription(message_type, topic, accept_message_info(take), qos)
