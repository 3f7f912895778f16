"""What another thread leaves to the executor, in which all that is said of a node is said."""

from collections.abc import Callable
from queue import Empty, SimpleQueue

from impact_rig.core.errors import RigError
from impact_rig.nodes.rig_node import RigNode


class Handover:
    """Runs work in the node's executor, in the order in which it was handed over.

    Parameters
    ----------
    node : RigNode
        Whose executor; a `RigError` in the work is reported there.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._work: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._guard = node.create_guard_condition(self._work_off)

    def hand_over(self, work: Callable[[], None]) -> None:
        """Let the executor call `work` soon; may be called in any thread."""
        self._work.put(work)
        self._guard.trigger()

    def _work_off(self) -> None:
        while True:
            try:
                work = self._work.get_nowait()
            except Empty:
                break
            try:
                work()
            except RigError as error:
                self._node.report_fault(str(error))
        self._node.wake_waiters()
