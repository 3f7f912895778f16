"""One node, one process: started, stopped by a signal, and closed cleanly whatever happens."""

import ctypes
import faulthandler
import gc
import os
import select
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Sequence

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from impact_rig.configuration.node_claim import claim_node
from impact_rig.configuration.processes import LAUNCHER
from impact_rig.core.given.errors import RigError
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.rig_node import RigNode

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
STUCK_AFTER = 600.0
"""How long a node may stand still, none of its threads running Python, or take to end [s], our
choice: longer than a person lets a stopped process stand who means to go on with it."""
LONGEST_CLOSE = 18.0
"""How long a node may take to close [s]: what it records may be on a slow disk, and `ros2 launch`
kills it after 20 s."""
LONGEST_LEAVE = 6
"""How long the middleware may then take to leave [s]: more than 3 s on a busy machine, and
`impact-rig up` kills after 10 s."""
LOOK_PERIOD = 1.0
"""How often a thread looks whether the node's executor comes round [s]."""
DRAIN_QUIET = 0.1
"""How long nothing may have come before the queues count as empty at the end [s]."""


def run_node(make_node: Callable[[], RigNode], argv: Sequence[str] | None = None) -> int:
    """Run one node until it is asked to stop; close it cleanly whatever happens.

    `make_node` is called once ROS is up. Return the exit code: 0 after a stop that was asked for,
    2 after an impossible parameter. The process has `LONGEST_LEAVE` seconds to end then.
    """
    try:
        return _run(make_node, argv)
    finally:
        # rclpy keeps what a lifecycle node has of the middleware until nothing knows the node any
        # more. If the process ended before, Fast DDS would take it to pieces among its threads,
        # and wait for ever if a message came just then.
        gc.collect()
        rclpy.try_shutdown()
        # Python's own end would give them their default back, which kills.
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)


def _run(make_node: Callable[[], RigNode], argv: Sequence[str] | None) -> int:
    """Run a node until it is asked to stop, and close it; return the exit code."""
    executor = node = claim = None
    code = 1  # of an error that nobody expected
    try:
        with offer_profile():
            # rclpy's own handler would tear the context down under the node: nothing that is
            # still in the queues could be recorded, and no last state published.
            rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
            executor = make_executor()
            # What was imported stays: looking through all of it for garbage, now and then, would
            # hold a verdict up for 20 ms, and the end for 200 ms.
            gc.freeze()
            node = make_node()
        claim = claim_node(node.get_fully_qualified_name())
        executor.add_node(node)
        _stop_on_signals(node)
        node.autostart()
        spin_until(executor, node.stop_requested)
        node.stop_requested.result()
        node.wake_waiters()
        drain(node, executor)
        code = 0
    except ExternalShutdownException:
        code = 0
    except (InvalidParameterTypeException, InvalidParameterValueException, RigError) as error:
        if node is None or str(error) != node.fault:  # which it has said
            print(f"error: {error}", file=sys.stderr)
        code = 2
    finally:
        faulthandler.dump_traceback_later(LONGEST_CLOSE, exit=True, file=2)
        if node is not None:
            node.close()
        faulthandler.cancel_dump_traceback_later()
        # All that the node had to do is done.
        _leave_within(LONGEST_LEAVE, code)
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
        if claim is not None:
            claim.close()
    return code


class _Event(ctypes.Structure):
    """What a timer of Linux does when it runs down, `struct sigevent`."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("kind", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("rest", ctypes.c_void_p * 5),
    )


def _leave_within(seconds: int, code: int) -> None:
    """End the process with a code after some seconds, although the middleware may not let go.

    Fast DDS 2.14.5 waits for ever, and Python with it, if it leaves just when it tells of another
    node that came or went: no thread of Python could end the process then, the C library can.
    """
    library = ctypes.CDLL(None)
    call_function = 2  # SIGEV_THREAD
    end = _Event(code, 0, call_function, ctypes.cast(library["_exit"], ctypes.c_void_p))
    timer = ctypes.c_void_p()
    library.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(end), ctypes.byref(timer))
    library.timer_settime(timer, 0, (ctypes.c_long * 4)(0, 0, seconds, 0), None)


def _stop_on_signals(node: RigNode) -> None:
    """Let a signal, or the launcher's death, stop a node that waits in the middleware, too."""
    # Plain descriptors, which nothing closes before the process ends: Python writes the number of
    # each signal to the pipe, also of those that come while the node ends.
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    # Before the handlers, which lose a signal that comes between.
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    for number in STOP_SIGNALS:
        # nohup: closing the terminal is not to stop what it starts.
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: None)

    request_stop, watched_node = weakref.WeakMethod(node.request_stop), weakref.ref(node)

    def wait() -> None:
        watched = [reader, *_open_launcher()]
        is_asked, rounds, looks = False, 0, 0
        while not is_asked:
            # Fast DDS under rmw_fastrtps 8.4.3 can lock itself up for ever while it tells of a
            # publisher that came or went, and Python with it: no signal would be heard then.
            faulthandler.dump_traceback_later(STUCK_AFTER, exit=True, file=2)
            is_asked = bool(select.select(watched, [], [], LOOK_PERIOD)[0])
            if (node := watched_node()) is not None:
                looks = looks + 1 if 0 < node.rounds == rounds else 0
                rounds = node.rounds
                # By looks: a process that was stopped has not stood in a callback.
                if looks == node.longest_work:
                    told = f"no callback for {looks} s, after {node.intake.handled} messages"
                    node.get_logger().error(f"{told}: where each thread stands follows")
                    faulthandler.dump_traceback(file=2)
            del node
        if stop := request_stop():
            stop()

    threading.Thread(target=wait, daemon=True).start()


def _open_launcher() -> list[int]:
    """Return a descriptor that becomes readable when the process that started the rig is dead.

    It may be killed without a chance to stop its nodes.
    """
    number = os.environ.get(LAUNCHER, "")
    if not number:
        return []
    try:
        return [os.pidfd_open(int(number))]
    except ProcessLookupError:
        return [os.open(os.devnull, os.O_RDONLY)]


def drain(node: RigNode, executor: Executor) -> None:
    """Handle the messages left in the queues, for at most 2 s."""
    deadline = time.monotonic() + 2.0
    handled = -1
    while node.intake.handled != handled and (left := deadline - time.monotonic()) > 0.0:
        handled = node.intake.handled
        executor.spin_until_future_complete(Future(), timeout_sec=DRAIN_QUIET)
        # A callback may have taken all that time: what waits behind it comes before this.
        executor.spin_until_future_complete(executor.create_task(lambda: None), timeout_sec=left)
