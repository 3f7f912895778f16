"""The running stream: taken in a thread of its own, its impacts published as if triggered."""

import math
import time
from collections.abc import Callable
from typing import Any

from impact_rig_msgs.msg import StreamBlock
from rclpy.node import Node

from impact_rig.core.errors import RigError
from impact_rig.core.setup import AnalysisSettings
from impact_rig.core.stream import StreamCutter, StreamFlow
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import SpinningThread
from impact_rig.nodes.identity import identity_from_msg
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, RateMeter, RigNode
from impact_rig.recordings.messages import block_from_msg

WARNING_TIME = 10 * DIAGNOSTIC_PERIOD
"""How long a loss is warned of [s], our choice: long enough to be seen."""
STANDSTILL = 2.0
"""How much later than due the next block may come before it is warned of [s], our choice: longer
than a computer does something else that holds the rate."""


class StreamCutting:
    """Cuts impacts out of `StreamBlock` messages, and publishes them as `AccelerationBlock`.

    The stream is fed in one thread; settings and questions come from any.

    The publisher is made when the first block comes: where there is no stream, the accelerometers
    publish the impacts.

    Parameters
    ----------
    node : RigNode
        The estimator.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._settings: AnalysisSettings | None = None
        self._used: AnalysisSettings | None = None
        self._cutter: StreamCutter | None = None
        self._publisher: Any = None
        self._rate = RateMeter()
        self._missing = 0
        self._problem = ""
        self._lost = 0
        self._lost_at = 0.0
        self._due = math.inf

    def use_settings(self, settings: AnalysisSettings) -> None:
        """Cut by other settings from the next block on, if they are others."""
        self._settings = settings

    def feed(self, message: StreamBlock) -> None:
        """Take the next block of the stream, and publish the impact that it completes.

        Raises
        ------
        RigError
            If the stream cannot be searched; not again for the same reason, since the next block
            comes at once.
        """
        try:
            self._feed(message)
        except RigError as error:
            problem, self._problem = self._problem, str(error)
            if problem != self._problem:
                raise

    def _feed(self, message: StreamBlock) -> None:
        if self._publisher is None:
            self._publisher = self._node.advertise(interfaces.ACCELERATION)
        settings, cutter = self._settings, self._cutter
        if settings is None:
            return
        if cutter is None or settings != self._used:
            cutter = self._cutter = StreamCutter(settings)
            self._used, self._missing = settings, 0
        block = block_from_msg(message)
        duration = block.hammer.output.size / block.sampling_rate
        self._due = math.inf if block.ends_stream else time.monotonic() + duration
        identity = identity_from_msg(message)
        for cut in cutter.feed(block):
            self._publisher.publish(block_to_msg(cut, identity))
        missing = cutter.flow.missing_points
        if missing > self._missing:
            if time.monotonic() - self._lost_at > WARNING_TIME:
                self._lost = 0
            self._lost += missing - self._missing
            self._lost_at, self._missing = time.monotonic(), missing

    def describe(self) -> dict[str, Any]:
        """Return the flow, the rate since this was asked last, by names for the diagnostics."""
        if self._publisher is None:
            return {}
        flow = self._cutter.flow if self._cutter else StreamFlow()
        return {
            "stream blocks": flow.blocks,
            "stream gaps": flow.gaps,
            "stream points missing": flow.missing_points,
            "stream points per second": round(self._rate.measure(flow.points)),
            "impacts while not armed": flow.other_impacts,
        }

    def describe_warning(self) -> str:
        """Return that the stream stands still, or what has been lost of late; empty: neither."""
        late = time.monotonic() - self._due
        if late > STANDSTILL and self._node.count_publishers(interfaces.STREAM.name):
            return (
                f"the stream stands still: its next block is due since {late:.0f} s; this computer"
                " does not hold its rate, or its network does not"
            )
        if not self._lost or time.monotonic() - self._lost_at > WARNING_TIME:
            return ""
        return (
            f"{self._lost} points of the stream were lost: this computer does not hold its rate;"
            " hits that lack points are rejected"
        )


class StreamListener:
    """Takes the messages of a topic as they come, by a hidden node with its own executor.

    They are not among those that the node has handled: its end waits for no stream.

    Parameters
    ----------
    node : RigNode
        For which it listens; a `RigError` of `take` is reported there.
    topic : Topic
        Of which no more messages wait than its depth.
    take : callable
        Called, in this thread, with each message.
    """

    def __init__(self, node: RigNode, topic: Topic, take: Callable[[Any], None]) -> None:
        self._node = node
        self._topic = topic
        self._take = take
        self._listener = Node(
            f"_{node.get_name()}_stream",
            namespace=node.get_namespace(),
            context=node.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        # Resolved by the node: it knows what is remapped.
        name = node.resolve_topic_name(topic.name)
        self._listener.create_subscription(topic.type, name, self._take_reporting, topic.qos)
        self._is_stopped = False  # a message may be taken before the next line is done
        self._spinning = SpinningThread(self._listener, "stream")

    def stop(self) -> None:
        """Take no more; safe to call twice."""
        if not self._is_stopped:
            self._is_stopped = True
            self._spinning.stop()
            self._listener.destroy_node()

    def _take_reporting(self, message: Any) -> None:
        if self._is_stopped or self._node.membership.is_foreign(message, self._topic.name):
            return
        if not self._node.message_check.accepts(self._topic, message):
            return
        try:
            self._take(message)
        except RigError as error:
            self._node.report_fault(f"{self._topic.name}: {error}")
