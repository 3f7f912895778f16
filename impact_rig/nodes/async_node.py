"""A node whose callbacks wait for conditions and for other nodes' answers."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.task import Future

from impact_rig.core.given.errors import DeviceError, RigError

RESEND_PERIOD = 3.0
"""How soon an unanswered request is sent again [s]: longer than any answer takes but
that of a hammer which has not met the rest of the rig yet."""


class AsyncNode(LifecycleNode):
    """A lifecycle node whose callbacks may wait without holding up its others.

    Timers run by a steady clock: setting the computer's clock does not delay them.

    Parameters
    ----------
    name : str
        Node name, unless remapped.
    pace : float
        How many times as often the node looks at what it looks at now and then [-].
    """

    # How long another node may take to answer [s]; only the estimator may have much to read first.
    answer_timeout = 5.0

    def __init__(self, name: str, *, pace: float = 1.0, **options: Any) -> None:
        super().__init__(name, **options)
        self.pace = pace
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.stop_requested: Future = Future()
        self._look: Future = Future()  # done: nothing waits
        self._look.set_result(None)
        # Runs while something waits: a new timer for each wait would cost as much as the wait.
        self._looking = self.create_timer(0.02, self._look_again)
        self._looking.cancel()

    def create_timer(
        self, timer_period_sec: float, callback: Any, *arguments: Any, **options: Any
    ) -> Any:
        """Create a timer that runs by a steady clock, unless another is given."""
        options.setdefault("clock", self._steady)
        return super().create_timer(timer_period_sec, callback, *arguments, **options)

    def report_fault(self, text: str) -> None:
        """Log an error."""
        self.get_logger().error(text)

    def request_stop(self, error: Exception | None = None) -> None:
        """End the node's process, with an error if there is one; thread-safe, may be repeated."""
        if self.stop_requested.done():
            return
        if error is None:
            self.stop_requested.set_result(None)
        else:
            self.stop_requested.set_exception(error)

    def run_soon(self, work: Callable[[], None]) -> None:
        """Call `work` in the executor and report a `RigError` in it; thread-safe."""
        if self.executor is not None:
            self.executor.create_task(self._run_reporting, work)

    def _run_reporting(self, work: Callable[[], None]) -> None:
        try:
            work()
        except RigError as error:
            self.report_fault(str(error))
        except Exception as error:  # noqa: BLE001 - in a task it would crash the events executor
            self.request_stop(error)
        self.wake_waiters()

    def wake_waiters(self) -> None:
        """Let `wait_until` check its conditions now."""
        if not self._look.done():
            self._look.set_result(None)

    def _look_again(self) -> None:
        if self._look.done():
            self._looking.cancel()
        self.wake_waiters()

    async def wait_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait for a condition for so many seconds; return whether it came true.

        It is checked after each message, and fifty times a second.

        Raises
        ------
        DeviceError
            If the node is to stop: nothing may hold up its end.
        """
        deadline = time.monotonic() + timeout
        while True:
            if self.stop_requested.done():
                raise DeviceError(f"the {self.get_name()} node has been stopped")
            if condition():
                return True
            if time.monotonic() >= deadline:
                return False
            if self._look.done():
                self._look = Future(executor=self.executor)
                self._looking.reset()
            await self._look

    async def call(
        self,
        client: Any,
        request: Any,
        timeout: float | None = None,
        is_given_up: Callable[[], bool] = lambda: False,
    ) -> Any:
        """Call a service of another node of the rig and return its answer.

        An unanswered request is sent again, since a server that has not discovered the client's
        reader drops its answer. The rig's services take a repeated request as the same one.

        Parameters
        ----------
        timeout : float, optional
            [s]; `answer_timeout` by default.

        Raises
        ------
        DeviceError
            If the service does not exist, no answer comes within `timeout` seconds, or
            `is_given_up` returns True.
        """
        timeout = self.answer_timeout if timeout is None else timeout
        await self.wait_until(lambda: client.service_is_ready() or is_given_up(), timeout)
        if not client.service_is_ready():
            raise DeviceError(
                f"the service {client.srv_name} is not there: start the node that offers it"
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
            raise DeviceError(f"{client.srv_name} is no longer there: start its node again")
        raise DeviceError(f"{client.srv_name} did not answer within {timeout:g} s")
