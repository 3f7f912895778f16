"""A recording, estimated again: by an estimator node in this process, one message at a time."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from impact_rig_msgs.srv import GetResults
from rclpy.logging import LoggingSeverity, set_logger_level

from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import Block, HitLabel, Truth
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.identity import NO_IDENTITY, make_id
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg
from impact_rig.nodes.result_messages import overrule_to_msg, results_from_msg
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Report
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
            for topic in (interfaces.SETUP, interfaces.ACCELERATION, interfaces.OVERRULE)
        }
        self._sent = 0

    def leave(self) -> None:
        """Leave ROS."""
        self._executor.remove_node(self._estimator)
        self._estimator.close()
        self._estimator.destroy_node()
        super().leave()

    def estimate(self, run: Run, report: Report) -> Iterator[Results]:
        """Yield the results of each campaign with hits; tell how much was read [byte].

        Raises `RigError` if a recording is damaged, or the estimator cannot use it.
        """
        self.spin_until(
            lambda: all(item.get_subscription_count() for item in self._outputs.values()),
            20.0,
        )
        stamp, identity = stamp_to_msg(1), NO_IDENTITY
        truths: Mapping[HitLabel, Truth] | None = None  # None: no block of a campaign
        reading = run.events(report)
        for event in reading:
            if isinstance(event, Block):
                truths = reading.truths
                self._send(interfaces.ACCELERATION, block_to_msg(event, identity))
                if event.last:
                    # No record is taken for another of the same number.
                    identity = replace(identity, stream_id=make_id())
                continue
            if truths is not None:
                yield from self._collect(truths)
            truths = None
            self._send(interfaces.SETUP, setup_to_msg(event, stamp))
            for overrule in chain.from_iterable(reading.overrules.recorded.values()):
                message = overrule_to_msg(overrule, NO_IDENTITY, stamp)
                self._send(interfaces.OVERRULE, message)
        if truths is not None:
            yield from self._collect(truths)

    def _send(self, topic: interfaces.Topic, message: Any) -> None:
        self._outputs[topic.name].publish(message)
        self._sent += 1
        if not self.spin_until(
            lambda: self._estimator.intake.handled >= self._sent, BLOCK_TIMEOUT
        ):
            raise RigError(f"the estimator took no message of {topic.name} for {BLOCK_TIMEOUT} s")

    def _collect(self, truths: Mapping[HitLabel, Truth]) -> Iterator[Results]:
        if self._estimator.fault:
            raise RigError(self._estimator.fault)
        request = GetResults.Request()
        answer = self.call(GetResults, interfaces.GET_RESULTS, request, RESULTS_TIMEOUT)
        faults = {label.record: truth.faults for label, truth in truths.items()}
        results = results_from_msg(answer, faults)
        if results.hits:
            yield results
