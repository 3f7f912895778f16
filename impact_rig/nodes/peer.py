"""Another node of the rig, as its signs of life tell: it may fall silent, come back, or leave.

A node whose process is killed, or whose computer is out of reach, says nothing of it. Without a
lease the middleware would miss it after its own time, 20 s or so; with one it tells in time.
"""

from collections.abc import Callable
from typing import Any

from impact_rig.nodes.interfaces import DIAGNOSTICS, Topic
from impact_rig.nodes.rig_node import RigNode

GONE = "has gone: start it again, or see to the network between you"
"""What is said of a node that is lost, after its name."""
_PARTICIPANT_LENGTH = 12
"""How much of an endpoint's identity is that of its participant [bytes], by RTPS; all nodes of a
process share one."""


class Peer:
    """Listens to a topic with a lease, and to whether its publisher is alive.

    Parameters
    ----------
    node : RigNode
        That listens.
    topic : Topic
        Of the other node alone, with a lease.
    take : callable
        Called with each message.
    note_change : callable
        Called when the publisher has fallen silent, come back or left.

    Attributes
    ----------
    losses : int
        How often it has fallen silent or left since the start [-].
    """

    def __init__(
        self,
        node: RigNode,
        topic: Topic,
        take: Callable[[Any], None],
        note_change: Callable[[], None] = lambda: None,
    ) -> None:
        self.losses = 0
        self._node: Any = node
        self._topic = topic.name
        self._take_message = take
        self._note_change = note_change
        self._is_heard = False
        self._alive = 0
        self._silent = 0
        node.listen(topic, self._take, note_liveliness=self._take_liveliness)

    @property
    def is_lost(self) -> bool:
        """Whether it was there, and gives no sign of life now."""
        if self._alive or self._silent:
            return not self._alive
        # Its word may come before its first sign of life, and one of this process gives none.
        return self._is_heard and not self._node.count_publishers(self._topic)

    @property
    def has_left(self) -> bool:
        """Whether it is lost for good: it has ended, or been silent for long."""
        return self.is_lost and not self._silent

    def _take(self, message: Any) -> None:
        self._is_heard = True
        self._take_message(message)

    def _take_liveliness(self, status: Any) -> None:
        self._is_heard = True
        before = self._alive
        self._alive, self._silent = status.alive_count, status.not_alive_count
        if not self._alive and self._is_in_this_process():
            self._silent = 0
        elif before and not self._alive:
            self.losses += 1
        self._note_change()

    def _is_in_this_process(self) -> bool:
        """Whether the publisher is of this process, in which nobody gives signs of life."""
        theirs = self._node.get_publishers_info_by_topic(self._topic)
        ours = (
            item
            for item in self._node.get_publishers_info_by_topic(DIAGNOSTICS.name)
            if (item.node_namespace, item.node_name)
            == (self._node.get_namespace(), self._node.get_name())
        )
        participants = {bytes(item.endpoint_gid[:_PARTICIPANT_LENGTH]) for item in ours}
        return any(
            bytes(item.endpoint_gid[:_PARTICIPANT_LENGTH]) in participants for item in theirs
        )
