"""What an executor waits for: gathered once, and waited for again and again."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities

TIMER = "timer"
SUBSCRIPTION = "subscription"
GUARD = "guard_condition"
CLIENT = "client"
SERVICE = "service"
KINDS = (TIMER, SUBSCRIPTION, GUARD, CLIENT, SERVICE)
"""Of what is waited for, as the wait set calls them, in the order of their turns."""


class WaitList:
    """Timers, subscriptions, clients, services, guard conditions and waitables of nodes.

    Nothing in it is destroyed before it is closed, whatever its node does meanwhile.

    Parameters
    ----------
    context : Context
        Of the nodes.
    nodes : sequence of Node
        Whose callbacks are to run.
    wakers : sequence of GuardCondition
        That end the waiting, and have no callback.
    """

    def __init__(
        self, context: Context, nodes: Sequence[Node], wakers: Sequence[GuardCondition]
    ) -> None:
        self._in_use = ExitStack()
        self._waitables: list[Any] = []
        self._entities: dict[str, dict[int, Any]] = {kind: {} for kind in KINDS}
        self._handles: dict[str, list[Any]] = {kind: [] for kind in KINDS}
        for node in nodes:
            for waitable in filter(_may_run, node.waitables):
                if self._use(waitable):
                    self._waitables.append(waitable)
            for kind, entities in (
                (TIMER, node.timers),
                (SUBSCRIPTION, node.subscriptions),
                (GUARD, node.guards),
                (CLIENT, node.clients),
                (SERVICE, node.services),
            ):
                for entity in filter(_may_run, entities):
                    self._add(kind, entity)
        for waker in wakers:
            if self._use(waker.handle):
                self._handles[GUARD].append(waker.handle)
        self._in_use.enter_context(context.handle)
        self._wait_set = self._make_wait_set(context)

    def close(self) -> None:
        """Let what is not needed any more be destroyed."""
        self._in_use.close()

    def wait(self, timeout: int) -> None:
        """Wait until something is ready, or so long [ns]; below 0: for ever."""
        wait_set, handles = self._wait_set, self._handles
        wait_set.clear_entities()
        for kind, add in self._adders:
            for handle in handles[kind]:
                add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(timeout)

    def find_ready(self) -> Iterator[tuple[str, Any]]:
        """Yield what was ready when the waiting ended, with its kind; "" is that of a waitable."""
        # All are asked before the first has its turn: it may add or remove others.
        ready = [(kind, self._wait_set.get_ready_entities(kind)) for kind in KINDS]
        for waitable in [item for item in self._waitables if item.is_ready(self._wait_set)]:
            yield "", waitable
        for kind, pointers in ready:
            for pointer in pointers:
                if entity := self._entities[kind].get(pointer):
                    yield kind, entity

    def _add(self, kind: str, entity: Any) -> None:
        handle = entity.handle
        if self._use(handle):
            self._entities[kind][handle.pointer] = entity
            self._handles[kind].append(handle)

    def _use(self, item: Any) -> bool:
        """Keep something from being destroyed; return whether it was still there."""
        try:
            self._in_use.enter_context(item)
        except InvalidHandle:
            return False
        return True

    def _make_wait_set(self, context: Context) -> Any:
        counts = {kind: len(handles) for kind, handles in self._handles.items()}
        total = NumberOfEntities(
            counts[SUBSCRIPTION], counts[GUARD], counts[TIMER], counts[CLIENT], counts[SERVICE]
        )
        for waitable in self._waitables:
            total += waitable.get_num_entities()
        wait_set = _rclpy.WaitSet(
            total.num_subscriptions,
            total.num_guard_conditions,
            total.num_timers,
            total.num_clients,
            total.num_services,
            total.num_events,
            context.handle,
        )
        self._adders: tuple[tuple[str, Callable[[Any], Any]], ...] = (
            (TIMER, wait_set.add_timer),
            (SUBSCRIPTION, wait_set.add_subscription),
            (GUARD, wait_set.add_guard_condition),
            (CLIENT, wait_set.add_client),
            (SERVICE, wait_set.add_service),
        )
        return wait_set


def _may_run(entity: Any) -> bool:
    group: CallbackGroup = entity.callback_group
    return bool(group.can_execute(entity))
