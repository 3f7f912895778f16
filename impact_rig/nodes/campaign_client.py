"""Runs campaigns on a rig that is up, for a program that is not one of its nodes."""

import contextlib
import math
import time
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import HammerRelease
from impact_rig_msgs.srv import Act, ConfirmSample, SetArmed
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy
from rclpy.task import Future
from std_msgs.msg import String

from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import describe_caller, fill_act
from impact_rig.nodes.client import START_ONE, RigClient
from impact_rig.nodes.identity import Identity, id_from_msg, id_to_msg, make_id
from impact_rig.nodes.intake import UNSOUND, Received
from impact_rig.nodes.result_messages import hit_results_from_msg, results_from_msg
from impact_rig.results.campaign import Results
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import CampaignStatus, HammerStatus, RecorderStatus, Step, Task

CampaignGoal: TypeAlias = RunCampaign.Goal
"""Goal of a campaign."""
CANCEL_TIMEOUT = 5.0
"""How long a cancelled campaign may take to end [s]."""
RESEND_PERIOD = 3.0
"""How soon an unanswered goal is sent again [s]."""
GONE_TIMEOUT = 6.0
"""How long after the end of its lease the campaign node is waited for [s]. A node that only stood
still has its campaign yet: who resumes that goes on with it."""
HAMMER_TIMEOUT = 2.0
"""How long the hammer of a rig that is up may take to say its state [s]."""
SERVICE_TIMEOUT = 20.0
"""How long the rig may take to answer what a person has done [s]."""


@dataclass(frozen=True)
class CampaignOutcome:
    """The end of a campaign."""

    success: bool  # every sample has its hits
    message: str  # why not
    results: Results  # up to the end
    recording: str  # path on the recorder's host; empty: nothing was recorded


class Operator(Protocol):
    """The person or program that follows a campaign and does the manual work."""

    def follow(self, rig: RigStatus) -> None:
        """Take the campaign's newest state, with the hits since this client began it."""

    def mount(self, sample: str, further: str) -> None:
        """Mount a sample and follow the further instruction; return when it is done."""

    def put_back(self, refusal: str) -> None:
        """Put the hammer back into its holder; return when it is there.

        `refusal`: why it did not count as held after the last time; empty: this is the first.
        """

    def let_go(self, sample: str, patience: float) -> None:
        """Release the hammer by hand, within so many seconds."""

    def hold_back(self, reason: str) -> None:
        """Do not release the hammer, though it was asked for: it has been disarmed."""


@dataclass
class _Attendance:
    """A running campaign, as this client follows it; there is none before and after.

    What comes of it by topics and feedback is only noted here; what the operator has to do for it
    is done by `run` alone, one duty after the other::

        the campaign says             then
        a new task for a person       it is one of the `duties`
        paused                        `paused_since` begins, and lasts until it has gone on
        striking, hammer by hand      `is_to_let_go`, until it swings or is disarmed
    """

    operator: Operator
    longest_pause: float  # [s]; of a campaign that nobody attends
    paused_since: float = math.inf  # by the monotonic clock [s]
    duties: list[Task] = field(default_factory=list)  # in the order in which they came
    is_to_let_go: bool = False  # the operator is asked to release the hammer


class CampaignClient(RigClient):
    """Runs campaigns on a rig that is up; use it in a ``with`` statement.

    It calls `check` while it waits, which may raise when waiting has become pointless.
    """

    def __init__(self, namespace: str = "", check: Callable[[], None] = lambda: None) -> None:
        super().__init__("campaign_client", namespace)
        self._check = check
        self._sent: list[Future] = []  # the goal of the running campaign, each time it was sent
        self._result = Future()
        self._gone_since = math.inf  # the campaign node gives no sign of life since then
        self._attended: _Attendance | None = None
        # Only a hammer that says it is disarmed holds an operator back.
        self._status = RigStatus(hammer=HammerStatus(armed=True))
        self._do: Mapping[Task, Callable[[_Attendance], None]] = {
            Task.MOUNT: self._mount,
            Task.PUT_BACK: self._put_back,
            Task.ARM: self._arm,
        }
        self._beat = CampaignStatus()  # the newest state by the topic, which comes twice a second
        self.listen(interfaces.CAMPAIGN_STATE, self._on_beat, on_liveliness=self._on_liveliness)
        for topic in (
            interfaces.RECORDER_STATE, interfaces.ACQUISITION_STATE, interfaces.HAMMER_STATE,
        ):  # fmt: skip
            self.listen(topic, self._on_state)
        new_ones = copy(interfaces.RELEASE.qos)
        new_ones.durability = DurabilityPolicy.VOLATILE
        self.listen(replace(interfaces.RELEASE, qos=new_ones), self._on_release)
        self._note = self.advertise(interfaces.NOTE)
        self._action = ActionClient(self._node, RunCampaign, interfaces.RUN_CAMPAIGN)

    def leave(self) -> None:
        """Close the client of the action, too."""
        self._action.destroy()
        super().leave()

    def spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Take messages as every client does; `check` may end that."""

        def is_true() -> bool:
            self._check()
            return condition()

        return super().spin_until(is_true, timeout)

    def wait_for_rig(self, timeout: float) -> None:
        """Wait so many seconds until campaign node and accelerometers answer.

        Raises
        ------
        DeviceError
            If the rig does not appear in time.
        """

        def is_ready() -> bool:
            return self._action.server_is_ready() and self._status.acquisition is not None

        if not self.spin_until(is_ready, timeout):
            raise DeviceError(
                f"no rig answers in namespace {self._node.get_namespace()!r} within"
                f" {timeout:g} s: {START_ONE}"
            )
        self.spin_until(lambda: bool(self._status.hammer.stamp), HAMMER_TIMEOUT)

    def wait_for_listeners(self, count: int, timeout: float) -> bool:
        """Wait until `count` nodes listen to the accelerometers; return whether they do."""
        return self.spin_until(
            lambda: self._node.count_subscribers(interfaces.ACCELERATION.name) >= count, timeout
        )

    def publish_note(self, text: str, timeout: float) -> None:
        """Publish a remark for the recording.

        Raises
        ------
        DeviceError
            If no recorder listens within `timeout` seconds.
        """
        if not self.spin_until(lambda: self._note.get_subscription_count() > 0, timeout):
            raise DeviceError(
                "no recorder listens to the notes: start it, or the campaign without notes"
            )
        self._note.publish(String(data=text))

    @property
    def is_simulated(self) -> bool:
        """Whether no hammer strikes: hits are computed, and the holder swings nothing."""
        return self._status.is_simulated

    def run(
        self, goal: CampaignGoal, operator: Operator, longest_pause: float = math.inf
    ) -> CampaignOutcome:
        """Run a campaign to its end; the operator follows it and does the manual work.

        Parameters
        ----------
        longest_pause : float
            After so long a pause [s] the campaign is cancelled, since it is unattended. Where no
            hammer strikes anything, such a campaign arms again once what was missing is back.

        Raises
        ------
        DeviceError
            If the rig goes away.
        RigError
            If the campaign cannot be run as the goal asks for.
        """
        resumed = id_from_msg(goal.resumed.campaign_id)
        campaign_id = resumed if goal.resumed.plan.impacts else make_id()
        goal.campaign_id, goal.by = id_to_msg(campaign_id), describe_caller()
        # From now on only the messages of this campaign count.
        self._intake.membership.join(Identity(campaign_id))
        self._status.begin(None)
        self._status.recorder = RecorderStatus()
        self._attended = _Attendance(operator, longest_pause)
        self._sent.clear()
        self._result = self._send_goal(goal).get_result_async()
        pause = self._attend(self._attended)
        answer = self._result.result()
        self._sent.clear()
        self._attended = None
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise DeviceError(
                "the campaign node was started again, and does not know the campaign"
            )
        result = answer.result
        if pause is not None and not result.success:
            result.message = f"no person ended this pause: {pause}"
        if not result.setup.samples:
            raise RigError(f"the campaign is rejected: {result.message}")
        if not result.success and not (result.accepted or result.rejected):
            raise DeviceError(result.message)  # it has no hit, or could not collect them
        return CampaignOutcome(
            success=result.success and answer.status == GoalStatus.STATUS_SUCCEEDED,
            message=result.message,
            results=results_from_msg(result, {it.record: it.faults for it in result.truths}),
            recording=result.recording,
        )

    def _attend(self, attended: _Attendance) -> str | None:
        """Do what the campaign asks for until it ends; return for which pause it was cancelled."""
        pause, silent, duties = None, tuple[str, ...](), attended.duties
        while not self._result.done():
            self._check_life()
            if pause is None and time.monotonic() - attended.paused_since > attended.longest_pause:
                pause = self._status.campaign.message
                self._goal.cancel_goal_async()
            if duties:
                self._do[duties.pop(0)](attended)
            elif not self.spin_until(lambda: self._result.done() or bool(duties), 1.0):
                self._check_rig()
            if (found := self._status.list_silent()) != silent:
                silent = found
                attended.operator.follow(self._status)
        return pause

    def _send_goal(self, goal: CampaignGoal) -> Any:
        """Send the goal until it is answered.

        A server that has not met this client's reader yet drops both answer and goal.
        """
        while self._goal is None:
            self._check_life()
            self._check_rig()
            self._sent.append(self._action.send_goal_async(goal, self._on_feedback))
            self.spin_until(lambda: self._goal is not None, RESEND_PERIOD)
        return self._goal

    @property
    def _goal(self) -> Any:
        """The campaign node's answer to the goal; None: it has not answered."""
        return next((future.result() for future in self._sent if future.done()), None)

    def _check_life(self) -> None:
        silence = time.monotonic() - self._gone_since
        if silence > GONE_TIMEOUT:
            raise DeviceError(
                "the campaign node has given no sign of life for"
                f" {interfaces.LEASE + silence:.0f} s: see the rig's log"
            )

    def _check_rig(self) -> None:
        rest = self._node.count_publishers(interfaces.ACQUISITION_STATE.name)
        if not self._action.server_is_ready() and not rest:
            raise DeviceError("the campaign node has gone: see the rig's log")

    def cancel(self) -> None:
        """Ask a running campaign to stop, and wait until it has, for a bounded time."""
        if self._sent and self.spin_until(lambda: self._goal is not None, CANCEL_TIMEOUT):
            self._goal.cancel_goal_async()
            result = self._goal.get_result_async()
            # A campaign node that has ended meanwhile does not answer.
            self.spin_until(
                lambda: result.done() or not self._action.server_is_ready(), CANCEL_TIMEOUT
            )
        self._sent.clear()

    def end_others(self, timeout: float) -> None:
        """End the campaign of another client, if one runs, within so many seconds.

        Raises
        ------
        DeviceError
            If the campaign node does not answer.
        """
        name = f"{interfaces.RUN_CAMPAIGN}/_action"
        stopped = self.call(CancelGoal, f"{name}/cancel_goal", CancelGoal.Request(), timeout)
        for goal in stopped.goals_canceling:
            kind = RunCampaign.Impl.GetResultService
            self.call(kind, f"{name}/get_result", kind.Request(goal_id=goal.goal_id), timeout)

    def _on_liveliness(self, status: Any) -> None:
        """Show that the campaign node gives no sign of life."""
        self._gone_since = math.inf if status.alive_count else time.monotonic()
        if self._attended is None or self._goal is None:
            return
        if status.alive_count:
            # A node that was started again answers that it does not know the goal.
            self._result = self._goal.get_result_async()
            return
        self._status.campaign = replace(
            self._status.campaign,
            state=Step.PAUSED,
            message="the campaign node gives no sign of life",
        )
        self._attended.operator.follow(self._status)

    def _on_feedback(self, message: Any) -> None:
        """Show a feedback; manual work that it asks for is queued for `run`."""
        campaign = interfaces.CAMPAIGN_STATE.convert(message.feedback.campaign)
        before, self._status.campaign = self._status.campaign, campaign
        if (last := message.feedback.campaign.last).record:
            # A verdict with a number that cannot be meant has no line: results refuse it, too.
            with contextlib.suppress(*UNSOUND):
                self._status.add_hit(hit_results_from_msg(last))
        if (attended := self._attended) is None:
            return
        if campaign.state is Step.PAUSED:
            attended.paused_since = min(attended.paused_since, time.monotonic())
        elif not campaign.is_looking:
            attended.paused_since = math.inf
        attended.operator.follow(self._status)
        if campaign.state is not Step.STRIKING:
            attended.is_to_let_go = False
        is_new = (campaign.task, campaign.sample) != (before.task, before.sample)
        if is_new and campaign.task in self._do:
            attended.duties.append(campaign.task)

    def _arm(self, attended: _Attendance) -> None:
        """Go on for a person who is not there, where no hammer can strike one who is."""
        is_unattended = attended.longest_pause < math.inf
        # What a person has stopped or disarmed, the hammer refuses to arm by this service.
        if is_unattended and self._status.is_simulated and not self._status.hammer.needs_person:
            request = SetArmed.Request(
                campaign_id=id_to_msg(self._intake.membership.identity.campaign_id), armed=True
            )
            with contextlib.suppress(DeviceError):
                answer = self.call(SetArmed, interfaces.SET_ARMED, request, SERVICE_TIMEOUT)
                if not answer.success:
                    self.spin_until(lambda: False, RESEND_PERIOD)
                    attended.duties += [Task.ARM] * (self._status.campaign.task is Task.ARM)

    def _mount(self, attended: _Attendance) -> None:
        campaign = self._status.campaign
        attended.operator.mount(campaign.sample, campaign.message)
        # One that is not needed any more is refused; the campaign asks for another.
        self._say_done(
            ConfirmSample,
            interfaces.CONFIRM_SAMPLE,
            ConfirmSample.Request(sample=campaign.sample),
            campaign.number,
            lambda: self._beat,
        )

    def _put_back(self, attended: _Attendance) -> None:
        refusal, is_held = "", False
        while not is_held:
            # The task may come before the state of the hammer that it is about.
            self.spin_until(lambda: not self._status.hammer.armed, SERVICE_TIMEOUT)
            number = self._status.hammer.number
            attended.operator.put_back(refusal)
            answer = self._say_done(
                Act,
                interfaces.CONFIRM_HELD,
                Act.Request(),
                number,
                lambda: self._status.hammer,
            )
            refusal, is_held = answer.message, answer.success

    def _say_done(
        self,
        kind: Any,
        name: str,
        request: Any,
        seen: int,
        find_state: Callable[[], CampaignStatus | HammerStatus],
    ) -> Any:
        """Say now that what a person saw in the state of a number is done; return the answer."""
        before = find_state().stamp
        self.spin_until(lambda: find_state().stamp > before, SERVICE_TIMEOUT)
        fill_act(request, replace(find_state(), number=seen), describe_caller())
        return self.call(kind, name, request, SERVICE_TIMEOUT)

    def _on_beat(self, received: Received[CampaignStatus]) -> None:
        self._beat = received.value

    def _on_release(self, received: Received[HammerRelease]) -> None:
        """Ask the operator to release the hammer, if it is released by hand."""
        release, attended = received.value, self._attended
        if attended is not None and release.latest_contact > release.swing_time:
            attended.operator.let_go(release.sample, release.latest_contact)
            attended.is_to_let_go = True
            self._hold_back()

    def _on_state(self, received: Received[Any]) -> None:
        self._status.keep(received.value)
        self._hold_back()

    def _hold_back(self) -> None:
        """Withdraw the request to release the hammer, if that was disarmed meanwhile."""
        hammer, attended = self._status.hammer, self._attended
        if attended is not None and attended.is_to_let_go and not hammer.armed:
            attended.is_to_let_go = False
            attended.operator.hold_back(hammer.message)

    @property
    def run_folder(self) -> Path | None:
        """Where the rig records, on the recorder's host; None: nowhere, or it is not known."""
        path = self._status.recorder.uri
        return Path(path).parent if path else None

    def check_run(self, folder: Path) -> None:
        """Require that the rig records into a run's folder, as far as that can be seen from here.

        Raises
        ------
        DeviceError
            If it records elsewhere.
        """
        self.spin_until(lambda: bool(self._status.recorder.uri), 5.0)
        recording = Path(self._status.recorder.uri)
        if recording.exists() and recording.parent != folder.resolve():
            raise DeviceError(
                f"the rig records into {recording.parent}: start it with"
                f" `impact-rig up --resume {folder}`"
            )
