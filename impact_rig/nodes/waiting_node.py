"""What lets a node's callbacks wait: for a time, for a condition, for another node's answer."""

import contextlib
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode
from rclpy.task import Future

from impact_rig.core.errors import DeviceError, RigError

WAITING_PERIOD = 0.05
"""How often a condition without a callback is looked at [s], our choice."""
SERVICE_TIMEOUT = 20.0
"""How long another node may take to appear or answer [s], our choice: six Python processes start
in seconds on two cores."""
RESEND_PERIOD = 3.0
"""How soon an unanswered request is sent again [s], our choice: longer than any answer takes but
that of a hammer which has not met the rest of the rig yet."""


class WaitingNode(LifecycleNode):
    """A lifecycle node whose callbacks may wait without holding up its others.

    Parameters
    ----------
    name : str
        Node name, unless remapped.

    Attributes
    ----------
    waiting_group : CallbackGroup
        For callbacks that wait. While one does, the others of its group stand still: this group
        lets them pass.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.waiting_group = ReentrantCallbackGroup()
        self._waiters: list[Callable[[], None]] = []
        self._idle: list[_OneShot] = []
        # Runs while something waits; to make one each time would cost as much as the waiting.
        self._looking = self.create_timer(
            WAITING_PERIOD, self.wake_waiters, callback_group=self.waiting_group
        )
        self._looking.cancel()

    @abstractmethod
    def report_fault(self, text: str) -> None:
        """Tell of an error in what `run_once_after` was to do."""

    def run_once_after(self, delay: float, work: Callable[[], None]) -> None:
        """Call `work` once, `delay` seconds from now; a `RigError` in it is reported."""
        # rclpy remembers every timer that there ever was: those that have fired are used again.
        one_shot = self._idle.pop() if self._idle else _OneShot(self, self._fire)
        one_shot.start(delay, work)

    def _fire(self, one_shot: "_OneShot") -> None:
        one_shot.stop()
        self._idle.append(one_shot)
        try:
            one_shot.work()
        except RigError as error:
            self.report_fault(str(error))
        self.wake_waiters()

    async def wait_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait for a condition that some callback of this node makes true.

        Parameters
        ----------
        condition : callable
            Looked at after every callback of `listen` and `run_once_after`, and every
            `WAITING_PERIOD`, for what has no callback.
        timeout : float
            [s]

        Returns
        -------
        bool
            Whether the condition came true in time.
        """
        if condition():
            return True
        future: Future = Future(executor=self.executor)
        deadline = time.monotonic() + timeout

        def look() -> None:
            if future.done():
                return
            if condition():
                future.set_result(True)
            elif time.monotonic() >= deadline:
                future.set_result(False)

        self._waiters.append(look)
        if len(self._waiters) == 1:
            self._looking.reset()
        try:
            return bool(await future)
        finally:
            self._waiters.remove(look)
            if not self._waiters:
                # The node itself may be gone: then nobody waits for this any more.
                with contextlib.suppress(InvalidHandle):
                    self._looking.cancel()

    async def call(
        self,
        client: Any,
        request: Any,
        timeout: float = SERVICE_TIMEOUT,
        is_given_up: Callable[[], bool] = lambda: False,
    ) -> Any:
        """Call a service of another node of the rig and return its answer.

        A server that has not met the client's reader yet drops its answer, so an unanswered
        request is sent again: the rig's services take a repeated request as the same one.

        Parameters
        ----------
        client : Client
            Of the service.
        request : message
            What is asked.
        timeout : float
            [s]
        is_given_up : callable
            Whether nobody waits for the answer any more.

        Raises
        ------
        DeviceError
            If nobody offers the service, no answer comes within `timeout` seconds, or it is
            given up.
        """
        await self.wait_until(lambda: client.service_is_ready() or is_given_up(), timeout)
        if not client.service_is_ready():
            raise DeviceError(
                f"nobody offers the service {client.srv_name}: start the node that does"
            )
        pending: list[Future] = []
        deadline = time.monotonic() + timeout
        try:
            while (left := deadline - time.monotonic()) > 0.0 and not is_given_up():
                pending.append(client.call_async(request))
                pending[-1].add_done_callback(lambda _: self.wake_waiters())
                await self.wait_until(
                    lambda: any(item.done() for item in pending) or is_given_up(),
                    min(RESEND_PERIOD, left),
                )
                for item in pending:
                    if item.done():
                        return item.result()
        finally:
            for item in pending:
                client.remove_pending_request(item)
        if is_given_up():
            raise DeviceError(f"{client.srv_name} has not answered")
        raise DeviceError(f"{client.srv_name} did not answer within {timeout:g} s")

    def wake_waiters(self) -> None:
        """Let everything that waits in `wait_until` look at its condition."""
        for look in tuple(self._waiters):
            look()


class _OneShot:
    """A timer that calls its work once, and is then idle until it is started again."""

    def __init__(self, node: WaitingNode, fire: Callable[["_OneShot"], None]) -> None:
        self.work: Callable[[], None] = lambda: None
        self._timer = node.create_timer(WAITING_PERIOD, lambda: fire(self))
        self.stop()

    def start(self, delay: float, work: Callable[[], None]) -> None:
        self.work = work
        self._timer.timer_period_ns = round(delay * 1e9)
        self._timer.reset()

    def stop(self) -> None:
        self._timer.cancel()
