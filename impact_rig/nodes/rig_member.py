"""Another node of the rig, as a node sees it: alive, silent, or gone."""

import math
import time
from collections.abc import Callable
from typing import Any

from impact_rig.nodes import interfaces
from impact_rig.nodes.intake import Received
from impact_rig.recordings.fields import NO_ID
from impact_rig.status.states import AcquisitionStatus, Phase


class RigMember:
    """Another node of the rig: its state and whether it lives, by a topic that only it publishes.

    A node whose process is killed, or whose computer is out of reach, publishes no goodbye. The
    lease of its topic ends in time all the same. `on_change` is called when a message is kept, and
    when a publisher has come, gone, or fallen silent.
    """

    def __init__(
        self,
        node: Any,
        name: str,
        topic: interfaces.Topic,
        on_change: Callable[[], None] = lambda: None,
    ) -> None:
        self.name = name
        self.state: Any = None  # newest state of the node; None: none yet
        self.campaign_id = NO_ID  # of that
        self.came = -math.inf  # when that did [s], by the monotonic clock
        self._on_change = on_change
        self._was_there = False
        self._alive = 0
        self._silent = 0
        self._node = node
        self._subscription = node.listen(
            topic, self._keep_state, on_liveliness=self._keep_liveliness
        )

    @property
    def is_gone(self) -> bool:
        """Whether it was there, and gives no sign of life now."""
        if self._alive or self._silent:
            return not self._alive
        # A message may come before its first sign of life.
        return self._was_there and not self._subscription.get_publisher_count()

    def describe_loss(self) -> str | None:
        """Return how it is lost; None: it is not, or was never there."""
        if self.is_gone:
            return (
                f"the {self.name} node has gone: start it again, or see to the network between you"
            )
        if self._alive > 1:
            return (
                f"{self._alive} {self.name} nodes are up in this ROS domain and namespace: stop"
                " one rig (or the replay of one), or give it another ROS_DOMAIN_ID or namespace"
            )
        state = self.state
        if isinstance(state, AcquisitionStatus) and state.state is Phase.FAULT:
            return f"the {self.name}'s device is lost: {state.message}"
        return None

    def _keep_state(self, received: Received[Any]) -> None:
        self._was_there, self.came = True, time.monotonic()
        self.state, self.campaign_id = received.value, received.identity.campaign_id
        self._on_change()

    def _keep_liveliness(self, status: Any) -> None:
        self._was_there = True
        silent = status.not_alive_count
        here = min(self._count_publishers_here(), silent) if silent else 0
        self._alive, self._silent = status.alive_count + here, silent - here
        self._on_change()

    def _count_publishers_here(self) -> int:
        """Return how many of its publishers are in this process, and alive.

        Fast DDS carries no signs of life within a participant.
        """
        node, topic = self._node, self._subscription.topic_name
        mine = {
            _read_participant(item)
            for item in node.get_subscriptions_info_by_topic(topic)
            if (item.node_name, item.node_namespace) == (node.get_name(), node.get_namespace())
        }
        publishers = node.get_publishers_info_by_topic(topic)
        return sum(_read_participant(item) in mine for item in publishers)


def _read_participant(endpoint: Any) -> bytes:
    """Return an endpoint's participant, by DDSI-RTPS 2.5: nodes of one context share it."""
    return bytes(endpoint.endpoint_gid[:12])
