"""Where the accelerometers publish, and who listens there."""

from collections.abc import Callable
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock

from impact_rig.devices.acceleration_source import AcquisitionPlan
from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_node import RigNode


class OfferedTopic:
    """The topic that the mode wants, from the first configuration on.

    It stays when the node is unconfigured, so that what was published last reaches everybody, and
    nobody must be met anew when a lost device is back.

    Parameters
    ----------
    node : RigNode
        The accelerometers'.
    take_hit : callable
        Called with each block that is found in a running stream.
    """

    def __init__(self, node: RigNode, take_hit: Callable[[AccelerationBlock], None]) -> None:
        self.publisher: Any = None
        self._node = node
        self._take_hit = take_hit
        self._topic: interfaces.Topic | None = None
        self._hits: Any = None

    def offer(self, plan: AcquisitionPlan) -> None:
        """Offer what a plan wants, if that is something else than before."""
        topic = interfaces.ACCELERATION
        if plan.continuous:
            topic = interfaces.make_stream_topic(plan.depth)
        if topic == self._topic:
            return
        if self.publisher is not None:
            self._node.destroy_publisher(self.publisher)
        if self._hits is not None:
            self._node.destroy_subscription(self._hits)
            self._hits = None
        self._topic, self.publisher = topic, self._node.advertise(topic)
        if plan.continuous:
            self._hits = self._node.listen(interfaces.ACCELERATION, self._take_hit)

    def count_subscribers(self) -> int:
        """Return how many are connected."""
        return self.publisher.get_subscription_count() if self.publisher else 0

    def find_missing(self, required: str) -> str:
        """Return who would miss a hit; empty: nobody.

        Parameters
        ----------
        required : str
            Names of nodes that must not, by commas.
        """
        if self.publisher is None:
            return "nothing is offered yet"
        if self._hits is None:
            return self._node.find_missing_subscribers(self.publisher, required)
        hits, stream = interfaces.ACCELERATION.name, self.publisher.topic_name
        if not self._node.count_publishers(hits):
            return f"nobody finds impacts in {stream}"
        return self._node.find_missing_listeners(
            self._node.resolve_topic_name(hits), required
        ) or self._node.find_missing_subscribers(self.publisher, "")
