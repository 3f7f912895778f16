"""A client of the campaign action: starts a campaign, follows it, brings back what it found."""

from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import AcquisitionState, HammerRelease, RigSetup, VirtualImpact
from impact_rig_msgs.srv import ConfirmSample
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.core.setup.samples import RigSetup as CoreRigSetup
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaigning.request import (
    CampaignOutcome,
    CampaignRequest,
    Operator,
    results_from_msgs,
)
from impact_rig.nodes.rig_client import RigClient
from impact_rig.recording.interfaces.messages import setup_from_msg

CANCEL_TIMEOUT = 5.0
"""How long a cancelled campaign may take to end [s]."""
RESEND_PERIOD = 3.0
"""How soon an unanswered goal is sent again [s], our choice."""
SERVICE_TIMEOUT = 20.0
"""How long the rig may take to answer what a person has done [s], our choice."""
NEW_ONES = QoSProfile(
    depth=interfaces.RELEASE.qos.depth,
    reliability=interfaces.RELEASE.qos.reliability,
    durability=DurabilityPolicy.VOLATILE,
)
"""Releases of the past are nobody's business here."""
TRUTH_TIMEOUT = 2.0
"""How long the virtual rig's word on rejected hits may take after the campaign [s]."""


class CampaignClient(RigClient):
    """Runs campaigns on a rig that is up; use it in a ``with`` statement.

    Parameters
    ----------
    namespace : str
        Of the rig.
    """

    def __init__(self, namespace: str = "") -> None:
        super().__init__("campaign_client", namespace)
        self._faults: dict[int, tuple[str, ...]] = {}
        self._setup: CoreRigSetup | None = None
        self._acquisition: AcquisitionState | None = None
        self._goal: Any = None
        self._operator: Operator | None = None
        self._feedback = RunCampaign.Feedback()
        self._duties: list[Callable[[], None]] = []
        self.listen(interfaces.VIRTUAL_IMPACT, self._keep_truth)
        self.listen(interfaces.SETUP, self._keep_setup)
        self.listen(interfaces.ACQUISITION_STATE, self._keep_acquisition)
        self.listen(interfaces.RELEASE, self._take_release, NEW_ONES)
        note = interfaces.NOTE
        self._note = self._node.create_publisher(note.type, note.name, note.qos)
        self._action = ActionClient(self._node, RunCampaign, interfaces.RUN_CAMPAIGN)

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._action.destroy()
        super().__exit__()

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

        if not self.spin_until(is_ready, timeout):
            raise DeviceError(
                f"no rig answers in namespace {self._node.get_namespace()!r} within"
                f" {timeout:g} s: start one with `impact-rig up`, and check ROS_DOMAIN_ID and"
                " the namespace on both sides"
            )

    def wait_for_listeners(self, count: int, timeout: float) -> bool:
        """Wait until `count` nodes listen to the accelerometers; return whether they do."""
        return self.spin_until(
            lambda: self._node.count_subscribers(interfaces.ACCELERATION.name) >= count, timeout
        )

    def publish_note(self, text: str, timeout: float) -> None:
        """Say something that belongs into the recording.

        Raises
        ------
        DeviceError
            If no recorder listens within `timeout` seconds.
        """
        if not self.spin_until(lambda: self._note.get_subscription_count() > 0, timeout):
            raise DeviceError(
                "nobody records the notes: start the recorder, or the campaign without them"
            )
        self._note.publish(String(data=text))

    @property
    def is_simulated(self) -> bool:
        """Whether no hammer strikes anything: hits are computed, or come from a file."""
        return self._acquisition is not None and self._acquisition.simulated

    def run(self, request: CampaignRequest, operator: Operator) -> CampaignOutcome:
        """Run a campaign to its end.

        Parameters
        ----------
        request : CampaignRequest
            What to run.
        operator : Operator
            Sees it, and does what is asked of a person.

        Raises
        ------
        DeviceError
            If the rig goes away.
        """
        self._operator = operator
        self._duties.clear()
        goal = RunCampaign.Goal(
            samples=list(request.samples),
            impacts=request.impacts,
            attempts_per_impact=request.attempts_per_impact,
            confirm_samples=request.confirm_samples,
            keep_hits=request.keep_hits,
        )
        self._goal = self._send_goal(goal, lambda message: self._follow(message.feedback))
        result_future = self._goal.get_result_async()
        while not result_future.done():
            if self._duties:
                self._duties.pop(0)()
            elif not self.spin_until(lambda: result_future.done() or bool(self._duties), 1.0):
                self._check_rig()
        answer = result_future.result()
        self._goal = self._operator = None
        return self._conclude(answer.result, answer.status)

    def _follow(self, feedback: Any) -> None:
        """Show a feedback, and note what it asks of a person."""
        self._feedback = feedback
        if self._operator is None:
            return
        self._operator.follow(feedback)
        if feedback.phase == RunCampaign.Feedback.WAITING_FOR_SAMPLE:
            self._duties.append(self._mount)
        elif feedback.phase == RunCampaign.Feedback.WAITING_FOR_HAMMER:
            self._duties.append(self._put_back)

    def _mount(self) -> None:
        sample = self._feedback.sample
        if self._operator is not None:
            self._operator.mount(sample)
            request = ConfirmSample.Request(sample=sample)
            self.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, request, SERVICE_TIMEOUT)

    def _put_back(self) -> None:
        refusal = ""
        while self._operator is not None:
            self._operator.put_back(refusal)
            answer = self.call(
                Trigger, interfaces.CONFIRM_HELD, Trigger.Request(), SERVICE_TIMEOUT
            )
            if answer.success:
                return
            refusal = answer.message

    def _take_release(self, release: HammerRelease) -> None:
        """Tell a person who lets the hammer go by hand that it is time."""
        if self._operator is not None and release.latest_contact > release.swing_time:
            self._operator.let_go(release.sample, release.latest_contact)

    def cancel(self) -> None:
        """Ask a running campaign to stop, and wait until it has, for a bounded time."""
        if self._goal is None:
            return
        result_future = self._goal.get_result_async()
        self._goal.cancel_goal_async()
        # A campaign node that has ended meanwhile answers nobody.
        self.spin_until(
            lambda: result_future.done() or not self._action.server_is_ready(), CANCEL_TIMEOUT
        )
        self._goal = None

    def _conclude(self, result: RunCampaign.Result, status: int) -> CampaignOutcome:
        struck = {hit.record for hit in (*result.accepted, *result.rejected)}
        if self.is_simulated:
            self.spin_until(lambda: struck <= self._faults.keys(), TRUTH_TIMEOUT)
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
            self.spin_until(lambda: any(future.done() for future in pending), RESEND_PERIOD)
        return next(future.result() for future in pending if future.done())

    def _check_rig(self) -> None:
        if not self._action.server_is_ready():
            raise DeviceError("the campaign node has gone: see the rig's log")

    def _keep_truth(self, message: VirtualImpact) -> None:
        self._faults[message.record] = tuple(message.faults)

    def _keep_acquisition(self, message: AcquisitionState) -> None:
        self._acquisition = message

    def _keep_setup(self, message: RigSetup) -> None:
        self._setup = setup_from_msg(message)
