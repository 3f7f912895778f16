"""A client of the campaign action: starts a campaign, follows it, brings back what it found."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import rclpy
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import AcquisitionState, RigSetup, VirtualImpact
from impact_rig_msgs.srv import ConfirmSample, GetResults
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String

from impact_rig.core.errors import DeviceError
from impact_rig.core.setup.samples import RigSetup as CoreRigSetup
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.result_messages import result_from_msg
from impact_rig.recording.interfaces.messages import setup_from_msg
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.setup_results import SetupResults, setup_results_from_setup

LOOK_PERIOD = 0.1
"""How often something that sends no event is looked at [s]."""
CANCEL_TIMEOUT = 5.0
"""How long a cancelled campaign may take to end [s]."""
RESEND_PERIOD = 3.0
"""How soon an unanswered goal is sent again [s], our choice."""
TRUTH_TIMEOUT = 2.0
"""How long the virtual rig's word on rejected hits may take after the campaign [s]."""


@dataclass(frozen=True)
class CampaignRequest:
    """What to run.

    Attributes
    ----------
    samples : sequence of str
        Names, in this order; empty: the whole set.
    impacts : int
        Accepted hits per sample.
    attempts_per_impact : int
        Rejected hits in a row before giving up; 0: the campaign node's default.
    confirm_samples : bool
        Whether a person mounts each sample.
    keep_hits : int
        Of a sample's accepted hits, the most consistent are kept; 0: as the rig file says.
    """

    samples: Sequence[str] = ()
    impacts: int = 10
    attempts_per_impact: int = 0
    confirm_samples: bool = False
    keep_hits: int = 0


@dataclass(frozen=True)
class CampaignOutcome:
    """What came of a campaign.

    Attributes
    ----------
    success : bool
        Whether every sample has its hits.
    message : str
        Why not.
    results : Results
        What was found, up to where it ended.
    setup : RigSetup or None
        The rig; None: it never said.
    recording : str
        Path on the recorder's host; empty: nothing was recorded.
    """

    success: bool
    message: str
    results: Results
    setup: CoreRigSetup | None
    recording: str


class CampaignClient:
    """Talks to a rig that is up, here or on another host; use it in a ``with`` statement.

    Parameters
    ----------
    namespace : str
        Of the rig.
    """

    def __init__(self, namespace: str = "") -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self._node = Node("campaign_client", namespace=namespace or None, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._faults: dict[int, tuple[str, ...]] = {}
        self._setup: CoreRigSetup | None = None
        self._acquisition: AcquisitionState | None = None
        self._goal: Any = None
        self._subscribe(interfaces.VIRTUAL_IMPACT, self._keep_truth)
        self._subscribe(interfaces.SETUP, self._keep_setup)
        self._subscribe(interfaces.ACQUISITION_STATE, self._keep_acquisition)
        note = interfaces.NOTE
        self._note = self._node.create_publisher(note.type, note.name, note.qos)
        self._confirm = self._node.create_client(ConfirmSample, interfaces.CONFIRM_SAMPLE)
        self._action = ActionClient(self._node, RunCampaign, interfaces.RUN_CAMPAIGN)

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._action.destroy()
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def wait_for_rig(self, timeout: float, check: Callable[[], None] = lambda: None) -> None:
        """Wait until campaign node and accelerometers answer.

        Parameters
        ----------
        timeout : float
            [s]
        check : callable
            Called while waiting; may raise, when waiting has become pointless.

        Raises
        ------
        DeviceError
            If the rig does not appear in time.
        """

        def is_ready() -> bool:
            check()
            return self._action.server_is_ready() and self._acquisition is not None

        if not self._spin_until(is_ready, timeout):
            raise DeviceError(
                f"no rig answers in namespace {self._node.get_namespace()!r} within"
                f" {timeout:g} s: start one with `impact-rig up`, and check ROS_DOMAIN_ID and"
                " the namespace on both sides"
            )

    def wait_for_listeners(self, count: int, timeout: float) -> bool:
        """Wait until `count` nodes listen to the accelerometers; return whether they do."""
        return self._spin_until(
            lambda: self._node.count_subscribers(interfaces.ACCELERATION.name) >= count, timeout
        )

    def publish_note(self, text: str, timeout: float) -> None:
        """Say something that belongs into the recording.

        Raises
        ------
        DeviceError
            If no recorder listens within `timeout` seconds.
        """
        if not self._spin_until(lambda: self._note.get_subscription_count() > 0, timeout):
            raise DeviceError(
                "nobody records the notes: start the recorder, or the campaign without them"
            )
        self._note.publish(String(data=text))

    @property
    def is_virtual(self) -> bool:
        """Whether the rig's hits are simulated."""
        state = self._acquisition
        return state is not None and state.source == interfaces.VIRTUAL_SOURCE

    def run(
        self,
        request: CampaignRequest,
        follow: Callable[[RunCampaign.Feedback], None],
        confirm: Callable[[str], None],
    ) -> CampaignOutcome:
        """Run a campaign to its end.

        Parameters
        ----------
        request : CampaignRequest
            What to run.
        follow : callable
            Called with every feedback.
        confirm : callable
            Called with the name of the sample that is to be mounted; returns when it is.

        Raises
        ------
        DeviceError
            If the rig goes away.
        """
        waiting: list[str] = []

        def take_feedback(message: Any) -> None:
            feedback = message.feedback
            follow(feedback)
            if feedback.phase == RunCampaign.Feedback.WAITING_FOR_SAMPLE:
                waiting.append(feedback.sample)

        goal = RunCampaign.Goal(
            samples=list(request.samples),
            impacts=request.impacts,
            attempts_per_impact=request.attempts_per_impact,
            confirm_samples=request.confirm_samples,
            keep_hits=request.keep_hits,
        )
        self._goal = self._send_goal(goal, take_feedback)
        result_future = self._goal.get_result_async()
        while not self._spin_until(lambda: result_future.done() or bool(waiting), 1.0):
            self._check_rig()
        while not result_future.done():
            sample = waiting.pop()
            confirm(sample)
            self._wait(self._confirm.call_async(ConfirmSample.Request(sample=sample)))
            while not self._spin_until(lambda: result_future.done() or bool(waiting), 1.0):
                self._check_rig()
        answer = result_future.result()
        self._goal = None
        return self._conclude(answer.result, answer.status)

    def cancel(self) -> None:
        """Ask a running campaign to stop, and wait until it has, for a bounded time."""
        if self._goal is None:
            return
        result_future = self._goal.get_result_async()
        self._goal.cancel_goal_async()
        self._spin_until(result_future.done, CANCEL_TIMEOUT)
        self._goal = None

    def _conclude(self, result: RunCampaign.Result, status: int) -> CampaignOutcome:
        struck = {hit.record for hit in (*result.accepted, *result.rejected)}
        if self.is_virtual:
            self._spin_until(lambda: struck <= self._faults.keys(), TRUTH_TIMEOUT)
        return CampaignOutcome(
            success=result.success and status == GoalStatus.STATUS_SUCCEEDED,
            message=result.message,
            results=results_from_msgs(result, self._setup, self._faults),
            setup=self._setup,
            recording=result.recording,
        )

    def _send_goal(self, goal: RunCampaign.Goal, take_feedback: Callable[[Any], None]) -> Any:
        """Send the goal until it is answered.

        A server that has not met this client's reader yet drops both answer and goal.
        """
        pending: list[Future] = []
        while not any(future.done() for future in pending):
            self._check_rig()
            pending.append(self._action.send_goal_async(goal, take_feedback))
            self._spin_until(lambda: any(future.done() for future in pending), RESEND_PERIOD)
        return next(future.result() for future in pending if future.done())

    def _check_rig(self) -> None:
        if not self._action.server_is_ready():
            raise DeviceError("the campaign node has gone: see the rig's log")

    def _wait(self, future: Future) -> Any:
        while not self._spin_until(future.done, 1.0):
            self._check_rig()
        return future.result()

    def _spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        deadline = time.monotonic() + timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, LOOK_PERIOD))
        return True

    def _subscribe(self, topic: interfaces.Topic, callback: Callable[[Any], None]) -> None:
        self._node.create_subscription(topic.type, topic.name, callback, topic.qos)

    def _keep_truth(self, message: VirtualImpact) -> None:
        self._faults[message.record] = tuple(message.faults)

    def _keep_acquisition(self, message: AcquisitionState) -> None:
        self._acquisition = message

    def _keep_setup(self, message: RigSetup) -> None:
        self._setup = setup_from_msg(message)


def results_from_msgs(
    result: RunCampaign.Result | GetResults.Response,
    setup: CoreRigSetup | None,
    faults_by_record: dict[int, tuple[str, ...]],
) -> Results:
    """Return what came back over ROS as the results that leave the rig.

    Parameters
    ----------
    result : RunCampaign.Result or GetResults.Response
        What was found.
    setup : RigSetup or None
        That it was found with; None: not heard of.
    faults_by_record : dict of int to tuple of str
        Injected faults, as far as they are known.
    """
    hits = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.record)
    return Results(
        setup=SetupResults() if setup is None else setup_results_from_setup(setup),
        hammer=result_from_msg(HammerResults, result.hammer),
        samples=tuple(result_from_msg(SampleResults, each) for each in result.samples),
        hits=tuple(
            messages.hit_results_from_msg(hit, faults_by_record.get(hit.record, ()))
            for hit in hits
        ),
    )
