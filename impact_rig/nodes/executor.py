"""What runs the callbacks of a node: rclpy's events executor, or its default one without it."""

import contextlib
import inspect
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

try:
    from rclpy.experimental import EventsExecutor
except ImportError:
    # Before rclpy 7.1.4 there was none; the default one costs three times as much a message.
    EventsExecutor = SingleThreadedExecutor

LONGEST_SPIN = 3600.0
"""How long is spun at a time [s]. Without a limit the events executor of rclpy's wheels neither
sleeps nor lets another thread give it work: their C++ library waits for the end of time in a
loop."""


def make_executor(context: Context | None = None) -> Executor:
    """Return an executor for the nodes of a context, the default one if none is given."""
    # It turns on the fault handler, which wants a standard error that is a file.
    with contextlib.redirect_stderr(sys.__stderr__):
        return EventsExecutor(context=context)


def spin_until(executor: Executor, stop: Future) -> None:
    """Run callbacks until `stop` is done, in whichever thread that happens.

    Raises
    ------
    ExternalShutdownException
        If the context has been shut down.
    """
    while executor.context.ok() and not stop.done():
        executor.spin_until_future_complete(stop, timeout_sec=LONGEST_SPIN)


class SpinningThread:
    """Runs the callbacks of a node by an executor of its own, in a thread of its own.

    Parameters
    ----------
    node : Node
        In no other executor.
    name : str
        Of the thread.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._executor = make_executor(node.context)
        self._executor.add_node(node)
        self._stop: Future = Future()
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)
        self._thread.start()

    @property
    def is_stopped(self) -> bool:
        """Whether it has been told to stop."""
        return bool(self._stop.done())

    def stop(self) -> None:
        """End the thread, before the node is destroyed; safe to call twice."""
        if not self.is_stopped:
            # Not shut down while it spins: rclpy would take it to pieces under its thread.
            self._stop.set_result(None)
            self._thread.join()
            self._executor.shutdown(timeout_sec=1.0)

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            spin_until(self._executor, self._stop)


def accept_message_info(
    callback: Callable[[Any, Mapping[str, Any]], None],
) -> Callable[..., None]:
    """Return a subscription's callback that is given a message and what is known of it.

    The events executor before rclpy 7.1.7 calls one of two arguments with a pair.
    """

    def take(*arguments: Any) -> None:
        callback(*(arguments if len(arguments) > 1 else arguments[0]))

    take.__signature__ = inspect.signature(callback)  # type: ignore[attr-defined]
    return take
