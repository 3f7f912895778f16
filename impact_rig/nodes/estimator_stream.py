"""The running stream: received in its own thread, its impacts published as if triggered."""

import contextlib
import threading
from collections.abc import Callable
from typing import Any

from impact_rig_msgs.msg import StreamBlock
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

from impact_rig.core.errors import RigError
from impact_rig.core.setup import AnalysisSettings
from impact_rig.core.stream import StreamCutter, StreamFlow
from impact_rig.nodes import interfaces
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.identity import identity_from_msg
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.rig_node import RateMeter, RigNode
from impact_rig.recordings.messages import block_from_msg


class StreamCutting:
    """Cuts impacts out of `StreamBlock` messages, and publishes them as `AccelerationBlock`.

    The stream is fed in one thread; settings and questions come from any. The publisher is made
    when the first block comes: where there is no stream, the accelerometers publish the impacts.

    Parameters
    ----------
    node : RigNode
        The estimator.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._settings: AnalysisSettings | None = None
        self._cutter: StreamCutter | None = None
        self._publisher: Any = None
        self._rate = RateMeter()

    def use_settings(self, settings: AnalysisSettings) -> None:
        """Cut by other settings from the next block on."""
        if settings != self._settings:
            self._settings, self._cutter = settings, StreamCutter(settings)

    def feed(self, message: StreamBlock) -> None:
        """Take the next block of the stream, and publish the impact that it completes.

        Raises
        ------
        RigError
            If the stream cannot be searched.
        """
        if self._publisher is None:
            self._publisher = self._node.advertise(interfaces.ACCELERATION)
        if self._cutter is None:
            return
        identity = identity_from_msg(message)
        for cut in self._cutter.feed(block_from_msg(message)):
            self._publisher.publish(block_to_msg(cut, identity))

    def describe(self) -> dict[str, Any]:
        """Return the flow, by names for the diagnostics, and the rate since the last call."""
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
        """Return how much of the stream has been lost; empty: nothing."""
        lost = self._cutter.flow.missing_points if self._cutter else 0
        if not lost:
            return ""
        return (
            f"{lost} points of the stream were lost: this computer does not hold its rate;"
            " hits that lack points are rejected"
        )


class StreamListener:
    """Calls back with the messages of a topic in its own thread, by a hidden node.

    A `RigError` of the callback is reported by the estimator. These messages are not among those
    that the estimator has handled: its end waits for no stream.
    """

    def __init__(self, node: RigNode, topic: Topic, callback: Callable[[Any], None]) -> None:
        self._node = node
        self._topic = topic
        self._callback = callback
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
        self._listener.create_subscription(topic.type, name, self._on_message, topic.qos)
        self._executor = make_executor(node.context)
        self._executor.add_node(self._listener)
        self._stop: Future = Future()
        self._thread = threading.Thread(target=self._spin, name="stream", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Take no more; safe to call twice."""
        if not self._stop.done():
            # The executor is shut down after its thread: rclpy would take it apart while it spins.
            self._stop.set_result(None)
            self._thread.join()
            self._executor.shutdown(timeout_sec=1.0)
            self._listener.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            spin_until(self._executor, self._stop)

    def _on_message(self, message: Any) -> None:
        if self._stop.done() or self._node.membership.is_foreign(message, self._topic.name):
            return
        if not self._node.message_check.accepts(self._topic, message):
            return
        try:
            self._callback(message)
        except RigError as error:
            text = f"{self._topic.name}: {error}"
            if text != self._node.fault:  # the next block would fill the log with the same
                self._node.report_fault(text)
