"""The replayer: publishes a recording again, byte by byte, in its own namespace."""

import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from impact_rig_msgs.msg import ReplayerState
from rclpy.parameter import Parameter

from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import split_names
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.nodes import interfaces
from impact_rig.nodes.interfaces import Topic
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import Answer, RigNode
from impact_rig.recordings.fields import NANOSECONDS
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import check_interfaces, find_message_definition

INPUTS = (
    interfaces.SETUP,
    interfaces.ACCELERATION,
    interfaces.RELEASE,
    interfaces.VIRTUAL_IMPACT,
    interfaces.OVERRULE,
)
"""Replayed topics: all others in a recording are results and states."""


class RecordedMessage(NamedTuple):
    """One message that is to be published."""

    topic: Topic
    time: int  # of its reception, since the first message [ns]
    data: bytes  # serialised


class RunToReplay:
    """The inputs in the recordings of one rig, one recording after the other without a pause.

    What reads it raises `FileError` if it is damaged, holds nothing to replay, or is of another
    version of the interfaces.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self._types = {topic.type_name: topic for topic in INPUTS}
        self.topics: dict[str, Topic] = {}
        for scan in run.scans:
            for channel in filter(partial(run.is_wanted, self._types), scan.read_channels()):
                try:
                    check_interfaces(channel, find_message_definition(channel.type_name))
                except FileError as error:
                    raise FileError(f"{scan.path}: {error}") from None
                topic = self._types[channel.type_name]
                self.topics[topic.name] = topic
        if interfaces.ACCELERATION.name not in self.topics:
            raise FileError(
                f"{run.path} holds nothing to replay, no hits of a rig: `impact-rig analyze` finds"
                " those of a running stream"
            )
        ranges = [scan.read_time_range() for scan in run.scans]
        self.duration = sum(last - first for first, last in ranges)  # [ns], of all files

    def read_messages(self) -> Iterator[RecordedMessage]:
        """Yield the messages in file order."""
        elapsed = 0
        for scan, messages in self.run.read_files(lambda _: self._types):
            first, last = scan.read_time_range()
            for raw in messages:
                topic = self._types[raw.channel.type_name]
                yield RecordedMessage(topic, elapsed + raw.log_time - first, raw.data)
            elapsed += last - first


class ReplayerNode(RigNode):
    """Replays while it is active; becomes inactive, or ends its process, when it is done."""

    def __init__(self, **options: Any) -> None:
        super().__init__("replayer", **options)
        self._recording: RunToReplay | None = None
        self._outputs: dict[str, Any] = {}
        self._timer: Any = None
        self._messages: Iterator[RecordedMessage] = iter(())
        self._next: RecordedMessage | None = None
        self._passes = 0
        self._count = 0
        self._position = 0  # what is replayed now, since the first message [ns]
        self._last_tick = 0  # when that was computed [ns]
        self._phase = ReplayerState.IDLE
        self._message = "no recording"
        self._publish = self.advertise_state(interfaces.REPLAYER_STATE)
        self.create_timer(1.0 / self.pace, self._publish_state)
        paused, playing = ReplayerState.PAUSED, ReplayerState.PLAYING
        self.offer(interfaces.PAUSE_REPLAYER, lambda: self._switch(paused, "paused"))
        self.offer(interfaces.RESUME_REPLAYER, lambda: self._switch(playing, "replaying"))

    def configure(self) -> None:
        """Open the recording and announce its topics, where no rig is up."""
        # Beside a rig it could be taken for what happens.
        check_free(join_names(self.get_namespace(), ("accelerometer", "campaign", "hammer")))
        if not self.get_value("file"):
            raise ParameterError("file is empty: it must be the path of a recording")
        self._recording = recording = RunToReplay(
            Run(Path(self.get_value("file")).expanduser(), self.get_value("rig_namespace") or None)
        )
        for warning in recording.run.warnings:
            self.get_logger().warning(warning)
        self._outputs = {
            name: self.create_publisher(topic.type, name, topic.leased_qos)
            for name, topic in recording.topics.items()
        }
        self._position = 0
        self._set_state(ReplayerState.WAITING, "ready")

    def activate(self) -> None:
        """Start as soon as the subscribers are there."""
        self._passes = self._count = 0
        self._set_state(ReplayerState.WAITING, "waiting for subscribers")
        self._timer = self.create_timer(0.005, self._on_tick)

    def deactivate(self) -> None:
        """Stop publishing."""
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None
        if self._phase != ReplayerState.DONE:
            self._set_state(ReplayerState.DONE, "stopped")

    def cleanup(self) -> None:
        """Withdraw the topics."""
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        self._outputs.clear()
        self._recording = None
        self._set_state(ReplayerState.IDLE, "no recording")

    def report_fault(self, text: str) -> None:
        """Publish the fault in the state, too."""
        super().report_fault(text)
        self._set_state(self._phase, text)

    def diagnose(self) -> dict[str, Any]:
        """Return the fields of `ReplayerState`: how far the replay has come."""
        recording = self._recording
        return {
            "state": self._phase,
            "uri": str(recording.run.path) if recording else "",
            "duration": recording.duration / NANOSECONDS if recording else 0.0,
            "position": self._position / NANOSECONDS,
            "messages": self._count,
            "message": self._message,
        }

    def _on_tick(self) -> None:
        """Publish the messages that are due."""
        now, recording = time.monotonic_ns(), self._recording
        elapsed, self._last_tick = now - self._last_tick, now
        if recording is None:
            return
        try:
            if self._phase == ReplayerState.WAITING and self._is_connected():
                self._set_state(ReplayerState.PLAYING, "replaying")
                self._begin_pass(recording)
            elif self._phase == ReplayerState.PLAYING:
                step = round(elapsed * self.get_value("rate"))
                self._position = min(self._position + step, recording.duration)
                self._publish_due(recording)
        except FileError as error:
            self._finish(str(error))

    def _is_connected(self) -> bool:
        required = split_names(self.get_value("required_subscribers"))
        blocks = self._outputs[interfaces.ACCELERATION.name]
        missing = self.find_missing_subscriber(blocks.topic_name, required)
        return not missing and self.is_connected(blocks)

    def _begin_pass(self, recording: RunToReplay) -> None:
        self._position = 0
        self._messages = recording.read_messages()
        self._next = next(self._messages, None)

    def _publish_due(self, recording: RunToReplay) -> None:
        while self._next is not None and self._next.time <= self._position:
            self._outputs[self._next.topic.name].publish(self._next.data)
            self._count += 1
            self._next = next(self._messages, None)
        # Neither the next pass nor the end comes before all of this one has arrived.
        if self._next is None and self.wait_for_acks(list(self._outputs.values()), 0.0):
            self._passes += 1
            if self._passes == self.get_value("loop"):
                self._finish()
            else:
                self._begin_pass(recording)

    def _finish(self, problem: str | None = None) -> None:
        """End at the end of the recording, or where it is damaged."""
        self._set_state(ReplayerState.DONE, problem or f"done: {self._count} messages")
        if self.get_value("exit_when_done"):
            self.request_stop(FileError(problem) if problem else None)
            return
        self.trigger_deactivate()
        if problem:
            self.report_fault(problem)

    def _switch(self, state: int, message: str) -> Answer:
        if self._phase not in (ReplayerState.PLAYING, ReplayerState.PAUSED):
            return False, f"nothing is being replayed: {self._message}"
        if self._phase != state:
            self._set_state(state, message)
        return True, message

    def _set_state(self, state: int, message: str) -> None:
        if (state, message) != (self._phase, self._message):
            self.get_logger().info(message)
        self._phase, self._message = state, message
        self._publish_state()

    def _publish_state(self) -> None:
        self._publish(**self.diagnose())


def run_replayer(parameters: Mapping[str, Any], namespace: str) -> int:
    """Run the node with parameters, in a namespace; return the exit code."""
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    options = {"namespace": namespace or None, "parameter_overrides": overrides}
    return run_node(lambda: ReplayerNode(**options), argv=[])
