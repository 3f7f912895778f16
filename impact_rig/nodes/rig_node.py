"""What all nodes of the rig share: parameters, topics, lifecycle and diagnostics."""

import threading
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from impact_rig.core.errors import RigError
from impact_rig.nodes.interfaces import DIAGNOSTICS, Topic
from impact_rig.nodes.waiting_node import WaitingNode

DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages [s]: the convention of diagnostic aggregators."""
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""What stands for the name of a node that the middleware has not heard, or not again: after a long
break of the network it knows the endpoints anew, but not whose they are."""
_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
_NO_SUBSCRIPTION_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""rclpy's own warn when somebody's QoS does not fit, as theirs do on the other side; and each has
a share in what every message costs, whichever it is."""


class RigNode(WaitingNode):
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
        self.declare(
            "autostart", True, "configure and activate at start-up, without a lifecycle manager"
        )
        self.messages_handled = 0
        self.stop_requested = threading.Event()
        self._listeners: dict[bytes, str] = {}
        self._fault = ""
        self._is_configured = False
        self._is_active = False
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, 10, event_callbacks=_NO_PUBLISHER_EVENTS
        )
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

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics, by name."""
        return {}

    def find_warning(self) -> str:
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
    ) -> None:
        """Declare a parameter with its description and, for a number, its range."""
        descriptor = ParameterDescriptor(description=description)
        if low is not None and high is not None:
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(low), to_value=int(high), step=0)
                ]
            else:
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
                ]
        self.declare_parameter(name, default, descriptor)

    def get_value(self, name: str) -> Any:
        """Return a parameter's present value."""
        return self.get_parameter(name).value

    def advertise(self, topic: Topic, **options: Any) -> Any:
        """Create a publisher of one of the rig's topics."""
        return self.create_publisher(
            topic.type,
            topic.name,
            topic.leased_qos,
            event_callbacks=_NO_PUBLISHER_EVENTS,
            **options,
        )

    def listen(
        self,
        topic: Topic,
        callback: Callable[[Any], None],
        *,
        note_liveliness: Callable[[Any], None] | None = None,
        **options: Any,
    ) -> Any:
        """Subscribe to one of the rig's topics; a `RigError` in the callback is reported.

        Parameters
        ----------
        topic : Topic
            Its name, type and QoS.
        callback : callable
            Called with each message.
        note_liveliness : callable, optional
            Called with how many publishers are alive and how many silent, when that changes. One
            that does not offer the topic's lease is not heard then.
        **options
            Of the subscription.
        """

        def guarded(message: Any) -> None:
            self.messages_handled += 1
            try:
                callback(message)
            except RigError as error:
                self.report_fault(f"{topic.name}: {error}")
            self.wake_waiters()

        def note(status: Any) -> None:
            if note_liveliness is not None:
                note_liveliness(status)
            self.wake_waiters()

        is_asked = note_liveliness is not None
        return self.create_subscription(
            topic.type,
            topic.name,
            guarded,
            topic.leased_qos if is_asked else topic.qos,
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=note, use_default_callbacks=False
            )
            if is_asked
            else _NO_SUBSCRIPTION_EVENTS,
            **options,
        )

    def find_missing_subscribers(self, publisher: Any, required: str) -> str:
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
        if missing := self.find_missing_listeners(topic, required):
            return missing
        if publisher.get_subscription_count() < self.count_subscribers(topic):
            return f"a subscriber of {topic} is still connecting"
        return ""

    def find_missing_listeners(self, topic: str, required: str) -> str:
        """Return which node does not listen to a topic, whoever publishes it; empty: none.

        Parameters
        ----------
        topic : str
            Its name.
        required : str
            As in `find_missing_subscribers`.
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

    def advertise_state(self, topic: Topic, **options: Any) -> Callable[..., None]:
        """Create a publisher of a state topic; return a function that publishes its fields."""
        publisher = self.advertise(topic, **options)

        def publish(**fields: Any) -> None:
            message = topic.type(**fields)
            message.header.stamp = self.get_clock().now().to_msg()
            publisher.publish(message)

        return publish

    def report_fault(self, text: str) -> None:
        """Log an error and show it in the diagnostics until the next good transition."""
        self._fault = text
        self.get_logger().error(text)

    def keep_fault(self, text: str) -> None:
        """Show an error in the diagnostics until the next good transition, without logging it."""
        self._fault = text

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure`."""
        return self._run_transition(state, self.configure, configured=True, active=False)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        return self._run_transition(state, self.activate, configured=True, active=True)

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
        return TransitionCallbackReturn.SUCCESS

    def _publish_diagnostics(self) -> None:
        level, message = DiagnosticStatus.OK, "active" if self._is_active else "inactive"
        if self._fault:
            level, message = DiagnosticStatus.ERROR, self._fault
        elif warning := self.find_warning():
            level, message = DiagnosticStatus.WARN, warning
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name(),
            level=level,
            message=message,
            values=[KeyValue(key=key, value=str(value)) for key, value in self.diagnose().items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def split_names(text: str) -> list[str]:
    """Return the names in a text that lists them by commas."""
    return [part.strip() for part in text.split(",") if part.strip()]
