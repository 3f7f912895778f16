"""A node with a life cycle, checked parameters, and callbacks that may wait."""

import math
import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.task import Future

from impact_rig.configuration import parameters
from impact_rig.configuration.processes import ACTIVE, Notice, notify
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError

RCLError = rclpy_implementation.RCLError
RESEND_PERIOD = 3.0
"""How soon an unanswered request is sent again [s]: longer than any answer takes but
that of a hammer which has not met the rest of the rig yet."""


class ManagedNode(LifecycleNode):
    """A lifecycle node that says in one sentence why a transition failed.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`; a `RigError` raised
    there fails the transition, is logged as one sentence and kept as the node's fault, and the
    node can be configured again. Callbacks may wait without holding up others. Timers run by a
    steady clock: setting the computer's clock does not delay them.

    A node has the parameters that `PARAMETERS` lists under its name. What it looks at now and then
    it looks at `pace` times as often.
    """

    # How long another node may take to answer [s]; only the estimator may have much to read first.
    answer_timeout = 5.0
    # How long a callback may take [s]; after that where it stands goes to the log.
    longest_work = 5

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
        self._known = {**parameters.COMMON, **parameters.PARAMETERS.get(name, {})}
        self.is_configured = False  # in the state inactive or active
        self.is_active = False
        given = self._parameter_overrides
        parameters.check_parameters({key: item.value for key, item in given.items()})
        for key, parameter in self._known.items():
            if key in given:
                given[key] = Parameter(key, value=parameter.convert(key, given[key].value))
            self.declare_parameter(key, parameter.default, _describe(parameter))
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.fault: str | None = None  # the error in the diagnostics; None: there is none

    def configure(self) -> None:
        """Read the parameters and open what is needed."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Close what `configure` opened."""

    def on_changed(self) -> None:
        """Publish the state after a transition."""

    def report_fault(self, text: str) -> None:
        """Log an error, once while it stays the same; the next good transition ends it."""
        if text != self.fault:
            self.fault = text
            self.get_logger().error(text)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""
        return self._run_transition(self.configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        result = self._run_transition(self.activate, configured=True, active=True)
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(ACTIVE)
            notify(Notice.ACTIVE)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`."""
        return self._run_transition(self.deactivate, configured=True, active=False)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`."""
        return self._run_transition(self.cleanup, configured=False, active=False)

    def _LifecycleNodeMixin__change_state(self, transition: int) -> TransitionCallbackReturn:  # noqa: N802
        """Refuse a transition that the state does not have: by rclpy it would end the process."""
        try:
            return super()._LifecycleNodeMixin__change_state(transition)
        except RCLError as error:
            self.get_logger().warning(f"the node stays {self.lifecycle}: {error}")
            return TransitionCallbackReturn.FAILURE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and close, whatever the state was."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def autostart(self) -> None:
        """Configure and activate, if the parameter of that name says so; else end, with the fault.

        No client would wait for a node that never becomes active.
        """
        if self.get_value("autostart") and not self._start():
            self.request_stop(RigError(self.fault or "the node cannot be started"))

    def _start(self) -> bool:
        """Configure and activate, or neither; return whether it is active."""
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            return False
        if self.trigger_activate() == TransitionCallbackReturn.SUCCESS:
            return True
        fault = self.fault
        self.trigger_cleanup()
        self.fault = fault
        return False

    def close(self) -> None:
        """Leave the states active and configured, whatever led here; safe to call twice."""
        if self.is_active:
            self.is_active = False
            self.deactivate()
        if self.is_configured:
            self.is_configured = False
            self.cleanup()

    def _run_transition(
        self, work: Callable[[], None], *, configured: bool, active: bool
    ) -> TransitionCallbackReturn:
        try:
            work()
        except RigError as error:
            self.report_fault(str(error))
            return TransitionCallbackReturn.FAILURE
        except ModuleNotFoundError as error:
            self.report_fault(
                f"this needs the Python package {error.name!r}, which is not installed:"
                " `impact-rig doctor` says how to get it"
            )
            return TransitionCallbackReturn.FAILURE
        self.fault = None
        self.is_configured = configured
        self.is_active = active
        self.on_changed()
        return TransitionCallbackReturn.SUCCESS

    @property
    def lifecycle(self) -> str:
        """The state that the node is in, as ROS calls it."""
        return ("unconfigured", "inactive", "active")[self.is_configured + self.is_active]

    # The parameters.

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; one that keeps its value is set, even if it is read-only.

        So `ros2 param load` takes what `ros2 param dump` wrote.
        """
        changes = [
            item
            for item in parameter_list
            if not self.has_parameter(item.name) or self.get_value(item.name) != item.value
        ]
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def _on_set_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        for change in changes:
            name, known = change.name, self._known.get(change.name)
            if known is None:
                continue
            try:
                known.convert(name, change.value)
            except ParameterError as error:
                return SetParametersResult(successful=False, reason=str(error))
            is_fixed = self.is_configured and not known.is_live
            if is_fixed and change.value != self.get_value(name):
                way = "deactivate and clean up" if self.is_active else "clean up"
                reason = f"{name} is read when the node is configured: {way} the node first"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value

    # Waiting.

    def create_timer(
        self, timer_period_sec: float, callback: Any, *arguments: Any, **options: Any
    ) -> Any:
        """Create a timer that runs by a steady clock, unless another is given."""
        options.setdefault("clock", self._steady)
        return super().create_timer(timer_period_sec, callback, *arguments, **options)

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

        Raises
        ------
        DeviceError
            If the service does not exist, no answer comes within `timeout` seconds, by default
            `answer_timeout`, or `is_given_up` returns True.
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


def _describe(parameter: parameters.Parameter) -> ParameterDescriptor:
    """Return a parameter's description for ROS 2."""
    descriptor = ParameterDescriptor(
        description=parameter.description, read_only=parameter.is_read_only
    )
    low, high = parameter.low, parameter.high
    if parameter.choices:
        descriptor.additional_constraints = f"one of {', '.join(parameter.choices)}"
    elif math.isfinite(high) and isinstance(parameter.default, int):
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    elif math.isfinite(high):
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return descriptor
