"""The visualizer: hits and verdicts, in Rerun.

A process of its own that only listens: it may drop views, never data, and nothing waits for it.
"""

import os
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, Impact, RigSetup

from impact_rig.core.setup.samples import SampleSet
from impact_rig.nodes import interfaces
from impact_rig.nodes.messages import hit_results_from_msg
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recording.interfaces.messages import (
    block_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.visualization.destinations import open_destinations
from impact_rig.visualization.sink import Destination, Work

NICENESS = 10
"""How far the process steps back [steps of nice], our choice."""


class VisualizerNode(RigNode):
    """Shows what the rig's topics say."""

    def __init__(self, **options: Any) -> None:
        super().__init__("visualizer", **options)
        self.declare("output", "", "path of the .rrd file to be written; empty: none")
        self.declare(
            "connect",
            "",
            "address of a running viewer, rerun+http://HOST:9876/proxy; empty: none",
        )
        self.declare("spawn", False, "open a viewer on this host")
        self._destinations: tuple[Destination, ...] = ()
        self._subscriptions_of_view: list[Any] = []
        self._assembler = TraceAssembler()
        self._samples: SampleSet | None = None
        self._counts = {"hits": 0}

    def configure(self) -> None:
        """Open the file and the viewers."""
        self._destinations = open_destinations(
            output=self.get_value("output"),
            connect=self.get_value("connect"),
            spawn=self.get_value("spawn"),
            notify=self.get_logger().warning,
        )
        self._samples = None

    def activate(self) -> None:
        """Listen; what was said last before is heard now."""
        self._subscriptions_of_view = [
            self.listen(topic, callback)
            for topic, callback in (
                (interfaces.SETUP, self._begin),
                (interfaces.ACCELERATION, self._take_block),
                (interfaces.IMPACT, self._take_impact),
            )
        ]

    def deactivate(self) -> None:
        """Listen no longer."""
        for subscription in self._subscriptions_of_view:
            self.destroy_subscription(subscription)
        self._subscriptions_of_view = []

    def cleanup(self) -> None:
        """Write what is still to be written, and close."""
        for destination in self._destinations:
            destination.close()
        self._destinations = ()

    def diagnose(self) -> dict[str, Any]:
        """Return what was shown, and what was not."""
        return {
            **self._counts,
            "views dropped": sum(item.dropped for item in self._destinations),
            "destinations lost": sum(item.is_lost for item in self._destinations),
        }

    def _put(self, work: Work) -> None:
        for destination in self._destinations:
            destination.put(work)

    def _begin(self, message: RigSetup) -> None:
        setup = setup_from_msg(message)
        # A layout sent again would undo what the user has arranged.
        if self._samples is None or setup.samples.names != self._samples.names:
            self._put(lambda log: log.log_setup(setup.name, setup.samples.names))
        self._samples = setup.samples

    def _take_block(self, message: AccelerationBlock) -> None:
        traces = self._assembler.feed(block_from_msg(message))
        if traces is not None:
            self._counts["hits"] += 1
            self._put(lambda log: log.log_hit(traces))

    def _take_impact(self, message: Impact) -> None:
        verdict = hit_results_from_msg(message, ())
        stamp = stamp_from_msg(message.header.stamp)
        self._put(lambda log: log.log_verdict(verdict, stamp))


def main() -> int:
    """Run the node, behind all others: it may be late, the rig may not."""
    os.nice(NICENESS)
    return run_node(VisualizerNode)


if __name__ == "__main__":
    raise SystemExit(main())
