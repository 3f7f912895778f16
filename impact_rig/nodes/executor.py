"""Executor of a node's callbacks: rclpy's events executor, as its wheels have it."""

import contextlib
import inspect
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.task import Future


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
        # Without a limit the events executor of rclpy's wheels neither sleeps nor lets another
        # thread give it work: their C++ library waits for the end of time in a loop.
        executor.spin_until_future_complete(stop, timeout_sec=3600.0)


def accept_message_info(
    callback: Callable[[Any, Mapping[str, Any]], None],
) -> Callable[..., None]:
    """Return a subscription's callback that gets a message and its metadata.

    The events executor before rclpy 7.1.7 calls one of two arguments with a pair.
    """

    def take(*arguments: Any) -> None:
        callback(*(arguments if len(arguments) > 1 else arguments[0]))

    take.__signature__ = inspect.signature(callback)  # type: ignore[attr-defined]
    return take
