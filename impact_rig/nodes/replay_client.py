"""A recording, estimated again: by an estimator node in this process, one message at a time."""

import os
from collections.abc import Callable, Iterator

from impact_rig_msgs.msg import RigSetup, VirtualImpact
from impact_rig_msgs.srv import GetResults
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.serialization import deserialize_message

from impact_rig.core.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import RecordingToReplay
from impact_rig.nodes.result_messages import results_from_msg
from impact_rig.recordings.messages import stamp_from_msg
from impact_rig.results.campaign import Results

BLOCK_TIMEOUT = 60.0
"""How long it may take for one message [s]."""
RESULTS_TIMEOUT = 600.0
"""How long the estimates may take [s]: fitting the model to a hundred samples."""


class ReplayClient(RigClient):
    """Publishes recordings to a fresh estimator, which takes each message before the next.

    Both have a namespace of their own: a rig may be up in the same domain.
    """

    def __init__(self) -> None:
        namespace = f"/replay_{os.getpid()}"
        super().__init__("replay_client", namespace)
        self._estimator = EstimatorNode(context=self._context, namespace=namespace)
        # Its faults are raised here.
        set_logger_level(self._estimator.get_logger().name, LoggingSeverity.FATAL)
        self._estimator.autostart()
        self._executor.add_node(self._estimator)
        self._outputs = {
            topic.name: self.advertise(topic)
            for topic in (interfaces.SETUP, interfaces.ACCELERATION)
        }
        self._faults: dict[int, tuple[str, ...]] = {}
        self._sent = 0

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._executor.remove_node(self._estimator)
        self._estimator.close()
        self._estimator.destroy_node()
        super().__exit__()

    def estimate(
        self, recording: RecordingToReplay, report: Callable[[float], None]
    ) -> Iterator[Results]:
        """Yield the results of each campaign with hits.

        Parameters
        ----------
        recording : RecordingToReplay
            What is published.
        report : callable
            Gets how far the recording was replayed, in its own time [ns].

        Raises
        ------
        RigError
            If the recording is damaged, or the estimator cannot use it.
        """
        self.spin_until(
            lambda: all(item.get_subscription_count() for item in self._outputs.values()),
            20.0,
        )
        has_setup = has_blocks = False
        for message in recording.read_messages():
            report(message.time)
            if message.topic is interfaces.VIRTUAL_IMPACT:
                truth = deserialize_message(message.data, VirtualImpact)
                self._faults[truth.record] = truth.faults
            elif message.topic is interfaces.ACCELERATION:
                has_blocks = True
                self._send(message.topic, message.data)
            elif message.topic is interfaces.SETUP:
                setup = deserialize_message(message.data, RigSetup)
                # One without a stamp is of a campaign node that has begun no campaign.
                if has_setup and not stamp_from_msg(setup.header.stamp):
                    continue
                # What comes before the first set-up belongs to its campaign.
                if has_setup and has_blocks:
                    yield from self._collect()
                    has_blocks = False
                has_setup = True
                self._send(message.topic, message.data)
        if has_blocks:
            yield from self._collect()

    def _send(self, topic: interfaces.Topic, data: bytes) -> None:
        self._outputs[topic.name].publish(data)
        self._sent += 1
        if not self.spin_until(
            lambda: self._estimator.messages_handled >= self._sent, BLOCK_TIMEOUT
        ):
            raise RigError(f"the estimator took no message of {topic.name} for {BLOCK_TIMEOUT} s")

    def _collect(self) -> Iterator[Results]:
        if self._estimator.fault:
            raise RigError(self._estimator.fault)
        request = GetResults.Request()
        answer = self.call(GetResults, interfaces.GET_RESULTS, request, RESULTS_TIMEOUT)
        if not answer.setup.samples:
            raise RigError("the recording has no set-up of the rig: nothing can be estimated")
        results = results_from_msg(answer, self._faults)
        if results.hits:
            yield results
