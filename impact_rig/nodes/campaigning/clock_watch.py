"""Whether the clocks of a rig's computers agree.

Nothing waits by another computer's clock, and nothing is lost where clocks differ. But what is
recorded and shown carries the times of those who said it.
"""

import time
from collections import deque

from impact_rig.nodes.interfaces import DIAGNOSTICS
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.unhurried import UnhurriedGroup, take_message
from impact_rig.recording.interfaces.messages import stamp_from_msg

LARGEST_DIFFERENCE = 0.5
"""How far clocks may be apart before it is told [s], our choice: time servers keep them within
milliseconds, and a message is on its way for less, the fastest of several above all."""
SEVERAL = 5
"""Messages of a node that are looked at together [-], our choice: those of five seconds."""
NANO = 1e-9


class ClockWatch:
    """Compares the clocks of the rig's nodes with this one's, by their diagnostics.

    Parameters
    ----------
    node : RigNode
        That listens.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._delays: dict[str, deque[float]] = {}
        self._subscription = node.listen(
            DIAGNOSTICS, lambda _: None, callback_group=UnhurriedGroup()
        )

    def find_warning(self) -> str:
        """Return which nodes' clocks are how far from this one's; empty: all agree."""
        while (taken := take_message(self._subscription)) is not None:
            message, info = taken
            received = info["received_timestamp"] or time.time_ns()
            delay = NANO * (received - stamp_from_msg(message.header.stamp))
            for status in message.status:
                if status.name.startswith(self._prefix):
                    self._delays.setdefault(status.name, deque(maxlen=SEVERAL)).append(delay)
        apart = {
            name.removeprefix(self._prefix): min(delays)
            for name, delays in sorted(self._delays.items())
            if len(delays) == SEVERAL and abs(min(delays)) > LARGEST_DIFFERENCE
        }
        if not apart or self._node.get_value("use_sim_time"):
            return ""
        told = ", ".join(
            f"{name} {abs(delay):.1f} s {'behind' if delay > 0.0 else 'ahead'}"
            for name, delay in apart.items()
        )
        return (
            f"clocks differ from that of {self._node.get_name()}: {told}; hits count all the same,"
            " but recorded times are not to be compared: let a time server set them"
        )
