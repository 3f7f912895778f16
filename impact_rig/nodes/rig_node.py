"""What all nodes of the rig share: parameters, topics, lifecycle and diagnostics."""

import json
import platform
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from impact_rig_msgs.srv import JoinCampaign
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from impact_rig.configuration.parameters import check_parameters
from impact_rig.configuration.processes import ACTIVE
from impact_rig.core.errors import RigError
from impact_rig.core.setup import RigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.async_node import AsyncNode
from impact_rig.nodes.identity import Identity, id_from_msg
from impact_rig.nodes.intake import UNSOUND, Intake, Received
from impact_rig.nodes.interfaces import DIAGNOSTICS, Topic, make_join_name

RCLError = rclpy_implementation.RCLError
DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages of a node [s]."""
PARAMETERS = "parameters"
"""A node's diagnostics have a second status of this name: its parameters in JSON, and, as its
message, the id of its campaign."""
_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
"""rclpy's own callbacks warn of a QoS that does not fit, as the subscriber's do; each callback
adds to the cost of every message."""


class RigNode(AsyncNode):
    """A lifecycle node of the rig.

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
        self._choices: dict[str, Sequence[str]] = {}
        self._fixed: set[str] = set()
        self.is_configured = False  # in the state inactive or active
        self.is_active = False
        self.fault = ""  # what the diagnostics call an error
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.declare(
            "autostart", True, "configure and activate at start-up, without a lifecycle manager"
        )
        self.intake = Intake(self)
        self.membership = self.intake.membership
        self._states: list[tuple[Any, Callable[[], None]]] = []
        self._stated = b""  # the campaign for which they were published when it was joined
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, 10, event_callbacks=_NO_PUBLISHER_EVENTS
        )
        self.create_timer(DIAGNOSTIC_PERIOD / self.pace, self._publish_diagnostics)

    # Overridden by the nodes.

    def configure(self) -> None:
        """Read the parameters and open what is needed."""

    def activate(self) -> None:
        """Start working."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Close what `configure` opened."""

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics, by name."""
        return {}

    def join(
        self, setup: RigSetup, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> None:
        """Take part in a campaign, or go on with it; the message says why no hit can come now."""

    def describe_warning(self) -> str | None:
        """Return what needs attention though the node works."""
        return None

    # Used by the nodes.

    def declare(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        low: float | None = None,
        high: float | None = None,
        choices: Sequence[str] = (),
        live: bool = False,
        read_only: bool = False,
    ) -> None:
        """Declare a parameter with its range or its choices.

        One that is `live` takes effect at once, one that is `read_only` is set when the node
        starts; any other is read when the node is configured, and cannot be set until it is
        cleaned up.
        """
        descriptor = ParameterDescriptor(description=description, read_only=read_only)
        if choices:
            descriptor.additional_constraints = f"one of {', '.join(choices)}"
            self._choices[name] = choices
        if not live:
            self._fixed.add(name)
        if low is not None and high is not None:
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(low), to_value=int(high), step=0)
                ]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
                ]
        given = self._parameter_overrides.get(name)
        if isinstance(default, float) and given and given.type_ is Parameter.Type.INTEGER:
            self._parameter_overrides[name] = Parameter(name, value=float(given.value))
        self.declare_parameter(name, default, descriptor)

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            name, value = parameter.name, parameter.value
            choices = self._choices.get(name, ())
            if choices and value not in choices:
                reason = f"{name} is {value!r}: it must be one of {', '.join(choices)}"
                return SetParametersResult(successful=False, reason=reason)
            is_fixed = self.is_configured and name in self._fixed
            if is_fixed and value != self.get_value(name):
                way = "deactivate and clean up" if self.is_active else "clean up"
                reason = f"{name} is read when the node is configured: {way} the node first"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def check_overrides(self) -> None:
        """Raise a `ParameterError` if a parameter is given that no node of the rig has."""
        check_parameters(
            name for name in self._parameter_overrides if name not in self._parameters
        )

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value

    def advertise(self, topic: Topic) -> Any:
        """Create a publisher of one of the rig's topics."""
        return self.create_publisher(
            topic.type, topic.name, topic.leased_qos, event_callbacks=_NO_PUBLISHER_EVENTS
        )

    def listen(
        self,
        topic: Topic,
        callback: Callable[[Received[Any]], None],
        *,
        on_liveliness: Callable[[Any], None] | None = None,
    ) -> Any:
        """Subscribe to one of the rig's topics, by the node's intake.

        `callback` is called with each message that counts, as `Received`, and `on_liveliness` with
        the number of publishers that are alive and silent, when it changes.
        """

        def on_message(message: Any) -> None:
            if received := self.intake.take(topic, message):
                self.on_received(topic, callback, received)
                self.wake_waiters()

        return self.create_subscription(
            topic.type,
            topic.name,
            on_message,
            topic.qos if on_liveliness is None else topic.leased_qos,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=on_liveliness, use_default_callbacks=False
            ),
        )

    def on_received(
        self, topic: Topic, callback: Callable[[Any], None], received: Received[Any]
    ) -> None:
        """Call back with a message that counts, and report a `RigError`."""
        try:
            callback(received)
        except RigError as error:
            self.report_fault(f"{topic.name}: {error}")

    def find_missing_subscriber(self, topic: str, required: Iterable[str]) -> str | None:
        """Return which of the required nodes does not subscribe to a topic."""
        names = {item.node_name for item in self.get_subscriptions_info_by_topic(topic)}
        # After a long break of the network the middleware knows a node's endpoints, but its name
        # never again: it may be any of them.
        if "_NODE_NAME_UNKNOWN_" in names:
            return None
        return next((name for name in required if name not in names), None)

    def is_connected(self, publisher: Any) -> bool:
        """Return whether all subscribers that the graph knows are connected to a publisher.

        A message that is not latched is lost for the others.
        """
        count: int = publisher.get_subscription_count()
        return count >= self.count_subscribers(publisher.topic_name)

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

        # Members of a campaign ignore what was published before this node joined it.
        self._states.append((publisher, lambda: publish() if newest else None))
        return publish

    def offer_to_join(self) -> None:
        """Offer the service by which a campaign asks this node to take part."""
        self.create_service(JoinCampaign, make_join_name(self.get_name()), self._join)

    def _join(
        self, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> JoinCampaign.Response:
        asked = Identity(id_from_msg(request.setup.campaign_id), id_from_msg(request.stream_id))
        try:
            setup = interfaces.SETUP.convert(request.setup)
        except UNSOUND as error:
            response.message = f"{self.get_name()}: the campaign's set-up cannot be meant: {error}"
            return response
        if request.announced:
            self.membership.join(replace(asked, stream_id=self.membership.identity.stream_id))
            response.success = True
            return response
        self.membership.join(asked)
        try:
            if not self.is_active:
                why = self.fault or "activate it to go on"
                response.message = f"the {self.get_name()} node is not active: {why}"
            else:
                self.join(setup, request, response)
        except RigError as error:
            self.report_fault(str(error))
            response.message = f"{self.get_name()}: {error}"
        response.success = not response.message
        if asked.campaign_id != self._stated:
            self._stated = asked.campaign_id
            for _, publish in self._states:
                publish()
        return response

    def report_fault(self, text: str) -> None:
        """Log an error, once while it stays the same; the next good transition ends it."""
        if text != self.fault:
            self.fault = text
            self.get_logger().error(text)

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""
        return self._run_transition(self.configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        result = self._run_transition(self.activate, configured=True, active=True)
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(ACTIVE)
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
            self.get_logger().warning(f"the node stays {self._lifecycle}: {error}")
            return TransitionCallbackReturn.FAILURE

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
        if self.is_active:
            self.is_active = False
            self.deactivate()
        if self.is_configured:
            self.is_configured = False
            self.cleanup()
        if self.context.ok():
            # Else the middleware may end before the last state has reached all subscribers.
            for publisher, _ in self._states:
                publisher.wait_for_all_acked(Duration(seconds=0.2))

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
        self.fault = ""
        self.is_configured = configured
        self.is_active = active
        # At once: a rig waits for a node that is not active.
        self._publish_diagnostics()
        return TransitionCallbackReturn.SUCCESS

    @property
    def _lifecycle(self) -> str:
        """The state that the node is in, as ROS calls it."""
        return ("unconfigured", "inactive", "active")[self.is_configured + self.is_active]

    def _publish_diagnostics(self) -> None:
        state = self._lifecycle
        level, message = DiagnosticStatus.OK, state
        if self.fault:
            level, message = DiagnosticStatus.ERROR, self.fault
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
                    "lifecycle": state,
                    "messages dropped": self.intake.dropped.total(),
                    **self.diagnose(),
                }.items()
            ],
        )
        parameters = DiagnosticStatus(
            name=f"{status.name}/{PARAMETERS}",
            hardware_id=status.hardware_id,
            message=self.membership.identity.campaign_id.hex(),
            values=[
                KeyValue(key=name, value=json.dumps(parameter.value, ensure_ascii=False))
                for name, parameter in self._parameters.items()
            ],
        )
        array = DiagnosticArray(status=[status, parameters])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)
