"""The replayer: publishes a recording again, byte by byte, in its own namespace."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from impact_rig_msgs.msg import Impact, ReplayerState
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import Trigger

from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes import interfaces
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.process import run_node
from impact_rig.nodes.replayer_playback import CountedWindow, Pace, Playback, Window
from impact_rig.nodes.replayer_recording import RecordingToReplay, open_recording
from impact_rig.nodes.rig_node import Read, RigNode

SELECTIONS = ("inputs", "all")
"""Which topics may be asked for."""


def declare_parameters(node: RigNode) -> None:
    """Declare them all, with their defaults."""
    node.declare(
        "file", "",
        "path of the recording: an .mcap file, a folder as rosbag2 writes it, or a run's",
    )  # fmt: skip
    node.declare(
        "rate", 1.0,
        "speed, part of the original's [-]; 0: as fast as the subscribers take it; may be"
        " changed at any time",
        low=0.0, high=1000.0, read=Read.AT_USE,
    )  # fmt: skip
    node.declare(
        "topics", "inputs",
        "inputs: set-up, blocks, releases and virtual impacts, for a fresh estimator; all:"
        " everything that was recorded",
        choices=SELECTIONS,
    )  # fmt: skip
    node.declare("samples", [""], "replay only the hits of these samples, and `hits`")
    node.declare(
        "hits", [""],
        "replay only these hits, and those of `samples`: by record number, SAMPLE/IMPACT or"
        " SAMPLE/IMPACT.ATTEMPT",
    )  # fmt: skip
    node.declare(
        "start", 0.0, "from here, since the recording's start [s]; what is latched before it"
        " comes first", low=0.0, high=1e9, read=Read.AT_ACTIVATE,
    )  # fmt: skip
    node.declare(
        "end", 0.0, "up to here, since the recording's start [s]; 0: to its end",
        low=0.0, high=1e9, read=Read.AT_ACTIVATE,
    )  # fmt: skip
    node.declare(
        "loop", 1, "how often [-]; 0: without end",
        low=0, high=1_000_000, read=Read.AT_ACTIVATE,
    )  # fmt: skip
    node.declare("start_paused", False, "wait to be resumed, or for steps", read=Read.AT_ACTIVATE)
    node.declare(
        "publish_clock", 0.0,
        "how often /clock is published [Hz], beside once with each message, for nodes that"
        " use simulated time; 0: not at all",
        low=0.0, high=10_000.0,
    )  # fmt: skip
    node.declare(
        "required_subscribers", "estimator",
        "nodes of this namespace, by commas, that must be connected before the start",
        read=Read.AT_USE,
    )  # fmt: skip
    node.declare("recorded_namespace", "", "of the rig in the recording; empty: found there")
    node.declare(
        "exit_when_done", False, "end the process at the end of the recording",
        read=Read.AT_USE,
    )  # fmt: skip


CONNECTION_PERIOD = 0.05
"""How often it is looked whether the subscribers are connected [s], our choice."""
NODES_OF_A_RIG = ("accelerometer", "campaign", "hammer")
"""Beside which nothing is replayed: it could be taken for what happens."""
STATE_PERIOD = 1.0
"""How often the state is published while it does not change but in its numbers [s]."""


class ReplayerNode(RigNode):
    """Replays while it is active; becomes inactive, or ends its process, when it is done.

    Parameters
    ----------
    count_taken : callable, optional
        Returns how many set-ups and blocks the estimator has taken, if it is in this process and
        nobody else's; else its verdicts tell.
    """

    def __init__(self, count_taken: Callable[[], int] | None = None, **options: Any) -> None:
        super().__init__("replayer", **options)
        self._count_taken = count_taken
        declare_parameters(self)
        self._recording: RecordingToReplay | None = None
        self._outputs: dict[str, Any] = {}
        self._pace = Pace(0.0)
        self._playback: Playback | None = None
        self._watch: Any = None
        self._verdicts: Any = None
        self._clock_output: Any = None
        self._phase = ReplayerState.IDLE
        self._message = "no recording"
        self._numbers: dict[str, Any] = {"position": 0.0, "messages": 0, "record": 0}
        self._publish = self.advertise_state(interfaces.REPLAYER_STATE)
        self.create_timer(STATE_PERIOD, self._publish_state)
        self.add_post_set_parameters_callback(self._take_parameters)
        for name, answer in (
            (interfaces.PAUSE_REPLAYER, self._pause),
            (interfaces.RESUME_REPLAYER, self._resume),
            (interfaces.STEP_REPLAYER, self._step),
        ):
            self.create_service(Trigger, name, answer)

    @property
    def recording(self) -> RecordingToReplay | None:
        """What is open."""
        return self._recording

    @property
    def is_paused(self) -> bool:
        """Whether it stands still until it is resumed or makes a step."""
        return bool(self._phase == ReplayerState.PAUSED)

    def configure(self) -> None:
        """Open the recording and announce its topics, where no rig is up."""
        check_free(join_names(self.get_namespace(), NODES_OF_A_RIG))
        self._recording = recording = self._open()
        for warning in recording.warnings:
            self.get_logger().warning(warning)
        for topic in recording.topics.values():
            if topic.name not in self._outputs:
                self._outputs[topic.name] = self.create_publisher(
                    topic.type, topic.name, topic.qos
                )
        if self.get_value("publish_clock"):
            self._clock_output = self.advertise(interfaces.CLOCK)
        self._set_state(ReplayerState.WAITING, "ready")

    def _open(self) -> RecordingToReplay:
        if not self.get_value("file"):
            raise ParameterError("file is empty: it must be the path of a recording")
        return open_recording(
            Path(self.get_value("file")).expanduser(),
            namespace=self.get_value("recorded_namespace"),
            is_everything=self.get_value("topics") == "all",
            samples=[name for name in self.get_value("samples") if name],
            hits=[name for name in self.get_value("hits") if name],
        )

    def activate(self) -> None:
        """Start as soon as the subscribers are there."""
        recording = self._recording
        if recording is None:
            raise FileError("no recording is open: configure the node first")
        self._pace = Pace(
            float(self.get_value("rate")), is_paused=bool(self.get_value("start_paused"))
        )
        clock_rate = float(self.get_value("publish_clock"))
        self._playback = playback = Playback(
            recording.make_plan(float(self.get_value("start")), float(self.get_value("end"))),
            {number: self._outputs[topic.name] for number, topic in recording.topics.items()},
            self._pace,
            int(self.get_value("loop")),
            self._make_window,
            self._publish_clock,
            1.0 / clock_rate if clock_rate else STATE_PERIOD,
            lambda: self.run_soon(self._follow),
        )
        # Volatile: what was judged before this replay does not count.
        self._verdicts = self.create_subscription(
            Impact,
            interfaces.IMPACT.name,
            lambda message: playback.window.note_verdict(message.record),
            QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE),
        )
        self._set_state(ReplayerState.WAITING, "waiting for subscribers")
        self._watch = self.create_timer(CONNECTION_PERIOD, self._start_if_ready)

    def _make_window(self, wait_for_delivery: Callable[[], None]) -> Window | CountedWindow:
        pace = self._pace
        if self._count_taken is not None:
            return CountedWindow(self._count_taken, lambda: pace.is_stopped)
        verdicts = self.resolve_topic_name(interfaces.IMPACT.name)
        is_judged = interfaces.IMPACT.name not in self._outputs
        return Window(
            lambda: is_judged and self.count_publishers(verdicts) > 0,
            wait_for_delivery,
            lambda: pace.is_stopped,
        )

    def deactivate(self) -> None:
        """Stop publishing."""
        self._stop_watching()
        if self._playback is not None:
            self._playback.stop()
            if self._phase != ReplayerState.DONE:
                self._set_state(ReplayerState.DONE, "stopped")
            self._playback = None
        if self._verdicts is not None:
            self.destroy_subscription(self._verdicts)
            self._verdicts = None

    def cleanup(self) -> None:
        """Withdraw the topics."""
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        self._outputs.clear()
        if self._clock_output is not None:
            self.destroy_publisher(self._clock_output)
            self._clock_output = None
        self._recording = None
        self._set_state(ReplayerState.IDLE, "no recording")

    def autostart(self) -> None:
        """Start; a process that is to end with its recording ends at once if there is none."""
        super().autostart()
        if self.get_value("exit_when_done") and self.fault:
            raise FileError(self.fault)

    def report_fault(self, text: str) -> None:
        """Say in the state, too, what is wrong."""
        super().report_fault(text)
        self._set_state(self._phase, text)

    def diagnose(self) -> dict[str, Any]:
        """Return how far the replay has come."""
        state = self.describe_state()
        return {
            "file": state["uri"],
            "progress": state["message"],
            "messages": state["messages"],
            "recorded time [s]": f"{state['position']:.3f}",
        }

    def _start_if_ready(self) -> None:
        """Begin once the blocks have their subscribers."""
        playback, recording = self._playback, self._recording
        if playback is None or recording is None or self._watch is None:
            return
        required = self.get_value("required_subscribers")
        gates = recording.block_names or tuple(self._outputs)
        if any(self.describe_missing_subscribers(self._outputs[name], required) for name in gates):
            return
        self._stop_watching()
        self._show_playing()
        playback.start()

    def _stop_watching(self) -> None:
        if self._watch is not None:
            self.destroy_timer(self._watch)
            self._watch = None

    def _pause(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._get_playback(response) is not None:
            self._pace.pause()
            self._show_playing()
        return response

    def _resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._get_playback(response) is not None:
            self._pace.resume()
            self._show_playing()
        return response

    def _step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Begin a step; when it is done, the state is PAUSED again, or DONE at the end."""
        if self._get_playback(response) is not None:
            self.step()
            response.message = "the next record is being replayed"
        return response

    def step(self) -> None:
        """Replay up to and including the end of the next record."""
        self._pace.step()
        self._show_playing()

    def _get_playback(self, response: Trigger.Response) -> Playback | None:
        """Return what is being replayed; if that is nothing, say so in the response."""
        response.success = self._playback is not None
        if not response.success:
            response.message = "nothing is being replayed: activate the node first"
        return self._playback

    def _take_parameters(self, parameters: list[Parameter]) -> None:
        """Change the speed of what is being replayed."""
        for parameter in parameters:
            if parameter.name == "rate":
                self._pace.set_rate(float(parameter.value))

    def _follow(self) -> None:
        """Take in what the playback's thread has done, in the executor's thread."""
        playback = self._playback
        if playback is None:
            return
        if not playback.is_finished:
            self._show_playing()
        elif not self._pace.is_stopped:
            self._finish(playback)

    def _finish(self, playback: Playback) -> None:
        self._set_state(
            ReplayerState.DONE, playback.problem or f"done: {playback.published} messages"
        )
        if self.get_value("exit_when_done"):
            self.request_stop(FileError(playback.problem) if playback.problem else None)
            return
        self.trigger_deactivate()
        if playback.problem:
            self.report_fault(playback.problem)

    def _show_playing(self) -> None:
        if self._watch is not None:
            return
        if self._pace.is_paused:
            self._set_state(ReplayerState.PAUSED, "paused")
        else:
            self._set_state(ReplayerState.PLAYING, "replaying")

    def _set_state(self, state: int, message: str) -> None:
        if (state, message) != (self._phase, self._message):
            self.get_logger().info(message)
        self._phase, self._message = state, message
        self._publish_state()

    def _publish_state(self) -> None:
        self._publish(**self.describe_state())

    def describe_state(self) -> dict[str, Any]:
        """Return the fields of `ReplayerState`: how far the replay has come."""
        recording, playback = self._recording, self._playback
        if playback is not None and recording is not None:
            position = playback.position or recording.first_time
            self._numbers = {
                "position": recording.compute_position(position),
                "messages": playback.published,
                "record": playback.record,
            }
        return {
            "state": self._phase,
            "uri": str(recording.source.path) if recording else "",
            "duration": recording.duration if recording else 0.0,
            "message": self._message,
            **self._numbers,
        }

    def _publish_clock(self, moment: int) -> None:
        if self._clock_output is not None:
            self._clock_output.publish(ClockMessage(clock=stamp_to_msg(moment)))


def main() -> int:
    """Run the node."""
    return run_node(ReplayerNode)
