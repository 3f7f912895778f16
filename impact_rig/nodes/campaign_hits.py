"""One hit of a campaign after the other: what it waits for, how it is struck, its verdict."""

import math
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import AcquisitionState, HammerState, Impact
from impact_rig_msgs.srv import Arm, GetResults, Release, SetAngle
from rclpy.action.server import ServerGoalHandle
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.rig_state import ACCELEROMETER, ESTIMATOR, HAMMER, RECORDER, RigState
from impact_rig.recordings.messages import stamp_from_msg

ENABLE_PERIOD = 1.0
"""How soon a refused enable is asked for again [s], our choice."""
STATE_TIMEOUT = 4.0
"""How long a node's state may take to come after its answer to a request [s], our choice: the two
travel apart, and what was lost on its way comes again with the next heartbeat, 3 s later at the
latest."""


class CancelledError(RigError):
    """The client asked the campaign to stop."""


@dataclass
class CampaignProgress:
    """Where a running campaign stands.

    Attributes
    ----------
    handle : ServerGoalHandle
        What the client asked for.
    setup : RigSetup
        Of this campaign.
    samples : tuple of str
        Names, in their order.
    impacts : int
        Accepted hits wanted of each sample.
    attempts : int
        Rejected hits in a row before giving up.
    started : float
        By the monotonic clock [s].
    accepted : int
        Hits of all samples so far.
    angle : float
        Release angle that the holder sets before each hit [rad]; NaN: it is not asked to.
    feedback : RunCampaign.Feedback
        What the client heard last.
    known : set of tuple
        Sample and impact of accepted hits that a campaign node before this one had struck.
    tried : Counter of tuple
        Attempts at the others that it had made, by the same.
    """

    handle: ServerGoalHandle
    setup: RigSetup
    samples: tuple[str, ...]
    impacts: int
    attempts: int
    started: float = field(default_factory=time.monotonic)
    accepted: int = 0
    angle: float = math.nan
    feedback: RunCampaign.Feedback = field(default_factory=RunCampaign.Feedback)
    known: set[tuple[str, int]] = field(default_factory=set)
    tried: Counter[tuple[str, int]] = field(default_factory=Counter)

    def take_up(self, results: GetResults.Response) -> None:
        """Go on from what the estimator knows.

        The next impact is struck when one is accepted: whatever became of a hit later on, of its
        impact there was an accepted one, unless it is the last.
        """
        hits = sorted((*results.accepted, *results.rejected), key=lambda hit: hit.record)
        for hit in hits:
            place = (hit.sample, hit.impact)
            if hit.accepted or place != (hits[-1].sample, hits[-1].impact):
                self.known.add(place)
            else:
                self.tried[place] += 1
        self.accepted = len(self.known)
        self.feedback.rejected = len(hits) - len(self.known)

    def publish(self, **fields: Any) -> None:
        """Publish the feedback with some fields changed and the time left estimated anew."""
        for name, value in fields.items():
            setattr(self.feedback, name, value)
        elapsed = time.monotonic() - self.started
        missing = len(self.samples) * self.impacts - self.accepted
        self.feedback.time_left = elapsed / self.accepted * missing if self.accepted else math.nan
        self.handle.publish_feedback(self.feedback)

    def delay(self, pause: float) -> None:
        """Leave a pause [s] out of the speed that the time left is estimated by."""
        self.started += pause

    @property
    def judged(self) -> int:
        """Hits that have a verdict [-]."""
        return self.accepted + int(self.feedback.rejected)

    @property
    def is_cancelled(self) -> bool:
        """Whether the client has asked the campaign to stop."""
        return bool(self.handle.is_cancel_requested)

    def check_cancel(self) -> None:
        """Raise `CancelledError` if the client asked for it."""
        if self.is_cancelled:
            raise CancelledError("cancelled by the operator")


@dataclass(frozen=True)
class Obstacle:
    """Why the next hit cannot begin now.

    Attributes
    ----------
    phase : int
        What the campaign does meanwhile: PAUSED or WAITING_FOR_HAMMER of
        `RunCampaign.Feedback`, or RUNNING while nothing is wrong.
    message : str
        In words, with what would end it.
    can_enable : bool
        Whether all that is missing is the enable, and not a person who took it.
    """

    phase: int
    message: str
    can_enable: bool = False


def find_obstacle(rig: RigState) -> Obstacle | None:
    """Return why the next hit cannot begin now, what is worst first; None: it can."""
    if loss := describe_loss(rig):
        return Obstacle(RunCampaign.Feedback.PAUSED, loss)
    hammer = rig[HAMMER]
    if hammer.state is None:
        return None
    return _find_hammer_obstacle(rig, hammer.state)


def describe_loss(rig: RigState) -> str:
    """Return what a hit needs and is lost; empty: nothing."""
    return rig.describe_loss(HAMMER) or _describe_lost_listener(rig)


def describe_broken_way(rig: RigState) -> str:
    """Return what is lost of that through which a verdict comes; empty: nothing."""
    if rig[ACCELEROMETER].state is None:
        return "the accelerometers say nothing"
    return _describe_lost_listener(rig)


def _describe_lost_listener(rig: RigState) -> str:
    return (
        rig.describe_loss(ACCELEROMETER, ESTIMATOR)
        # One that has ended its recording, and itself, is missed by nobody.
        or ("" if rig[RECORDER].has_left and not rig.recording else rig.describe_loss(RECORDER))
        or rig.describe_inactivity(ACCELEROMETER, ESTIMATOR)
    )


def is_acquisition_lost(rig: RigState) -> bool:
    """Whether the accelerometers say nothing more of what they were armed for."""
    return rig[ACCELEROMETER].state is None or bool(rig.describe_loss(ACCELEROMETER))


def has_gone(rig: RigState) -> bool:
    """Whether the node of hammer or accelerometers, once heard, is not there any more."""
    return rig[HAMMER].is_gone or rig[ACCELEROMETER].is_gone


def is_lost_since(rig: RigState, losses: int) -> bool:
    """Whether something is lost, or was since `losses` were counted."""
    return rig.losses != losses or bool(describe_loss(rig))


def _find_hammer_obstacle(rig: RigState, hammer: HammerState) -> Obstacle | None:
    feedback, is_active = RunCampaign.Feedback, not rig[HAMMER].describe_inactivity()
    activate = "" if is_active else "activate the hammer node, then "
    if hammer.disarmed_by == HammerState.EMERGENCY_STOP and not hammer.armed:
        why = f"emergency stop: to go on, {activate}call hammer/reset and then hammer/arm"
    elif not is_active:
        why = f"the hammer node is not active: to go on, {activate}call hammer/arm"
    elif hammer.state == HammerState.AWAY:
        why = "put the hammer back into its holder, then call hammer/confirm_held"
        return Obstacle(feedback.WAITING_FOR_HAMMER, why)
    elif hammer.state == HammerState.SWINGING:
        return Obstacle(feedback.RUNNING, "the hammer is on its way back")
    elif hammer.armed:
        return None
    elif not rig.is_disarmed_by_person:
        why = f"the hammer was disarmed because something was lost ({hammer.message})"
        return Obstacle(feedback.PAUSED, why, can_enable=True)
    else:
        why = f"the hammer is not armed ({hammer.message}): to go on, call hammer/arm"
    return Obstacle(feedback.PAUSED, why)


class Readiness:
    """Waits until the next hit can begin, and says what it waits for.

    Parameters
    ----------
    node : RigNode
        The campaign's; its parameter `pause_timeout` is read.
    rig : RigState
        What it hears of the rig.
    """

    def __init__(self, node: RigNode, rig: RigState) -> None:
        self._node = node
        self._rig = rig
        self._enable = node.create_client(Trigger, interfaces.ARM_HAMMER)
        self._disable = node.create_client(Trigger, interfaces.DISARM_HAMMER)

    async def enable(self) -> str:
        """Give the operator's enable to the hammer; return why that failed, empty: it is armed."""
        try:
            answer = await self._node.call(
                self._enable, Trigger.Request(), is_given_up=lambda: has_gone(self._rig)
            )
        except DeviceError as error:
            return str(error)
        if not answer.success:
            return str(answer.message)
        await self._node.wait_until(self._is_armed, STATE_TIMEOUT)
        return ""

    async def disable(self) -> None:
        """Take the enable back, if the hammer is there."""
        if not self._disable.service_is_ready():
            return
        try:
            await self._node.call(self._disable, Trigger.Request())
        except DeviceError as error:
            self._node.get_logger().error(str(error))

    async def wait(self, progress: CampaignProgress, recording: str) -> None:
        """Wait until the next hit can begin.

        What was lost and came back is enabled again: the operator's goal still stands. What a
        person has stopped or disarmed, a person enables.

        Parameters
        ----------
        progress : CampaignProgress
            Of the campaign; hears of every pause.
        recording : str
            What the hits go into, on the recorder's host; empty: nowhere.

        Raises
        ------
        CancelledError
            If the client asked for it.
        DeviceError
            If the recording has ended, or a pause takes longer than `pause_timeout`.
        """
        began = time.monotonic()
        while obstacle := self._find_obstacle(progress, recording):
            refusal = await self.enable() if obstacle.can_enable else ""
            if obstacle.can_enable and not refusal:
                if progress.feedback.phase == RunCampaign.Feedback.RUNNING:
                    self._tell(progress, obstacle)
                continue
            self._tell(progress, replace(obstacle, message=refusal or obstacle.message))
            time_left = self._compute_time_left(began, obstacle)
            if time_left <= 0.0:
                raise DeviceError(
                    f"the pause took longer than {self._node.get_value('pause_timeout'):g} s:"
                    f" {progress.feedback.message}"
                )
            await self._wait_for_change(
                obstacle,
                progress,
                recording,
                min(ENABLE_PERIOD, time_left) if obstacle.can_enable else time_left,
            )
        if progress.feedback.phase != RunCampaign.Feedback.RUNNING:
            self._node.get_logger().info("the campaign goes on")
            progress.delay(time.monotonic() - began)
            progress.publish(phase=RunCampaign.Feedback.RUNNING, message="")

    def _find_obstacle(self, progress: CampaignProgress, recording: str) -> Obstacle | None:
        """Return what the next hit waits for; raise what ends the campaign."""
        progress.check_cancel()
        if end := self._rig.describe_end_of_recording(recording):
            raise DeviceError(end)
        return find_obstacle(self._rig)

    async def _wait_for_change(
        self, obstacle: Obstacle, progress: CampaignProgress, recording: str, timeout: float
    ) -> None:
        await self._node.wait_until(
            lambda: (
                find_obstacle(self._rig) != obstacle
                or progress.is_cancelled
                or bool(self._rig.describe_end_of_recording(recording))
            ),
            timeout,
        )

    def _tell(self, progress: CampaignProgress, obstacle: Obstacle) -> None:
        """Let client and log hear of an obstacle, unless they have or nothing is wrong."""
        feedback: Any = progress.feedback
        if obstacle.phase == RunCampaign.Feedback.RUNNING:
            return
        if (feedback.phase, feedback.message) == (obstacle.phase, obstacle.message):
            return
        self._node.get_logger().warning(f"the campaign pauses: {obstacle.message}")
        progress.publish(phase=obstacle.phase, message=obstacle.message)

    def _compute_time_left(self, began: float, obstacle: Obstacle) -> float:
        """Return how long an obstacle may still last [s]."""
        limit = float(self._node.get_value("pause_timeout"))
        if not limit or obstacle.phase != RunCampaign.Feedback.PAUSED:
            return math.inf
        return began + limit - time.monotonic()

    def _is_armed(self) -> bool:
        return self._rig[HAMMER].state is not None and self._rig[HAMMER].state.armed


NOT_YET_TIMEOUT = 14.0
"""How long accelerometers or hammer may answer "not yet" [s], our choice: nodes that have just
started take a while to find each other, and a state that was lost on its way comes again 3 s later
at the latest."""
NOT_YET_PERIOD = 0.02
"""How soon they are asked again [s], our choice: a state takes a few milliseconds."""


class InterruptedHitError(DeviceError):
    """Something that the hit needs was lost: it is no hit, and the campaign goes on later."""


class Striker:
    """Strikes the mounted sample, one hit at a time.

    Parameters
    ----------
    node : RigNode
        The campaign's; its parameter `verdict_timeout` is read.
    rig : RigState
        What it hears of the rig.

    Attributes
    ----------
    recording : str
        Where the hits are recorded, as the last release said; empty: nowhere, or none yet.
    """

    def __init__(self, node: RigNode, rig: RigState) -> None:
        self.recording = ""
        self._node = node
        self._rig = rig
        self._verdicts: dict[int, Impact] = {}
        self._newest = 0
        self._unjudged: set[int] = set()
        self._setup_stamp: Any = None
        self._is_armed_in_vain = False
        self._was_interrupted = False
        self._was_unanswered = False
        self._arm = node.create_client(Arm, interfaces.ARM_ACCELEROMETER)
        self._disarm = node.create_client(Trigger, interfaces.DISARM_ACCELEROMETER)
        self._set_angle = node.create_client(SetAngle, interfaces.SET_ANGLE)
        self._release = node.create_client(Release, interfaces.RELEASE_HAMMER)
        self._results = node.create_client(GetResults, interfaces.GET_RESULTS)

    def begin(self, setup_stamp: Any) -> None:
        """Forget the campaign before; from now on verdicts under this set-up count."""
        self.recording = ""
        self._setup_stamp = setup_stamp
        self._was_unanswered = False
        for memory in (self._verdicts, self._unjudged):
            memory.clear()

    def is_verdict_due(self, judged: int) -> bool:
        """Whether a record after the one that was judged last may still get its verdict."""
        armed, hammer = self._rig[ACCELEROMETER].state, self._rig[HAMMER].state
        if armed is None or hammer is None:
            return True
        is_over = armed.state == AcquisitionState.ARMED and hammer.state != HammerState.SWINGING
        return armed.record > judged and not is_over

    def take_up(self, judged: int, setup_stamp: Any) -> None:
        """Go on after a campaign node that has died; a verdict that comes yet counts."""
        self.begin(setup_stamp)
        state = self._rig[ACCELEROMETER].state
        self._newest = max(self._newest, judged, state.record if state else 0)
        self._unjudged.update(range(judged + 1, self._newest + 1))
        self._was_interrupted = True

    async def strike(self, progress: CampaignProgress, label: HitLabel) -> Impact:
        """Strike once, unless the verdict on an interrupted hit has come; return the verdict.

        Parameters
        ----------
        progress : CampaignProgress
            Of the campaign, which may be cancelled meanwhile.
        label : HitLabel
            Which hit; its record is chosen here.

        Raises
        ------
        InterruptedHitError
            If something was lost, and no verdict will come, or if none came though nothing is
            lost, and this for the first time in a row; the accelerometers are disarmed, so that
            no later release falls into this record.
        CancelledError
            If the client asked for it.
        DeviceError
            If it failed though nothing is lost.
        """
        if self._was_interrupted:
            self._was_interrupted = False
            await self._ask_for_verdicts()
        if verdict := self._take_late_verdict(label.sample):
            return verdict
        losses = self._rig.losses
        if self._is_armed_in_vain:
            await self.disarm()
        try:
            return await self._strike(progress, label, losses)
        except InterruptedHitError:
            self._was_interrupted = True
            progress.check_cancel()
            await self.disarm()
            if verdict := self._take_late_verdict(label.sample):
                return verdict
            raise

    async def _ask_for_verdicts(self) -> None:
        """Hear from the estimator what did not get through, or was found in the recording."""
        results, deadline = GetResults.Response(), time.monotonic() + STATE_TIMEOUT
        while not stamp_from_msg(results.setup_stamp) and time.monotonic() < deadline:
            try:
                results = await self._node.call(
                    self._results,
                    GetResults.Request(),
                    is_given_up=lambda: self._rig[ESTIMATOR].is_gone,
                )
            except DeviceError:
                return
            await self._node.pause(NOT_YET_PERIOD)
        for hit in (*results.accepted, *results.rejected):
            self.keep_verdict(hit)

    async def disarm(self) -> None:
        """Disarm the accelerometers, if they are there; else before they are armed again."""
        self._is_armed_in_vain = True
        if not self._disarm.service_is_ready() or is_acquisition_lost(self._rig):
            return
        try:
            await self._node.call(
                self._disarm, Trigger.Request(), is_given_up=lambda: is_acquisition_lost(self._rig)
            )
            self._is_armed_in_vain = False
        except DeviceError as error:
            self._node.get_logger().error(str(error))

    def _take_late_verdict(self, sample: str) -> Impact | None:
        """Return the verdict on an interrupted hit of a sample that has come after all, once.

        It counts like any other, else its hit would be in the results beside the one that is
        struck in its place. One on a sample that is no longer mounted comes too late for that.
        """
        for record in sorted(self._unjudged & self._verdicts.keys()):
            verdict = self._take_verdict(record)
            if verdict.sample == sample:
                return verdict
        return None

    def _take_verdict(self, record: int) -> Impact:
        """Return the verdict on a record, and forget the record: long campaigns have many."""
        self._was_unanswered = False
        self._unjudged.remove(record)
        return self._verdicts.pop(record)

    async def _strike(self, progress: CampaignProgress, label: HitLabel, losses: int) -> Impact:
        hit = {"sample": label.sample, "impact": label.impact, "attempt": label.attempt}
        if math.isfinite(progress.angle):
            angle = SetAngle.Request(angle=progress.angle)
            failure = "the release angle is not set"
            await self._ask(progress, self._set_angle, angle, losses, failure)
        arming = Arm.Request(**hit, after=self._newest)
        failure = "the accelerometers cannot be armed"
        record = (await self._ask(progress, self._arm, arming, losses, failure)).record
        self._newest = record
        self._rig.forget_stored(record)
        self._unjudged.add(record)
        released = await self._ask(
            progress,
            self._release,
            Release.Request(record=record, **hit),
            losses,
            "the hammer was not released",
        )
        self.recording = released.recording
        await self._await_verdict(progress, record, released.latest_contact, losses)
        return self._take_verdict(record)

    async def _ask(
        self, progress: CampaignProgress, client: Any, request: Any, losses: int, failure: str
    ) -> Any:
        """Return the answer of another node, if it is a good one; ask again at "not yet"."""
        deadline = time.monotonic() + NOT_YET_TIMEOUT
        try:
            while True:
                answer = await self._node.call(
                    client,
                    request,
                    is_given_up=lambda: progress.is_cancelled or has_gone(self._rig),
                )
                if answer.success:
                    return answer
                is_final = not answer.message.startswith(interfaces.NOT_YET)
                if is_final or time.monotonic() > deadline or is_lost_since(self._rig, losses):
                    break
                await self._node.pause(NOT_YET_PERIOD)
            reason = answer.message
        except DeviceError as error:
            reason = str(error)
        progress.check_cancel()

        def is_interrupted() -> bool:
            # Of an enable that was given and taken at once only the end may have been heard.
            return is_lost_since(self._rig, losses) or find_obstacle(self._rig) is not None

        await self._node.wait_until(
            lambda: is_interrupted() or progress.is_cancelled, STATE_TIMEOUT
        )
        progress.check_cancel()
        if is_interrupted():
            raise InterruptedHitError(f"{failure}: {reason}")
        raise DeviceError(f"{failure}: {reason}")

    async def _await_verdict(
        self, progress: CampaignProgress, record: int, latest_contact: float, losses: int
    ) -> None:
        timeout = float(self._node.get_value("verdict_timeout"))
        longest_swing = latest_contact if math.isfinite(latest_contact) else 0.0

        def is_decided() -> bool:
            is_lost = self._rig.is_lost(record, self.recording)
            return record in self._verdicts or progress.is_cancelled or is_lost

        def is_over() -> bool:
            return is_decided() or bool(describe_broken_way(self._rig))

        is_late = not await self._node.wait_until(is_over, timeout + longest_swing)
        if is_late and self.recording and not self._rig.is_stored(record):
            # A disk may stand still for minutes: the record is not lost, only late.
            message = f"the recorder has not stored record {record} yet: see to its disk"
            self._node.get_logger().warning(f"the campaign pauses: {message}")
            progress.publish(phase=RunCampaign.Feedback.PAUSED, message=message)
            await self._node.wait_until(
                lambda: is_over() or self._rig.is_stored(record),
                float(self._node.get_value("pause_timeout")) or math.inf,
            )
            if self._rig.is_stored(record):
                await self._node.wait_until(is_over, timeout)
        if loss := describe_broken_way(self._rig):
            # Told at once; but the verdict may still be on its way, or come when they are back.
            # A node that was deactivated has forgotten what it was at.
            progress.publish(phase=RunCampaign.Feedback.PAUSED, message=loss)
            is_inactive = loss == self._rig.describe_inactivity(ACCELEROMETER, ESTIMATOR)
            await self._node.wait_until(is_decided, STATE_TIMEOUT if is_inactive else timeout)
        if record not in self._verdicts and not self._rig.is_lost(record, self.recording):
            await self._ask_for_verdicts()
        if record in self._verdicts:
            return
        progress.check_cancel()
        cause = self._explain_silence(record, timeout)
        is_lost = self._rig.is_lost(record, self.recording) or is_lost_since(self._rig, losses)
        is_stored = not self.recording or self._rig.is_stored(record)
        may_strike_again = is_lost or (is_stored and not self._was_unanswered)
        self._was_unanswered = self._was_unanswered or not is_lost
        if may_strike_again and not self._rig.describe_end_of_recording(self.recording):
            raise InterruptedHitError(cause)
        raise DeviceError(cause)

    def _explain_silence(self, record: int, timeout: float) -> str:
        """Return why there is no verdict on a record, as far as it can be known here."""
        if self._rig.is_lost(record, self.recording):
            end = self._rig.describe_end_of_recording(self.recording)
            return end or f"the recorder was lost before it had stored record {record}"
        cause = f"no verdict on record {record} came within {timeout:g} s"
        if self.recording and not self._rig.is_stored(record):
            cause += f": the recorder has not said that record {record} is stored"
        return cause

    def keep_verdict(self, message: Impact) -> None:
        """Take a verdict of the estimator."""
        if message.record in self._unjudged and message.setup_stamp == self._setup_stamp:
            self._verdicts[message.record] = message
