"""Runs the callbacks of a node at little more than what they cost themselves.

rclpy's own executors gather everything that they wait for anew for each callback, twice, and make
a task of each: of what a hit costs in a node that does little, that was three quarters.
"""

import threading
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Task
from rclpy.utilities import timeout_sec_to_nsec

from impact_rig.nodes import wait_list
from impact_rig.nodes.wait_list import WaitList

_CONTINUES_ITSELF = hasattr(Executor, "_call_task_in_next_spin")
"""Whether a task goes on by itself when what it waits for is done, as since rclpy 7.1.9; before,
the executor has to look."""
_NEEDED = (
    *("_take_timer", "_take_subscription", "_take_guard_condition", "_take_client"),
    *("_take_service", "_take_waitable"),
)
"""Methods of rclpy's executors that are no public ones, and that `NodeExecutor` calls."""


def make_executor(*, context: Context | None = None) -> Executor:
    """Return what runs the callbacks of a node.

    Parameters
    ----------
    context : Context, optional
        Of the nodes; the default one by default.

    Returns
    -------
    Executor
        A `NodeExecutor`; of an rclpy whose insides have changed, its own, which costs more.
    """
    is_known = all(hasattr(Executor, name) for name in _NEEDED)
    return (NodeExecutor if is_known else SingleThreadedExecutor)(context=context)


class NodeExecutor(Executor):
    """Runs callbacks in the thread that spins, one after the other, as the nodes' groups allow.

    What it waits for is gathered anew when something is added or removed. A callback becomes a
    task only if it waits for something itself.

    Parameters
    ----------
    context : Context, optional
        Of the nodes; the default one by default.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._due: deque[Any] = deque()
        self._suspended: list[Any] = []
        self._list: WaitList | None = None
        self._is_outdated = True
        self._thread = threading.get_ident()
        self._takers: dict[str, Callable[[Any], Any]] = {
            "": self._take_waitable,
            wait_list.TIMER: self._take_due_timer,
            wait_list.SUBSCRIPTION: self._take_subscription,
            wait_list.GUARD: self._take_guard_condition,
            wait_list.CLIENT: self._take_client,
            wait_list.SERVICE: self._take_service,
        }

    def add_node(self, node: Node) -> bool:
        """Run the callbacks of a node, too; return whether it was not there before."""
        is_new = bool(super().add_node(node))
        self.wake()
        return is_new

    def remove_node(self, node: Node) -> None:
        """Run the callbacks of a node no longer."""
        super().remove_node(node)
        self.wake()

    def wake(self) -> None:
        """Gather anew what is waited for; rclpy calls this when something was added or removed."""
        self._is_outdated = True
        self._end_waiting()

    def create_task(
        self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any
    ) -> Any:
        """Run a function or coroutine soon; may be called in any thread."""
        task = Task(callback, args, kwargs, executor=self)
        self._call_task_in_next_spin(task)
        return task

    def _call_task_in_next_spin(self, task: Any) -> None:
        # By this name rclpy calls it for a coroutine that wants to go on at once.
        self._due.append(task)
        self._end_waiting()

    def _end_waiting(self) -> None:
        guard = self._guard
        if guard is not None and threading.get_ident() != self._thread:
            guard.trigger()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait until something is ready or a task is due, and run all that is.

        Parameters
        ----------
        timeout_sec : float, optional
            How long to wait [s]; for ever by default.

        Raises
        ------
        ExternalShutdownException
            If the context has been shut down.
        Exception
            That a callback has raised.
        """
        if self._is_shutdown:
            return
        self._thread = threading.get_ident()
        waiting = self._gather()
        waiting.wait(0 if self._due else timeout_sec_to_nsec(timeout_sec))
        if not self._context.ok():
            raise ExternalShutdownException
        for kind, entity in waiting.find_ready():
            # What is ready comes again, if it is still there then; but a guard condition is heard
            # once.
            if kind == wait_list.GUARD or not self._is_outdated:
                self._run(entity, self._takers[kind])
        self._run_tasks()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Run nothing any more, and let go of what was waited for."""
        if self._list is not None:
            self._list.close()
            self._list = None
        return bool(super().shutdown(timeout_sec))

    def _gather(self) -> WaitList:
        waiting = self._list
        if waiting is None or self._is_outdated:
            # First: what is added from now on is gathered the next time.
            self._is_outdated = False
            if waiting is not None:
                waiting.close()
            wakers = (self._guard, self._sigint_gc)
            waiting = self._list = WaitList(self._context, self.get_nodes(), wakers)
        return waiting

    def _run_tasks(self) -> None:
        """Let tasks go on that are due now, but not those that they make due."""
        tasks = [self._due.popleft() for _ in range(len(self._due))]
        suspended, self._suspended = self._suspended, []
        for task in tasks if _CONTINUES_ITSELF else [*tasks, *suspended]:
            task()
        for task in dict.fromkeys([*suspended, *tasks]):
            if task.done():
                task.result()
            elif not task.cancelled():
                self._suspended.append(task)

    def _take_due_timer(self, timer: Any) -> Any:
        # A callback before it may have stopped it.
        return self._take_timer(timer) if timer.handle.is_timer_ready() else None

    def _run(self, entity: Any, take: Callable[[Any], Any]) -> None:
        """Run the callback of something that is ready, as far as it goes without waiting."""
        group = entity.callback_group
        if not group.beginning_execution(entity):
            return
        coroutine = self._call_back(entity, take)
        try:
            coroutine.send(None)
        except StopIteration:
            return
        task = self.create_task(coroutine)
        if not group.can_execute(entity):
            # The others of its group stand still until it is done.
            self.wake()
            task.add_done_callback(lambda _: self.wake())

    async def _call_back(self, entity: Any, take: Callable[[Any], Any]) -> None:
        try:
            call_back = take(entity)
            if call_back is not None:
                await call_back()
        finally:
            entity.callback_group.ending_execution(entity)
