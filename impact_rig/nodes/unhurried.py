"""Messages taken from their queue without the executor: those that nobody waits for, or many.

The way through the executor costs many times what taking a message does, and a process that wakes
with every message takes the processor from those that somebody waits for.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup

from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.rig_node import RigNode

TAKING_PERIOD = 0.05
"""How often what nobody waits for is taken [s], our choice: nobody sees it, and queues hold many
times as much."""


class UnhurriedGroup(CallbackGroup):
    """Holds subscriptions that no executor waits for."""

    def can_execute(self, _: Any) -> bool:
        """Keep an executor from waiting."""
        return False


def take_message(subscription: Any, *, raw: bool = False) -> tuple[Any, Mapping[str, Any]] | None:
    """Return the next message that waits, serialised if `raw`, and what is known of it, if any."""
    with subscription.handle:
        taken: tuple[Any, Mapping[str, Any]] | None = subscription.handle.take_message(
            subscription.msg_type, raw
        )
    return taken


class UnhurriedTopic:
    """A topic whose messages are looked at when they matter: none of them wakes the node.

    As many wait as the topic keeps; beyond, the oldest are lost.

    Parameters
    ----------
    node : RigNode
        That listens.
    topic : Topic
        To listen to.
    """

    def __init__(self, node: RigNode, topic: Topic) -> None:
        self._subscription = node.listen(topic, lambda _: None, callback_group=UnhurriedGroup())

    def take(self) -> Iterator[Any]:
        """Yield the messages that have come since the last time."""
        while (taken := take_message(self._subscription)) is not None:
            yield taken[0]
