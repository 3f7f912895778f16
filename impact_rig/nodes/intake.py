"""The one way in: a message that comes by a topic is of the own campaign, sound, and converted.

What is not is dropped, counted and named once; it ends no program.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from impact_rig.configuration.processes import MEASURING
from impact_rig.core.given.errors import RigError
from impact_rig.nodes.identity import Identity, Membership, identity_from_msg
from impact_rig.nodes.interfaces import Topic
from impact_rig.recordings.fields import NO_ID, stamp_from_msg

T = TypeVar("T")
UNSOUND = (RigError, ValueError, OverflowError)
"""Errors of a conversion if a message cannot be meant."""
UNKNOWN = "a node whose name is not known"
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
    """Takes the messages of a node's topics.

    Parameters
    ----------
    node : Node
        That subscribes.
    """

    # How often it is looked up who publishes foreign messages [s]: they may come as a flood.
    look_period = 1.0

    def __init__(self, node: Node) -> None:
        self.membership = Membership()
        self.handled = 0  # all messages that have come
        self.dropped: Counter[str] = Counter()  # which were not sound, by topic
        self.foreign: set[str] = set()  # nodes of other campaigns that a warning has named
        self._node = node
        self._began = time.time_ns()
        self._looked_at = 0.0  # [s]

    def take(self, topic: Topic, message: Any) -> Received[Any] | None:
        """Return a message with its converted value; None: it is foreign or cannot be meant."""
        self.handled += 1
        if self.membership.is_foreign(message):
            # Of none is a node that has just been started, too.
            campaign_id = identity_from_msg(message).campaign_id
            if campaign_id != NO_ID:
                is_former = campaign_id in self.membership.former
                is_latched = stamp_from_msg(message.header.stamp) < self._began
                self._name_foreign(topic, may_be_own=is_former or is_latched)
            return None
        try:
            return Received(topic.convert(message), message)
        except UNSOUND as error:
            self.dropped[topic.name] += 1
            if self.dropped[topic.name] == 1:
                self._node.get_logger().warning(
                    f"a message of {topic.name} is dropped, as all like it: {error}"
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

    def _name_foreign(self, topic: Topic, *, may_be_own: bool) -> None:
        """Warn once of each node whose messages are ignored."""
        if time.monotonic() < self._looked_at + self.look_period:
            return
        self._looked_at = time.monotonic()
        names = [
            f"{item.node_namespace.rstrip('/')}/{item.node_name}"
            for item in self._node.get_publishers_info_by_topic(topic.name)
            if item.node_name != UNNAMED
        ]
        # One of them is the rig's own, the first of a name of its nodes.
        own = self._node.get_namespace().rstrip("/")
        if name := next((f"{own}/{it}" for it in MEASURING if f"{own}/{it}" in names), None):
            names.remove(name)
        if not names and may_be_own:
            return  # of a campaign of the rig before
        for name in set(names or [UNKNOWN]) - self.foreign:
            self.foreign.add(name)
            self._node.get_logger().warning(
                f"{topic.name} carries the id of another campaign, from {name}: a replay or"
                " another rig is in this ROS domain; nothing of it is taken"
            )
