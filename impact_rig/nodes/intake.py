"""The one way in: a message that comes by a topic is of the own campaign, sound, and converted.

Any other message is dropped, counted and named once; it ends no program.
"""

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from impact_rig.core.given.errors import RigError
from impact_rig.nodes.identity import Identity, Membership, identity_from_msg
from impact_rig.nodes.interfaces import LEASE, OWNED_TOPICS, Topic
from impact_rig.recordings.fields import stamp_from_msg

T = TypeVar("T")
UNSOUND = (RigError, ValueError, OverflowError)
"""Errors of a conversion if a message cannot be meant."""
UNKNOWN = "a node whose name is not known"
LAST_WORDS = 1.0
"""How long what a stranger sent may wait in a queue when it has gone [s]."""
UNNAMED = "_NODE_NAME_UNKNOWN_"
"""Name of a node, by rmw_fastrtps, of which only the endpoints have been discovered."""


@dataclass(frozen=True)
class Received(Generic[T]):
    """A message that counts."""

    value: T  # what it says, as one of our types
    message: Any  # as it came, of rclpy

    @property
    def identity(self) -> Identity:
        """Whose it is."""
        return identity_from_msg(self.message)

    @property
    def stamp(self) -> int:
        """Its time [ns since the epoch]."""
        return stamp_from_msg(self.message.header.stamp)


class Intake:
    """Takes the messages of a node's topics."""

    def __init__(self, node: Node) -> None:
        self.membership = Membership()
        self.handled = 0  # all messages that have come
        self.dropped: Counter[str] = Counter()  # which were not sound, by topic
        self.ignored = 0  # messages of another campaign, or of an unknown node
        self.strangers: set[str] = set()  # sentences about them that were logged
        # When strangers were last seen, and their names, by topic.
        self._heard: dict[str, tuple[float, str]] = {}
        # When publishers were first seen whose node was not known yet, by their ids.
        self._nameless: dict[bytes, float] = {}
        self._node = node
        self._names: dict[str, str] = {}  # of topics, in full

    def take(self, topic: Topic, message: Any) -> Received[Any] | None:
        """Return a message with its converted value; None: it is foreign or cannot be meant."""
        self.handled += 1
        # Which of several publishers has spoken, no message says: none is believed.
        if (
            self.find_stranger(topic)
            or self._has_newcomer(topic)
            or self.membership.is_foreign(message)
        ):
            self.ignored += 1
            return None
        try:
            return Received(topic.convert(message), message)
        except UNSOUND as error:
            self.dropped[topic.name] += 1
            if self.dropped[topic.name] == 1:
                self._node.get_logger().warning(
                    f"a message of {topic.name} is dropped, and so is each like it: {error}"
                )
            return None

    def subscribe(
        self,
        topic: Topic,
        callback: Callable[[Received[Any]], None],
        on_liveliness: Callable[[Any], None] | None = None,
    ) -> Any:
        """Subscribe to a topic: the callback gets each message that counts.

        `on_liveliness` gets the number of publishers that are alive and silent, when it changes.
        """

        def on_message(message: Any) -> None:
            if received := self.take(topic, message):
                callback(received)

        return self._node.create_subscription(
            topic.type,
            topic.name,
            on_message,
            topic.qos if on_liveliness is None else topic.leased_qos,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=on_liveliness, use_default_callbacks=False
            ),
        )

    def find_stranger(self, topic: Topic, since: float = LAST_WORDS) -> str | None:
        """Return who spoke on a topic beside its owner within these seconds, as a sentence."""
        if not topic.owners:
            return None
        told = f"on {topic.name} beside its {topic.owners[0]}"
        if names := self._name_others(topic):
            self._heard[topic.name] = time.monotonic(), names
            found = f"{names} speaks {told}: end that node"
            if found not in self.strangers:
                self.strangers.add(found)
                self._node.get_logger().warning(f"{found}; nothing on it is believed")
            return found
        seen, names = self._heard.get(topic.name, (-math.inf, ""))
        may_come = time.monotonic() - seen < since
        return f"{names} spoke {told} until now: wait {since:g} s" if may_come else None

    def find_any_stranger(self, since: float = LAST_WORDS) -> str | None:
        """Return a sentence about the first stranger on any topic; None: there is none."""
        found = (self.find_stranger(topic, since) for topic in OWNED_TOPICS)
        return next(filter(None, found), None)

    def _list_several(self, topic: Topic) -> list[TopicEndpointInfo]:
        """Return who publishes on a topic that has an owner; empty: one alone."""
        if not topic.owners:
            return []
        if not (name := self._names.get(topic.name)):
            name = self._names[topic.name] = self._node.resolve_topic_name(topic.name)
        # By the handle: rclpy's own count expands the name each time, which costs the most.
        if self._node.handle.get_count_publishers(name) == 1:
            return []
        return list(self._node.get_publishers_info_by_topic(topic.name))

    def _has_newcomer(self, topic: Topic) -> bool:
        """Whether the graph does not tell yet whose node one of several publishers is.

        Its name comes within a second, or never.
        """
        now, found = time.monotonic(), self._list_several(topic)
        nameless = [bytes(item.endpoint_gid) for item in found if item.node_name == UNNAMED]
        return any(now - self._nameless.setdefault(gid, now) < LAST_WORDS for gid in nameless)

    def _name_others(self, topic: Topic) -> str:
        """Ask the graph who publishes on a topic beside its owner; empty: nobody does.

        The rig's own publishers have a lease and their node's name, if that has come through. Of
        one that was killed the middleware keeps the publisher for a minute: all of that kind are
        one.
        """
        space, own, others = self._node.get_namespace(), 0, []
        for item in self._list_several(topic):
            is_leased = item.qos_profile.liveliness_lease_duration.nanoseconds <= LEASE * 1e9
            is_named = (item.node_namespace, item.node_name) in {
                (space, it) for it in topic.owners
            }
            if is_leased and (is_named or item.node_name == UNNAMED):
                own = 1
            else:
                others.append(f"{item.node_namespace.rstrip('/')}/{item.node_name}")
        if own + len(others) < 2:  # noqa: PLR2004
            return ""
        return " and ".join(UNKNOWN if UNNAMED in name else name for name in sorted(others))
