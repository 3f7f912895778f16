"""Common part of the rig's nodes: topics with one way in, campaigns, and diagnostics."""

import json
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from impact_rig_msgs.srv import Act, JoinCampaign
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from std_srvs.srv import Trigger

from impact_rig.core.given.errors import RigError
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import BEAT, NumberedState
from impact_rig.nodes.identity import Identity, id_from_msg
from impact_rig.nodes.intake import UNNAMED, UNSOUND, Intake, Received
from impact_rig.nodes.interfaces import Topic, make_join_name
from impact_rig.nodes.managed_node import ManagedNode
from impact_rig.nodes.rig_member import RigMember

DIAGNOSTIC_PERIOD = 1.0
"""Time between two diagnostic messages of a node [s]."""
PARAMETERS = "parameters"
"""A node's diagnostics have a second status of this name: its parameters in JSON, and, as its
message, the id of its campaign."""
Answer: TypeAlias = tuple[bool, str]
"""Whether something was done, and what was done, or why not."""
_NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
"""rclpy's own callbacks warn of a QoS that does not fit, as the subscriber's do; each callback
adds to the cost of every message."""


class RigNode(ManagedNode):
    """A node of the rig."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.intake = Intake(self)
        self.membership = self.intake.membership
        self.rounds = 0  # of the executor, one a second
        self._states: list[tuple[Any, Callable[[], None]]] = []
        self._stated = b""  # the campaign for which they were published when it was joined
        self._diagnostics = self.advertise(interfaces.DIAGNOSTICS)
        # After a transition at once: a rig waits for a node that is not active.
        self.create_timer(DIAGNOSTIC_PERIOD / self.pace, self.on_changed)
        self.create_timer(BEAT / self.pace, self._repeat_states)

    # Overridden by the nodes.

    def diagnose(self) -> dict[str, Any]:
        """Return figures for the diagnostics, by name."""
        return {}

    def join(
        self, setup: RigSetup, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> None:
        """Take part in a campaign, or go on with it; the message says why no hit can come now."""

    def describe_warning(self) -> str | None:
        """Return a warning for the diagnostics; None: there is none."""
        return None

    # Topics.

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
        """Subscribe to one of the rig's topics, as `Intake.subscribe`."""

        def take(received: Received[Any]) -> None:
            self.on_received(topic, callback, received)
            self.wake_waiters()

        return self.intake.subscribe(topic, take, on_liveliness)

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
        if UNNAMED in names:
            return None
        return next((name for name in required if name not in names), None)

    def is_connected(self, publisher: Any) -> bool:
        """Return whether all subscribers that the graph knows are connected to a publisher.

        A message that is not latched is lost for the others.
        """
        count: int = publisher.get_subscription_count()
        return count >= self.count_subscribers(publisher.topic_name)

    @staticmethod
    def wait_for_acks(publishers: Sequence[Any], timeout: float) -> bool:
        """Wait until all subscribers have what was published; return whether they have."""
        deadline = time.monotonic() + timeout
        # rclpy's own wait holds Python's lock.
        while not all(publisher.wait_for_all_acked(Duration()) for publisher in publishers):
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.01)
        return True

    def advertise_state(self, topic: Topic) -> Callable[..., None]:
        """Create a publisher of a state topic; return a function that publishes its fields."""
        publisher = self.advertise(topic)
        newest: dict[str, Any] = {}

        def publish(**fields: Any) -> None:
            newest.update(fields)
            stamp = self.get_clock().now().to_msg()
            publisher.publish(self.membership.identity.fill(topic.type(**newest), stamp))

        # Members of a campaign ignore what was published before this node joined it.
        self._states.append((publisher, lambda: publish() if newest else None))
        return publish

    def number_state(
        self, topic: Topic, tell: Callable[[Mapping[str, Any]], Any] = dict
    ) -> NumberedState:
        """Create a publisher of a state from which persons act; `tell`: what it tells them."""
        return NumberedState(
            lambda: self.get_clock().now().nanoseconds, self.advertise_state(topic), tell
        )

    # Services and campaigns.

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **options: Any) -> Any:
        """Create a service with room for many requests at once: none is dropped unanswered."""
        options.setdefault("qos_profile", interfaces.SERVICES)
        return super().create_service(srv_type, srv_name, callback, **options)

    def offer_act(
        self, name: str, act: Callable[[str], Answer], state: NumberedState | None = None
    ) -> None:
        """Offer an act to a person, whose name it gets.

        One that may lead to a swing is refused if it was made from an older `state` of this node.
        """

        def answer(request: Act.Request, response: Act.Response) -> Act.Response:
            refusal = None if state is None else state.refuse(request)
            response.success, response.message = (False, refusal) if refusal else act(request.by)
            return response

        self.create_service(Act, name, answer)

    def offer(self, name: str, act: Callable[[], Answer]) -> None:
        """Offer a service that asks for nothing but that something is done."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = act()
            return response

        self.create_service(Trigger, name, answer)

    def offer_to_join(self, on_change: Callable[[], None] = lambda: None) -> None:
        """Offer the service by which a campaign asks this node to take part.

        `on_change` is called when the campaign's state changes, or its node comes or goes.
        """
        self.campaign = RigMember(self, "campaign", interfaces.CAMPAIGN_STATE, on_change)
        self.create_service(JoinCampaign, make_join_name(self.get_name()), self._join)

    def _join(
        self, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> JoinCampaign.Response:
        asked = Identity(id_from_msg(request.setup.campaign_id), id_from_msg(request.stream_id))
        if self._is_bound and asked.campaign_id != self.membership.identity.campaign_id:
            response.message = f"the {self.get_name()} node takes part in a campaign that goes on"
            return response
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
            self._repeat_states()
        return response

    def _repeat_states(self) -> None:
        for _, publish in self._states:
            publish()

    @property
    def _is_bound(self) -> bool:
        """Whether the campaign that this node takes part in goes on, and its node lives.

        Who stood still at its end has not heard of that: one that goes on says so twice a second.
        """
        campaign = self.campaign
        return (
            campaign.state is not None
            and campaign.campaign_id == self.membership.identity.campaign_id
            and campaign.state.is_running
            and time.monotonic() - campaign.came < interfaces.LEASE
            and not campaign.is_gone
        )

    # Diagnostics, and the end.

    def on_changed(self) -> None:
        """Publish how the node is, and its parameters."""
        self.rounds += 1
        level, message, host = DiagnosticStatus.OK, self.lifecycle, platform.node()
        if self.fault is not None:
            level, message = DiagnosticStatus.ERROR, self.fault
        elif (warning := self.describe_warning()) is not None:
            level, message = DiagnosticStatus.WARN, warning
        figures = {
            "lifecycle": self.lifecycle,
            "messages dropped": self.intake.dropped.total(),
            **self.diagnose(),
        }
        health = DiagnosticStatus(
            name=self.get_fully_qualified_name(), hardware_id=host, level=level, message=message
        )
        health.values = [KeyValue(key=key, value=str(value)) for key, value in figures.items()]
        campaign_id = self.membership.identity.campaign_id.hex()
        settings = DiagnosticStatus(
            name=f"{health.name}/{PARAMETERS}", hardware_id=host, message=campaign_id
        )
        settings.values = [
            KeyValue(key=item.name, value=json.dumps(item.value, ensure_ascii=False))
            for item in self._parameters.values()
        ]
        array = DiagnosticArray(status=[health, settings])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def close(self) -> None:
        """Close, and let the last states reach all subscribers before the middleware ends."""
        super().close()
        if self.context.ok():
            self.wait_for_acks([publisher for publisher, _ in self._states], 0.5)
