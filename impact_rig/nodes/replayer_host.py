"""A replayer in this process, for a command that shows it, and with it an estimator if wanted."""

from collections.abc import Callable, Mapping
from typing import Any

from impact_rig_msgs.msg import ReplayerState
from impact_rig_msgs.srv import GetResults
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.parameter import Parameter

from impact_rig.core.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.executor import SpinningThread
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.replayer_recording import RecordingToReplay
from impact_rig.results.campaign import Results

LOOK_PERIOD = 0.02
"""How often is looked what sends no event [s]."""
RESULTS_TIMEOUT = 600.0
"""How long the estimates may take [s], our choice: fitting the model to a hundred samples."""


class ReplayHost(RigClient):
    """Holds the nodes of a replay; use it in a ``with`` statement.

    Parameters
    ----------
    parameters : mapping
        Of the replayer.
    namespace : str
        To replay in.
    with_estimator : bool
        Whether a fresh estimator listens, of which this replayer is the only source.
    """

    def __init__(
        self, parameters: Mapping[str, Any], namespace: str = "", *, with_estimator: bool = False
    ) -> None:
        super().__init__("replay_client", namespace)
        options = {"context": self._context, "namespace": namespace or None}
        self._estimator = EstimatorNode(**options) if with_estimator else None
        # What the nodes have to say is said by who uses this class.
        if (estimator := self._estimator) is not None:
            set_logger_level(estimator.get_logger().name, LoggingSeverity.FATAL)
            estimator.autostart()
            # In a thread of its own: nothing else must wait for its arithmetic.
            self._spinning = SpinningThread(estimator, "estimator")
        self._replayer = ReplayerNode(
            (lambda: estimator.messages_handled) if estimator else None,
            parameter_overrides=[Parameter(name, value=item) for name, item in parameters.items()],
            **options,
        )
        set_logger_level(self._replayer.get_logger().name, LoggingSeverity.FATAL)
        self._executor.add_node(self._replayer)
        if self._estimator is not None:
            for topic, keep in (
                (interfaces.VIRTUAL_IMPACT, self.keep_truth),
                (interfaces.SETUP, self.keep_setup),
            ):
                self.listen(topic, keep, topic.qos)

    def __exit__(self, *_: object) -> None:
        """Stop the replay, and leave ROS."""
        self._replayer.close()
        self._executor.remove_node(self._replayer)
        self._replayer.destroy_node()
        if self._estimator is not None:
            self._spinning.stop()
            self._estimator.close()
            self._estimator.destroy_node()
        super().__exit__()

    @property
    def replayer(self) -> ReplayerNode:
        """The node."""
        return self._replayer

    def open(self) -> RecordingToReplay:
        """Open the recording.

        Raises
        ------
        RigError
            If it cannot be replayed.
        """
        self._check(self._replayer.trigger_configure())
        recording = self._replayer.recording
        if recording is None:
            raise RigError(self._replayer.fault)
        return recording

    def choose_part(self, start: float, end: float) -> None:
        """Choose from when to when is replayed next [s]; an end of 0: the recording's."""
        self._replayer.set_parameters(
            [Parameter("start", value=start), Parameter("end", value=end)]
        )

    def play(self, follow: Callable[[], bool]) -> None:
        """Replay to the end.

        Parameters
        ----------
        follow : callable
            Called all the time; returns whether to go on.

        Raises
        ------
        RigError
            If the recording is damaged.
        """
        self._check(self._replayer.trigger_activate())
        while self._replayer.describe_state()["state"] != ReplayerState.DONE:
            self._executor.spin_once(timeout_sec=LOOK_PERIOD)
            if not follow():
                self._replayer.trigger_deactivate()
                return
        if self._replayer.fault:
            raise RigError(self._replayer.fault)

    def fetch_results(self) -> Results:
        """Return what the estimator found since the last set-up.

        Raises
        ------
        RigError
            If the estimator could not use what was replayed, or does not answer.
        """
        if self._estimator is not None and self._estimator.fault:
            raise RigError(self._estimator.fault)
        request = GetResults.Request()
        answer = self.call(GetResults, interfaces.GET_RESULTS, request, RESULTS_TIMEOUT)
        recording = self._replayer.recording
        has_truths = recording is not None and recording.has_truths
        results = self.collect(answer, has_truths=has_truths)
        if results is None:
            raise RigError("the recording has no set-up of the rig: nothing can be estimated")
        return results

    def spin(self, duration: float) -> None:
        """Let the nodes work for a while [s]."""
        self.spin_until(lambda: False, duration)

    def _check(self, result: TransitionCallbackReturn) -> None:
        if result != TransitionCallbackReturn.SUCCESS:
            raise RigError(self._replayer.fault)
