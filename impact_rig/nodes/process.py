"""One node, one process: started, stopped by a signal, and closed cleanly whatever happens."""

import gc
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.signals import SignalHandlerOptions

from impact_rig.core.errors import RigError
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.node_executor import make_executor
from impact_rig.nodes.rig_node import RigNode

DRAIN_QUIET = 0.1
"""How long nothing may have come before the queues count as empty at the end [s]."""
DRAIN_TIMEOUT = 2.0
"""How long emptying the queues at the end may take [s], below what process managers grant."""


def run_node(make_node: Callable[[], RigNode], argv: Sequence[str] | None = None) -> int:
    """Run one node until it is told to stop; close it cleanly whatever happens.

    Parameters
    ----------
    make_node : callable
        Returns the node; called once ROS is up.
    argv : sequence of str, optional
        Command line, ROS arguments included; the process's own by default.

    Returns
    -------
    int
        Exit code: 0 after a stop that was asked for, 2 after an impossible parameter.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    # rclpy's own handler would tear the context down under the node: nothing that is still in
    # the queues could be recorded, and no last word published.
    rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    executor = make_executor()
    node = None
    try:
        with offer_profile():
            node = make_node()
        executor.add_node(node)
        _stop_on_signals(executor, node.stop_requested)
        node.autostart()
        # What was imported stays: looking through all of it for garbage, now and then, would hold
        # a verdict up for 20 ms.
        gc.freeze()
        while not node.stop_requested.is_set():
            executor.spin_once()
        executor.shutdown()
        _drain(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (InvalidParameterTypeException, InvalidParameterValueException, RigError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    finally:
        executor.shutdown()
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _stop_on_signals(executor: Executor, stop: threading.Event) -> None:
    """Let SIGINT and SIGTERM set `stop`, even while the executor waits in the middleware.

    An executor must not be shut down from here: rclpy takes it to pieces while it still spins.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(writer.fileno())

    def wait() -> None:
        reader.recv(1)
        stop.set()
        # A task wakes the executor, and lets it return.
        executor.create_task(lambda: None)
        # The socket must outlive the function: the signal handler writes to it.
        writer.fileno()

    threading.Thread(target=wait, daemon=True).start()


def _drain(node: RigNode) -> None:
    """Work off what is still in the queues, as long as there is anything, for a bounded time."""
    executor = make_executor()
    executor.add_node(node)
    deadline = time.monotonic() + DRAIN_TIMEOUT
    quiet_since = time.monotonic()
    handled = node.messages_handled
    while time.monotonic() < deadline and time.monotonic() - quiet_since < DRAIN_QUIET:
        executor.spin_once(timeout_sec=DRAIN_QUIET)
        if node.messages_handled != handled:
            handled, quiet_since = node.messages_handled, time.monotonic()
    executor.shutdown()
