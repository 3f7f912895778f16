"""A topic taken in a thread of its own: nothing that the executor does holds it up."""

import threading
from collections.abc import Callable
from typing import Any

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation

from impact_rig.core.errors import RigError
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.unhurried import UnhurriedGroup, take_message

FOR_EVER = -1


class StreamThread:
    """Takes the messages of a topic as they come.

    They are not among those that the node has handled: its end waits for no stream.

    Parameters
    ----------
    node : RigNode
        Which subscribes; a `RigError` of `take` is reported there.
    topic : Topic
        Of which no more messages wait than its depth.
    take : callable
        Called with each message, in this thread.
    """

    def __init__(self, node: RigNode, topic: Topic, take: Callable[[Any], None]) -> None:
        self._node = node
        self._topic = topic
        self._take = take
        self._subscription = node.listen(topic, take, callback_group=UnhurriedGroup())
        self._is_stopping = threading.Event()
        self._wake = GuardCondition(None, None, context=node.context)
        self._thread = threading.Thread(target=self._run, name="stream", daemon=True)

    def start(self) -> None:
        """Begin to take."""
        self._thread.start()

    def stop(self) -> None:
        """Take no more; safe to call twice."""
        if not self._is_stopping.is_set():
            self._is_stopping.set()
            self._wake.trigger()
            self._thread.join()
            self._wake.destroy()

    def _run(self) -> None:
        # Of one subscription and one guard condition.
        waiting = rclpy_implementation.WaitSet(1, 1, 0, 0, 0, 0, self._node.context.handle)
        while not self._is_stopping.is_set():
            waiting.clear_entities()
            waiting.add_subscription(self._subscription.handle)
            waiting.add_guard_condition(self._wake.handle)
            waiting.wait(FOR_EVER)
            self._take_waiting()

    def _take_waiting(self) -> None:
        """Take what has come, until nothing is left."""
        while not self._is_stopping.is_set():
            taken = take_message(self._subscription)
            if taken is None:
                return
            try:
                self._take(taken[0])
            except RigError as error:
                self._node.report_fault(f"{self._topic.name}: {error}")
