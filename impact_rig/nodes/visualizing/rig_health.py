"""What the nodes of a rig say of themselves, and which of them are silent."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD
from impact_rig.recording.interfaces.messages import stamp_from_msg
from impact_rig.visualization.health import Health, Level, NodeHealth

SILENCE = 5.0 * DIAGNOSTIC_PERIOD
"""After what time without a word a node counts as silent [s], our choice."""


class RigHealth:
    """Keeps the last word of every node of one rig.

    Parameters
    ----------
    namespace : str
        Of the rig: the nodes right in it belong to it.
    """

    def __init__(self, namespace: str) -> None:
        self._prefix = namespace.rstrip("/") + "/"
        self._nodes: dict[str, tuple[NodeHealth, float]] = {}
        self._stamp = 0

    def add(self, message: DiagnosticArray) -> bool:
        """Keep what nodes of the rig say; return whether there was any."""
        own = [status for status in message.status if self._is_own(status.name)]
        for status in own:
            name = status.name.removeprefix(self._prefix)
            self._nodes[name] = (_convert(name, status), time.monotonic())
        if own:
            self._stamp = stamp_from_msg(message.header.stamp)
        return bool(own)

    def make_health(self) -> Health:
        """Return what is known now, by the names of the nodes."""
        now = time.monotonic()
        return Health(
            nodes=tuple(
                _mark_silent(node, now - heard) for _, (node, heard) in sorted(self._nodes.items())
            ),
            stamp=self._stamp,
        )

    def _is_own(self, name: str) -> bool:
        return name.startswith(self._prefix) and "/" not in name.removeprefix(self._prefix)


def _convert(name: str, status: DiagnosticStatus) -> NodeHealth:
    # rclpy gives a byte for a byte.
    level = status.level[0] if isinstance(status.level, bytes) else status.level
    values = tuple((item.key, item.value) for item in status.values)
    return NodeHealth(name, int(level), status.message, values)


def _mark_silent(node: NodeHealth, silence: float) -> NodeHealth:
    if silence < SILENCE:
        return node
    return NodeHealth(
        node.name, Level.STALE, f"silent for {silence:.0f} s; last: {node.message}", node.values
    )
