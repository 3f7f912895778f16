"""A stranger that publishes and asks at random on a rig's topics and services, in a campaign."""

import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np
from impact_rig_msgs import srv
from rclpy.node import Node
from rclpy.serialization import serialize_message

from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import NO_IDENTITY, Identity, make_id
from impact_rig.nodes.interfaces import Topic

TOPICS = sorted(
    (item for item in vars(interfaces).values() if isinstance(item, Topic)),
    key=lambda topic: topic.name,
)
"""All that the rig has."""
SERVICES: dict[str, Any] = {
    interfaces.ARM_ACCELEROMETER: srv.Arm,
    interfaces.RELEASE_HAMMER: srv.Release,
    interfaces.SET_ANGLE: srv.SetAngle,
    interfaces.CONFIRM_SAMPLE: srv.ConfirmSample,
    interfaces.GET_RESULTS: srv.GetResults,
    **{
        interfaces.make_join_name(node): srv.JoinCampaign
        for node in ("accelerometer", "estimator", "hammer", "recorder", "visualizer")
    },
}
"""Those that ask for more than an act that anybody may do, such as a stop."""
TEXTS = ("", "measured", "bogus", "steel small", "Prüfkörper", "\x1b[2J", "x" * 300)
NUMBERS = (0.0, -1.0, 1.0, 1e-300, 1e300, np.nan, np.inf, -np.inf, 2.5e6)
LONGEST = 9
"""Of an array [-]."""


class RandomMessages:
    """Makes messages of any kind by their definitions, from a seed."""

    def __init__(self, seed: int) -> None:
        self.generator = np.random.default_rng(seed)

    def make(self, kind: Any) -> Any:
        """Return a message, or a request, with random fields."""
        fields = kind.get_fields_and_field_types()
        return kind(**{name: self._make_value(type_) for name, type_ in fields.items()})

    def choose(self, items: Any) -> Any:
        """Return one of several items."""
        return items[self.generator.integers(len(items))]

    def _make_value(self, kind: str) -> Any:  # noqa: PLR0911 - one for each kind
        if found := re.fullmatch(r"sequence<(.*?)(, \d+)?>|(.*)\[(\d+)\]", kind):
            count = int(found[4] or self.generator.integers(LONGEST))
            return [self._make_value(found[1] or found[3]) for _ in range(count)]
        if "/" in kind:
            package, name = kind.split("/")
            return self.make(getattr(import_module(f"{package}.msg"), name))
        if kind == "string":
            return self.choose(TEXTS)
        if kind == "boolean":
            return bool(self.generator.integers(2))
        if kind == "octet":
            return bytes([self.generator.integers(256)])
        if kind in ("float", "double"):
            value = float(self.choose(NUMBERS))
            return value if kind == "double" or not abs(value) > 1e38 else 0.0
        bits = int(re.sub(r"\D", "", kind))
        low = 0 if kind.startswith("u") else -(2 ** (bits - 1))
        ends = (low, low + 2**bits - 1, 0, 1, 2, 3)
        return int(self.choose(ends))


class Stranger:
    """A node that does not belong to the rig.

    Parameters
    ----------
    node : Node
        By which it publishes and asks.
    seed : int
        The same seed gives the same messages.
    topics : list of Topic
        On which it publishes.
    """

    def __init__(self, node: Node, seed: int, topics: list[Topic]) -> None:
        self._random = RandomMessages(seed)
        self.identity = NO_IDENTITY  # read from the wire
        self._node, self._topics = node, topics
        self._publishers: list[tuple[Topic, Any]] = []
        self._clients = [(kind, node.create_client(kind, name)) for name, kind in SERVICES.items()]
        self.foreign: set[bytes] = set()  # messages with another id than the campaign's
        node.create_subscription(
            interfaces.RELEASE.type,
            interfaces.RELEASE.name,
            self._read_ids,
            interfaces.RELEASE.qos,
        )

    def _read_ids(self, message: Any) -> None:
        from impact_rig.nodes.identity import identity_from_msg

        self.identity = identity_from_msg(message)

    def begin(self) -> None:
        """Become a publisher, without a lease, as `ros2 topic pub` and a bag have none."""
        self._publishers = [
            (topic, self._node.create_publisher(topic.type, topic.name, topic.qos))
            for topic in self._topics
        ]

    def end(self) -> None:
        """Be no publisher any more."""
        for _, publisher in self._publishers:
            self._node.destroy_publisher(publisher)

    def publish(self, *, with_ids: bool) -> None:
        """Publish a random message, with the campaign's ids or with none or others."""
        topic, publisher = self._random.choose(self._publishers)
        message = self._random.make(topic.type)
        others = (NO_IDENTITY, Identity(make_id(), make_id()))
        (self.identity if with_ids else self._random.choose(others)).fill(message)
        if not with_ids and hasattr(message, "campaign_id"):
            self.foreign.add(serialize_message(message))
        publisher.publish(message)

    def ask(self) -> None:
        """Send a random request, and wait for no answer."""
        kind, client = self._random.choose(self._clients)
        if client.service_is_ready():
            future = client.call_async(self._random.make(kind.Request))
            client.remove_pending_request(future)

    def list_recorded(self, messages: Iterator[Any]) -> list[str]:
        """Return the topics of foreign messages among those of a recording."""
        return [raw.channel.topic for raw in messages if bytes(raw.data) in self.foreign]
