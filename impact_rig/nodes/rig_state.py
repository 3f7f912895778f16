"""The state of a rig, as one of its nodes hears it: who is there, who is ready, and why not.

Hammer and campaign ask the same questions, and get the same answers. A node whose process is
killed, or whose computer is out of reach, says nothing of it: without a lease the middleware would
miss it after its own time, a minute or so; with one it tells in time.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs.msg import AcquisitionState, RecordStored

from impact_rig.nodes import interfaces
from impact_rig.nodes.interfaces import DIAGNOSTICS, Topic
from impact_rig.nodes.rig_node import IS_ACTIVE, LIFECYCLE, RigNode

CAMPAIGN = "campaign"
ACCELEROMETER = "accelerometer"
RECORDER = "recorder"
TOPICS = {
    CAMPAIGN: interfaces.SETUP,
    ACCELEROMETER: interfaces.ACQUISITION_STATE,
    RECORDER: interfaces.RECORDER_STATE,
}
"""By which topic, with a lease, each node of a rig is heard."""
_PARTICIPANT_LENGTH = 12
"""How much of an endpoint's identity is that of its participant [bytes], by RTPS; all nodes of a
process share one."""


class RigMember:
    """One node of a rig: what it said last, whether it is alive, and whether it is active.

    Parameters
    ----------
    node : RigNode
        That listens.
    name : str
        Of the other node, of the same namespace.
    topic : Topic
        Of the other node alone, with a lease.
    note_change : callable
        Called when it has fallen silent, come back or left.

    Attributes
    ----------
    state : message or None
        What it said last; None: it has not been heard of yet.
    losses : int
        How often it, its device or its activity was lost since the start [-].
    take : callable
        Called with each message once it is kept; may be set.
    """

    def __init__(
        self,
        node: RigNode,
        name: str,
        topic: Topic,
        note_change: Callable[[], None],
    ) -> None:
        self.name = name
        self.state: Any = None
        self.losses = 0
        self.take: Callable[[Any], None] = lambda _: None
        self._node: Any = node
        self._topic = topic.name
        self._note_change = note_change
        self._is_heard = False
        self._is_active = True
        self._alive = 0
        self._silent = 0
        self._heard = node.listen(topic, self._take, note_liveliness=self._take_liveliness)

    @property
    def is_gone(self) -> bool:
        """Whether it was there, and gives no sign of life now."""
        if self._alive or self._silent:
            return not self._alive
        # A message may come before its first sign of life, and one of this process gives none.
        return self._is_heard and not self._heard.get_publisher_count()

    @property
    def has_left(self) -> bool:
        """Whether it is gone for good: it has ended, or been silent for long."""
        return self.is_gone and not self._silent

    @property
    def is_faulty(self) -> bool:
        """Whether it is there, and its device is not."""
        return _is_fault(self.state)

    def describe_loss(self) -> str:
        """Return how it is lost; empty: it is not, or has not been heard of yet."""
        if self.is_gone:
            return (
                f"the {self.name} node has gone: start it again, or see to the network between you"
            )
        if self._alive > 1 and self.name != CAMPAIGN:  # a bag that is played has set-ups
            return (
                f"{self._alive} {self.name} nodes are up in this ROS domain and namespace: stop"
                " one rig (or the replay of one), or give it another ROS_DOMAIN_ID or namespace"
            )
        return f"the {self.name}'s device is lost: {self.state.message}" if self.is_faulty else ""

    def describe_inactivity(self) -> str:
        """Return that it is not active, and what to do; empty: it has not said so."""
        if self._is_active:
            return ""
        return f"the {self.name} node is not active: activate it to go on"

    def note_lifecycle(self, state: str) -> None:
        """Hear in which state of its lifecycle it is."""
        was_active, self._is_active = self._is_active, state == IS_ACTIVE
        self.losses += was_active and not self._is_active

    def _take(self, message: Any) -> None:
        self._is_heard = True
        self.losses += _is_fault(message) and not self.is_faulty
        self.state = message
        self.take(message)

    def _take_liveliness(self, status: Any) -> None:
        self._is_heard = True
        before = self._alive
        self._alive, self._silent = status.alive_count, status.not_alive_count
        if not self._alive and self._is_in_this_process():
            self._silent = 0
        elif self._alive < before:  # the other one may be its successor
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


def _is_fault(state: Any) -> bool:
    return isinstance(state, AcquisitionState) and state.state == AcquisitionState.FAULT


class RigState:
    """Listens to the nodes that a hit needs, and says what is missing.

    Parameters
    ----------
    node : RigNode
        That listens.
    names : sequence of str
        Of `TOPICS`, which to listen to; the recorder among them.
    note_change : callable
        Called when a node has fallen silent, come back or left.

    Attributes
    ----------
    was_recorded : bool
        Whether something has been recorded since the start.
    """

    def __init__(
        self,
        node: RigNode,
        names: Sequence[str],
        note_change: Callable[[], None] = lambda: None,
    ) -> None:
        self.was_recorded = False
        self._node = node
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._stored: deque[int] = deque(maxlen=interfaces.RESULT_DEPTH)
        self._members = {name: RigMember(node, name, TOPICS[name], note_change) for name in names}
        self[RECORDER].take = self._take_recorder
        node.listen(interfaces.RECORD_STORED, self._take_stored)
        node.listen(DIAGNOSTICS, self._take_diagnostics)

    def __getitem__(self, name: str) -> RigMember:
        """Return a node of the rig by its name."""
        return self._members[name]

    @property
    def losses(self) -> int:
        """How often a node, its device or its activity was lost since the start [-]."""
        return sum(member.losses for member in self._members.values())

    def describe_loss(self, *names: str) -> str:
        """Return the first of these nodes that is lost, and how; empty: none."""
        return next(filter(None, (self[name].describe_loss() for name in names)), "")

    def describe_inactivity(self, *names: str) -> str:
        """Return the first of these nodes that is not active; empty: none has said so."""
        return next(filter(None, (self[name].describe_inactivity() for name in names)), "")

    # The recording.

    @property
    def recording(self) -> str:
        """Where a hit would be recorded now; empty: nowhere."""
        state = self[RECORDER].state
        return str(state.uri) if state is not None and state.recording else ""

    def describe_stop_of_recorder(self) -> str:
        """Return that the recorder is there and records nothing, nor waits to; empty: it does."""
        state = self[RECORDER].state
        if state is None or state.recording or state.waiting:
            return ""
        return f"the recorder has stopped: {state.message}"

    def forget_stored(self, record: int) -> None:
        """Hear that a record is to come: what was said of another of its number is void."""
        while record in self._stored:
            self._stored.remove(record)

    def is_stored(self, record: int) -> bool:
        """Whether the recorder has said that a record is on its disk."""
        return record in self._stored

    def _take_recorder(self, message: Any) -> None:
        self.was_recorded = self.was_recorded or message.recording

    def _take_stored(self, message: RecordStored) -> None:
        self._stored.append(message.record)

    # What all nodes say of themselves once a second, and when their lifecycle changes.

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if not status.name.startswith(self._prefix):
                continue
            name = status.name.removeprefix(self._prefix)
            for item in status.values:
                if item.key == LIFECYCLE and name in self._members:
                    self._members[name].note_lifecycle(item.value)
