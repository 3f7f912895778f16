"""What all nodes of the rig share: parameters, topics, lifecycle and diagnostics."""

import contextlib
import math
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from impact_rig_msgs.srv import JoinCampaign
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.task import Future

from impact_rig.configuration.processes import ACTIVE
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.nodes.identity import Identity, Membership, id_from_msg
from impact_rig.nodes.interfaces import DIAGNOSTICS, Topic, make_join_name
from impact_rig.nodes.message_check import MessageCheck

DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages of a node that has news [s]."""
SIGN_OF_LIFE = 3
"""After how many of these periods a node without news says the same again [-]: aggregators, and
the view, call one silent after five."""
LIFECYCLE = "lifecycle"
"""Among the values of a node's diagnostics: one of `LIFECYCLE_STATES`."""
IS_ACTIVE = "active"
LIFECYCLE_STATES = ("unconfigured", "inactive", IS_ACTIVE)
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""What stands for the name of a node that the middleware has not heard, or not again: after a long
break of the network it knows the endpoints anew, but not whose they are."""
WAITING_PERIOD = 0.05
"""How often a condition without a callback is looked at [s], our choice."""
OWN_NODES = frozenset((
    "accelerometer", "campaign", "campaign_client", "estimator", "hammer", "hammer_client",
    "recorder", "replay_client", "replayer", "visualizer",
))  # fmt: skip
"""Names of what belongs to a rig, in its namespace; what begins with _ is a part of another."""
LONGEST_PAUSE = 1.5
"""Longer than that a process that is not stopped does not stand still [s], our choice."""
SERVICE_TIMEOUT = 20.0
"""How long another node may take to appear or answer [s], our choice: six Python processes start
in seconds on two cores."""
RESEND_PERIOD = 3.0
"""How soon an unanswered request is sent again [s], our choice: longer than any answer takes but
that of a hammer which has not met the rest of the rig yet."""

_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
"""rclpy's own warn when somebody's QoS does not fit, as theirs do on the other side; and each has
a share in what every message costs, whichever it is."""


class Read(Enum):
    """When a node reads a parameter: from then on a new value would do nothing, and is refused."""

    AT_START = "when the process starts"
    AT_CONFIGURE = "when the node is configured"
    AT_ACTIVATE = "when the node is activated"
    AT_USE = "whenever it is needed"


@dataclass(frozen=True)
class _Declared:
    read: Read
    choices: Sequence[str]


class RigNode(LifecycleNode):
    """A lifecycle node of the rig, whose callbacks may wait without holding up its others.

    Subclasses override `configure`, `activate`, `deactivate` and `cleanup`; a `RigError` raised
    there fails the transition, is logged as one sentence and shown in the diagnostics, and the
    node can be configured again.

    Parameters
    ----------
    name : str
        Node name, unless remapped.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        # Nobody sets it, neither the computer's administrator nor a replay.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.stop_requested: Future = Future()
        self._waiters: list[Callable[[], None]] = []
        self._idle: list[_OneShot] = []
        # Runs while something waits; to make one each time would cost as much as the waiting.
        self._looking = self.create_timer(WAITING_PERIOD, self.wake_waiters)
        self._looking.cancel()
        self._declared: dict[str, _Declared] = {}
        self._is_configured = False
        self._is_active = False
        self.add_on_set_parameters_callback(self._judge_parameters)
        self.declare(
            "autostart", True, "configure and activate at start-up, without a lifecycle manager",
            read=Read.AT_START,
        )  # fmt: skip
        self.messages_handled = 0
        self.message_check = MessageCheck(self.get_logger().warning)
        self._listeners: dict[bytes, str] = {}
        self.membership = Membership(self.get_logger().warning)
        self._states: list[Callable[[], None]] = []
        self._fault = ""
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, 10, event_callbacks=_NO_PUBLISHER_EVENTS
        )
        self._published = DiagnosticStatus()
        self._periods_without_news = 0
        self.create_timer(DIAGNOSTIC_PERIOD, self._publish_diagnostics)

    # Overridden by the nodes.

    def configure(self) -> None:
        """Read the parameters and open what is needed."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Close what `configure` opened."""

    def check_parameters(self, get_value: Callable[[str], Any]) -> None:
        """Raise a `RigError` if the parameters, by their names, cannot be meant together."""

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics, by name."""
        return {}

    def join(self, request: JoinCampaign.Request, response: JoinCampaign.Response) -> str:
        """Take part in a campaign, or go on with it; return why no hit can be struck now."""
        return ""

    def describe_warning(self) -> str:
        """Return what needs attention though the node works; empty: nothing."""
        return ""

    # Used by the nodes.

    @property
    def is_active(self) -> bool:
        """Whether the node is in the state `active`."""
        return self._is_active

    @property
    def is_configured(self) -> bool:
        """Whether the node is in the state `inactive` or `active`."""
        return self._is_configured

    @property
    def fault(self) -> str:
        """What the diagnostics call an error; empty: nothing."""
        return self._fault

    def declare(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        low: float | None = None,
        high: float | None = None,
        choices: Sequence[str] = (),
        read: Read = Read.AT_CONFIGURE,
    ) -> None:
        """Declare a parameter: its range if it is a number, or the choices; when it is read."""
        descriptor = ParameterDescriptor(description=description, read_only=read is Read.AT_START)
        if choices:
            descriptor.additional_constraints = f"one of {', '.join(choices)}"
        if low is not None and high is not None:
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(low), to_value=int(high), step=0)
                ]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
                ]
        self._declared[name] = _Declared(read, choices)
        self.declare_parameter(name, default, descriptor)

    def _judge_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse what no transition could use, or what would have no effect any more."""
        try:
            for parameter in parameters:
                if parameter.name in self._declared:
                    self._check_parameter(parameter)
            # While they are being declared, not all are there yet.
            if all(self.has_parameter(parameter.name) for parameter in parameters):
                self._check_together({each.name: each.value for each in parameters})
        except RigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_parameter(self, parameter: Parameter) -> None:
        name, value, declared = parameter.name, parameter.value, self._declared[parameter.name]
        if declared.choices and value not in declared.choices:
            raise ParameterError(
                f"{name} is {value!r}: it must be one of {', '.join(declared.choices)}"
            )
        if not self.has_parameter(name) or value == self.get_value(name):
            return
        if declared.read is Read.AT_CONFIGURE and self._is_configured:
            way = "deactivate and clean up" if self._is_active else "clean up"
        elif declared.read is Read.AT_ACTIVATE and self._is_active:
            way = "deactivate"
        else:
            return
        raise ParameterError(
            f"{name} is read {declared.read.value}, which it is: {way} the node first"
        )

    def _check_together(self, changes: dict[str, Any]) -> None:
        try:
            self.check_parameters(self.get_value)
        except RigError:
            # They are impossible as it is: it may take more than one change to mend that.
            return
        self.check_parameters(
            lambda name: changes[name] if name in changes else self.get_value(name)
        )

    def create_timer(
        self, timer_period_sec: float, callback: Any, *arguments: Any, **options: Any
    ) -> Any:
        """Create a timer that runs by a steady clock, unless another is given."""
        options.setdefault("clock", self._steady)
        return super().create_timer(timer_period_sec, callback, *arguments, **options)

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value

    def advertise(self, topic: Topic) -> Any:
        """Create a publisher of one of the rig's topics."""
        return self.create_publisher(
            topic.type,
            topic.name,
            topic.leased_qos,
            event_callbacks=_NO_PUBLISHER_EVENTS,
        )

    def listen(
        self,
        topic: Topic,
        callback: Callable[..., None],
        *,
        note_liveliness: Callable[[Any], None] | None = None,
    ) -> Any:
        """Subscribe to one of the rig's topics; a `RigError` in the callback is reported.

        What belongs to another campaign than the one that this node takes part in is ignored.

        Parameters
        ----------
        topic : Topic
            Its name, type and QoS.
        callback : callable
            Called with each message.
        note_liveliness : callable, optional
            Called with how many publishers are alive and how many silent, when that changes.
        """

        def take(message: Any) -> None:
            self.messages_handled += 1
            if self.membership.is_foreign(message, topic.name):
                return
            if not self.message_check.accepts(topic, message):
                return
            try:
                callback(message)
            except RigError as error:
                self.report_fault(f"{topic.name}: {error}")
            self.wake_waiters()

        def note(status: Any) -> None:
            if note_liveliness is not None:
                note_liveliness(status)
            self.wake_waiters()

        return self.create_subscription(
            topic.type,
            topic.name,
            take,
            topic.qos if note_liveliness is None else topic.leased_qos,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=note if note_liveliness is not None else None,
                use_default_callbacks=False,
            ),
        )

    def describe_missing_subscribers(self, publisher: Any, required: str) -> str:
        """Return which subscriber would miss what is published next; empty: none.

        Knowing of a subscriber is not enough: what is not latched is kept for no one who is not
        connected, so as many must be connected as are known of.

        Parameters
        ----------
        publisher : Publisher
            Of this node.
        required : str
            Names of nodes, by commas: of this namespace, or full ones.
        """
        topic = publisher.topic_name
        if missing := self.describe_missing_listeners(topic, required):
            return missing
        if publisher.get_subscription_count() < self.count_subscribers(topic):
            return f"a subscriber of {topic} is still connecting"
        return ""

    def describe_missing_listeners(self, topic: str, required: str) -> str:
        """Return which node does not listen to a topic, whoever publishes it; empty: none.

        Parameters
        ----------
        topic : str
            Its name.
        required : str
            As in `describe_missing_subscribers`.
        """
        prefix = self.get_namespace().rstrip("/")
        names = set()
        for item in self.get_subscriptions_info_by_topic(topic):
            identity = bytes(item.endpoint_gid)
            if item.node_name != _UNKNOWN_NODE:
                self._listeners[identity] = f"{item.node_namespace.rstrip('/')}/{item.node_name}"
            names.add(self._listeners.get(identity, ""))
        for name in split_names(required):
            if (name if name.startswith("/") else f"{prefix}/{name}") not in names:
                return f"the node {name!r} does not listen to {topic}"
        return ""

    def advertise_state(self, topic: Topic) -> Callable[..., None]:
        """Create a publisher of a state topic; return a function that publishes its fields."""
        publisher = self.advertise(topic)
        newest: dict[str, Any] = {}

        def publish(**fields: Any) -> None:
            newest.update(fields)
            message = topic.type(**newest)
            self.membership.identity.fill(message)
            message.header.stamp = self.get_clock().now().to_msg()
            publisher.publish(message)

        # Who takes part in the campaign ignores what was said before this node joined it.
        self._states.append(lambda: publish() if newest else None)
        return publish

    def offer_to_join(self) -> None:
        """Offer the service by which a campaign asks this node to take part."""
        self.create_service(JoinCampaign, make_join_name(self.get_name()), self._join)

    def _join(
        self, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> JoinCampaign.Response:
        asked = Identity(id_from_msg(request.setup.campaign_id), id_from_msg(request.stream_id))
        is_new = self.membership.join(asked)
        try:
            if not self._is_active:
                why = self._fault or "activate it to go on"
                response.message = f"the {self.get_name()} node is not active: {why}"
            else:
                response.message = self.join(request, response)
        except RigError as error:
            self.report_fault(str(error))
            response.message = f"{self.get_name()}: {error}"
        response.success = not response.message
        if is_new:
            for publish in self._states:
                publish()
        return response

    def report_fault(self, text: str) -> None:
        """Log an error and show it in the diagnostics until the next good transition."""
        self._fault = text
        self.get_logger().error(text)

    def keep_fault(self, text: str) -> None:
        """Show an error in the diagnostics until the next good transition, without logging it."""
        self._fault = text

    # Work for later, and waiting: for a time, a condition, another node's answer.

    def request_stop(self, error: Exception | None = None) -> None:
        """Let the node's process end, as failed if there is an error; in any thread, and twice."""
        if self.stop_requested.done():
            return
        if error is None:
            self.stop_requested.set_result(None)
        else:
            self.stop_requested.set_exception(error)

    def run_soon(self, work: Callable[[], None]) -> None:
        """Call `work` in the executor; in any thread. A `RigError` in it is reported."""
        if self.executor is not None:
            self.executor.create_task(self._run_reporting, work)

    def run_once_after(self, delay: float, work: Callable[[], None]) -> None:
        """Call `work` once, `delay` seconds from now; a `RigError` in it is reported."""
        # rclpy remembers every timer that there ever was: those that have fired are used again.
        one_shot = self._idle.pop() if self._idle else _OneShot(self, self._fire)
        one_shot.start(delay, work)

    def _fire(self, one_shot: "_OneShot") -> None:
        one_shot.stop()
        self._idle.append(one_shot)
        self._run_reporting(one_shot.work)

    def _run_reporting(self, work: Callable[[], None]) -> None:
        try:
            work()
        except RigError as error:
            self.report_fault(str(error))
        except Exception as error:  # noqa: BLE001 - in a task it would crash the events executor
            self.request_stop(error)
        self.wake_waiters()

    async def pause(self, delay: float) -> None:
        """Wait for so long [s]; raises `DeviceError` as `wait_until` does."""
        is_over: list[bool] = []
        self.run_once_after(delay, lambda: is_over.append(True))
        await self.wait_until(lambda: bool(is_over), math.inf)

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

        Raises
        ------
        DeviceError
            If the node is to stop: whatever still waited would keep it, and with it what other
            processes see of it, beyond its end.
        """
        future: Future = Future(executor=self.executor)
        seen = time.monotonic()
        deadline = seen + timeout

        def look() -> None:
            nonlocal seen, deadline
            if future.done():
                return
            # While the process stood still nothing could come.
            now = time.monotonic()
            deadline += max(now - seen - LONGEST_PAUSE, 0.0)
            seen = now
            if self.stop_requested.done():
                future.set_exception(DeviceError(f"the {self.get_name()} node has been stopped"))
            elif condition():
                future.set_result(True)
            elif now >= deadline:
                future.set_result(False)

        look()
        if future.done():
            return bool(future.result())
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

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""

        def configure() -> None:
            self.check_parameters(self.get_value)
            self.configure()

        return self._run_transition(state, configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        result = self._run_transition(state, self.activate, configured=True, active=True)
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(ACTIVE)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`."""
        return self._run_transition(state, self.deactivate, configured=True, active=False)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`."""
        return self._run_transition(state, self.cleanup, configured=False, active=False)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and close, whatever the state was."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def autostart(self) -> None:
        """Configure and activate, if the parameter of that name says so."""
        if not self.get_value("autostart"):
            return
        if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def close(self) -> None:
        """Leave the states active and configured, whatever led here; safe to call twice."""
        if self._is_active:
            self._is_active = False
            self.deactivate()
        if self._is_configured:
            self._is_configured = False
            self.cleanup()

    def _run_transition(
        self, state: LifecycleState, work: Callable[[], None], *, configured: bool, active: bool
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
        self._fault = ""
        self._is_configured = configured
        self._is_active = active
        # At once: a rig waits for a node that is not active.
        self._publish_diagnostics()
        return TransitionCallbackReturn.SUCCESS

    def _publish_diagnostics(self) -> None:
        state = LIFECYCLE_STATES[self._is_configured + self._is_active]
        level, message = DiagnosticStatus.OK, state
        if self._fault:
            level, message = DiagnosticStatus.ERROR, self._fault
        elif warning := self.describe_warning():
            level, message = DiagnosticStatus.WARN, warning
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name(),
            hardware_id=platform.node(),
            level=level,
            message=message,
            values=[
                KeyValue(key=key, value=str(value))
                for key, value in {
                    LIFECYCLE: state,
                    "messages dropped": self.message_check.dropped,
                    **self.diagnose(),
                }.items()
            ],
        )
        self._periods_without_news += 1
        if status == self._published and self._periods_without_news < SIGN_OF_LIFE:
            return
        self._published, self._periods_without_news = status, 0
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


class _OneShot:
    """A timer that calls its work once, and is then idle until it is started again.

    It is stopped and never destroyed: the events executor still calls a timer that was due when it
    was destroyed, but none that was due when it was stopped.
    """

    def __init__(self, node: "RigNode", fire: Callable[["_OneShot"], None]) -> None:
        self.work: Callable[[], None] = lambda: None
        self._timer = node.create_timer(WAITING_PERIOD, lambda: fire(self))
        self.stop()

    def start(self, delay: float, work: Callable[[], None]) -> None:
        self.work = work
        self._timer.timer_period_ns = round(delay * 1e9)
        self._timer.reset()

    def stop(self) -> None:
        self._timer.cancel()


class RateMeter:
    """Turns a count into a rate, from one call to the next."""

    def __init__(self) -> None:
        self._seen = (time.monotonic(), 0)

    def measure(self, count: int) -> float:
        """Return how much was counted per second since the last call, not below 0 [1/s]."""
        (then, before), self._seen = self._seen, (time.monotonic(), count)
        elapsed = self._seen[0] - then
        return max(count - before, 0) / elapsed if elapsed > 0.0 else 0.0


def split_names(text: str) -> list[str]:
    """Return the names in a text that lists them by commas."""
    return [part.strip() for part in text.split(",") if part.strip()]
