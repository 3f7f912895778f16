"""The campaign: a loop over the ledger of the estimator, as an explicit state machine."""

import math
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignPlan, HammerState, Impact, SampleCount
from impact_rig_msgs.msg import RigSetup as RigSetupMessage
from impact_rig_msgs.srv import Arm, ConfirmSample, GetResults, JoinCampaign, Release, SetAngle
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from std_srvs.srv import Trigger

from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.core.setup import PAPER_SETUP, RigSetup, format_angle
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.identity import Identity, id_from_msg, id_to_msg, make_id
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.messages import setup_from_msg

LOOK_PERIOD = 0.5
"""How soon it is looked again whether a pause is over [s]."""
NOT_YET_TIMEOUT = 10.0
"""How long accelerometers or hammer may answer "not yet" [s], our choice: nodes that have just
started take a while to find each other."""
NOT_YET_PERIOD = 0.02
"""How soon they are asked again [s], our choice: a state takes a few milliseconds."""
ANSWER_TIMEOUT = 5.0
"""How long a node may take to answer [s]; only the estimator may have much to read first."""
RESULTS_TIMEOUT = 600.0
"""How long the estimator may take to read a run, or to fit the model to a hundred samples [s]."""


class State(IntEnum):
    """What a campaign does, numbered as in the feedback of the action `RunCampaign`."""

    JOINING = 0
    COUNTING = 1
    WAITING_FOR_SAMPLE = 2
    PAUSED = 3
    WAITING_FOR_HAMMER = 4
    STRIKING = 5
    DISARMING = 6
    COMPLETE = 7


TRANSITIONS: Mapping[State, tuple[State, ...]] = {
    State.JOINING: (State.COUNTING, State.PAUSED),
    State.COUNTING: (
        State.STRIKING,
        State.WAITING_FOR_SAMPLE,
        State.WAITING_FOR_HAMMER,
        State.PAUSED,
        State.DISARMING,
        State.COMPLETE,
    ),
    State.WAITING_FOR_SAMPLE: (State.COUNTING,),
    State.PAUSED: (State.JOINING,),
    State.WAITING_FOR_HAMMER: (State.COUNTING,),
    State.STRIKING: (State.COUNTING, State.DISARMING),
    State.DISARMING: (State.JOINING,),
    State.COMPLETE: (),
}
"""From which state a campaign goes where. A fault, whatever it is, leads to DISARMING and back to
the top; an end with a reason is possible in every state."""


class EndError(RigError):
    """The campaign ends here, with a reason."""


@dataclass
class Campaign:
    """A campaign that is under way, with what it says of itself.

    Attributes
    ----------
    handle : ServerGoalHandle
        What the client asked for.
    setup : RigSetup
        As the rig file and the goal say.
    message : impact_rig_msgs.msg.RigSetup
        The same, with id and plan: whoever has it can go on with the campaign.
    """

    handle: ServerGoalHandle
    setup: RigSetup
    message: RigSetupMessage
    feedback: RunCampaign.Feedback = field(default_factory=RunCampaign.Feedback)
    stream_id: bytes = bytes(16)
    recording: str = ""
    has_armed: bool = False
    mounted: str = ""
    hit: dict[str, Any] = field(default_factory=dict)
    newest_record: int = 0
    verdict: Impact = field(default_factory=Impact)
    excused: dict[str, int] = field(default_factory=dict)  # refusals that count for nothing
    unanswered: int = 0  # releases in a row without a verdict [-]
    stands_since: float = math.inf  # no hit since [s], by the monotonic clock
    started: float = field(default_factory=time.monotonic)
    before: int = -1  # accepted hits when it began here

    @property
    def samples(self) -> tuple[str, ...]:
        """Names, in the order in which they are struck."""
        return tuple(self.message.plan.samples)

    @property
    def impacts(self) -> int:
        """Accepted hits wanted of each sample."""
        return int(self.message.plan.impacts)

    def publish(self, **fields: Any) -> None:
        """Publish the feedback with some fields changed."""
        for name, value in fields.items():
            setattr(self.feedback, name, value)
        self.handle.publish_feedback(self.feedback)

    def estimate_time_left(self, accepted: int) -> float:
        """Return how long the rest takes at the speed so far [s]; NaN: not known."""
        self.before = accepted if self.before < 0 else self.before
        struck, missing = accepted - self.before, len(self.samples) * self.impacts - accepted
        return (time.monotonic() - self.started) / struck * missing if struck else math.nan


class CampaignNode(RigNode):
    """An action server that runs campaigns on the rig's other nodes."""

    def __init__(self, **options: Any) -> None:
        super().__init__("campaign", **options)
        self.declare("rig_file", "", "path of the rig file; empty: the paper's rig and samples")
        self.declare(
            "attempts_per_impact", 10,
            "hits of a sample in a row that may be rejected, or get no verdict [-]",
            low=1, high=1000, live=True,
        )  # fmt: skip
        self.declare(
            "verdict_timeout", 5.0, "longest time from the latest contact to the verdict [s]",
            low=0.1, high=3600.0, live=True,
        )  # fmt: skip
        self.declare(
            "pause_timeout", 0.0, "how long a campaign may stand still [s]; 0: for ever",
            low=0.0, high=1e6, live=True,
        )  # fmt: skip
        self.declare("require_recorder", True, "count hits only when they are recorded", live=True)
        self._setup_of_rig: RigSetup = PAPER_SETUP
        self._angles: tuple[float, ...] = ()
        self._campaign: Campaign | None = None
        self._confirmed = ""
        self._hammer: HammerState | None = None
        self._setup = self.advertise(interfaces.SETUP)
        self.listen(interfaces.HAMMER_STATE, self._on_hammer_state)
        self.listen(interfaces.IMPACT, self._on_impact)
        self.create_service(ConfirmSample, interfaces.CONFIRM_SAMPLE, self._confirm)
        names = ("recorder", "accelerometer", "estimator", "hammer", "visualizer")
        self._joins = {
            name: self.create_client(JoinCampaign, interfaces.make_join_name(name))
            for name in names
        }
        self._results = self.create_client(GetResults, interfaces.GET_RESULTS)
        self._arm_hammer = self.create_client(Trigger, interfaces.ARM_HAMMER)
        self._disarm_hammer = self.create_client(Trigger, interfaces.DISARM_HAMMER)
        self._set_angle = self.create_client(SetAngle, interfaces.SET_ANGLE)
        self._arm = self.create_client(Arm, interfaces.ARM_ACCELEROMETER)
        self._disarm = self.create_client(Trigger, interfaces.DISARM_ACCELEROMETER)
        self._release = self.create_client(Release, interfaces.RELEASE_HAMMER)
        self._work: Mapping[State, Callable[[Campaign], Awaitable[State]]] = {
            State.JOINING: self._ask_to_join,
            State.COUNTING: self._count,
            State.WAITING_FOR_SAMPLE: self._wait_for_sample,
            State.PAUSED: self._pause,
            State.WAITING_FOR_HAMMER: self._wait_for_hammer,
            State.STRIKING: self._strike,
            State.DISARMING: self._disarm_accelerometers,
        }
        self._server = ActionServer(
            self,
            RunCampaign,
            interfaces.RUN_CAMPAIGN,
            execute_callback=self._execute,
            goal_callback=lambda _: GoalResponse.ACCEPT,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def configure(self) -> None:
        """Read the rig file."""
        rig = load_rig_file(self.get_value("rig_file"))
        self._setup_of_rig, self._angles = rig.setup, rig.release_angles

    def activate(self) -> None:
        """Publish the set-up, so that the rig's other nodes know what it is."""
        self._setup.publish(messages.setup_to_msg(self._setup_of_rig, Time()))

    def diagnose(self) -> dict[str, Any]:
        """Return where the campaign stands."""
        if self._campaign is None:
            return {"campaign": "none"}
        feedback = self._campaign.feedback
        return {
            "campaign": f"{feedback.sample}, {feedback.impact} hits",
            "state": State(feedback.state).name,
            "rejected": feedback.rejected,
        }

    # The states.

    async def _run(self, campaign: Campaign) -> None:
        state = State.JOINING
        while state is not State.COMPLETE:
            campaign.publish(state=int(state))
            self._check_end(campaign)
            try:
                following = await self._work[state](campaign)
            except DeviceError as error:
                self._check_end(campaign)
                self.get_logger().warning(str(error))
                campaign.feedback.message = str(error)
                following = State.PAUSED if state is State.JOINING else State.DISARMING
            if following not in TRANSITIONS[state]:
                raise RuntimeError(f"no way leads from {state.name} to {following.name}")
            state = following
        campaign.publish(state=int(state))

    def _check_end(self, campaign: Campaign) -> None:
        """Raise `EndError` if the client, this node's end or a long pause ends the campaign."""
        if campaign.handle.is_cancel_requested:
            raise EndError("cancelled by the operator")
        if self.stop_requested.done():
            raise EndError("the campaign node has been stopped")
        limit = float(self.get_value("pause_timeout"))
        if limit and time.monotonic() - campaign.stands_since > limit:
            reason = campaign.feedback.message
            raise EndError(f"the pause took longer than {limit:g} s: {reason}")

    async def _ask_to_join(self, campaign: Campaign) -> State:
        """Ask every node to take part, and whether it is ready; then arm the hammer, once."""
        if self.get_value("require_recorder"):
            campaign.recording = (await self._join_node(campaign, "recorder")).recording
        answer = await self._join_node(campaign, "accelerometer")
        campaign.stream_id = id_from_msg(answer.stream_id)
        self.membership.join(Identity(id_from_msg(campaign.message.campaign_id)))
        await self._join_node(campaign, "estimator")
        if self._joins["visualizer"].service_is_ready():
            await self._join_node(campaign, "visualizer")
        await self._join_node(campaign, "hammer")
        self._setup.publish(campaign.message)
        if not campaign.has_armed:
            answer = await self.call(self._arm_hammer, Trigger.Request(), ANSWER_TIMEOUT)
            hammer = self._hammer
            is_stopped = hammer and hammer.disarmed_by == HammerState.EMERGENCY_STOP
            # After an emergency stop a person arms, even if this is the start.
            campaign.has_armed = answer.success or bool(is_stopped)
            if not answer.success:
                raise DeviceError(f"the hammer cannot be armed: {answer.message}")
            await self.wait_until(
                lambda: bool(self._hammer and self._hammer.armed), ANSWER_TIMEOUT
            )
        return State.COUNTING

    async def _join_node(self, campaign: Campaign, name: str) -> JoinCampaign.Response:
        request = JoinCampaign.Request(
            setup=campaign.message,
            stream_id=id_to_msg(campaign.stream_id),
            recording=campaign.recording,
        )
        timeout = RESULTS_TIMEOUT if name == "estimator" else ANSWER_TIMEOUT
        answer = await self.call(
            self._joins[name],
            request,
            timeout,
            lambda: (
                campaign.handle.is_cancel_requested or not self._joins[name].service_is_ready()
            ),
        )
        if not answer.success:
            raise DeviceError(answer.message)
        return answer

    async def _count(self, campaign: Campaign) -> State:
        """Ask the ledger what is missing, and whether the hammer can strike it."""
        request = GetResults.Request(counts_only=True)
        ledger = await self.call(self._results, request, ANSWER_TIMEOUT)
        if ledger.setup.campaign_id != campaign.message.campaign_id:
            raise DeviceError("the estimator was started again")
        if ledger.waiting_record:
            campaign.feedback.message = (
                f"the recorder has not stored record {ledger.waiting_record} yet: see to its disk"
            )
            return State.PAUSED
        campaign.newest_record = max(campaign.newest_record, ledger.newest_record)
        counts = {count.sample: count for count in ledger.counts}
        accepted = {
            name: min(counts[name].accepted if name in counts else 0, campaign.impacts)
            for name in campaign.samples
        }
        total = sum(accepted.values())
        missing = [name for name in campaign.samples if accepted[name] < campaign.impacts]
        sample = missing[0] if missing else campaign.samples[-1]
        campaign.publish(
            sample=sample,
            sample_number=campaign.samples.index(sample) + 1,
            sample_count=len(campaign.samples),
            impact=accepted[sample],
            impacts=campaign.impacts,
            rejected=sum(count.rejected for count in ledger.counts),
            time_left=campaign.estimate_time_left(total),
        )
        if not missing:
            return State.COMPLETE
        count = counts.get(sample, SampleCount())
        refused = self._count_refusals(campaign, sample, count)
        campaign.hit = {"sample": sample, "impact": count.accepted + 1, "attempt": refused + 1}
        if campaign.mounted != sample and self._is_person_needed(campaign, sample):
            return State.WAITING_FOR_SAMPLE
        campaign.mounted = sample
        return await self._look_at_hammer(campaign)

    def _count_refusals(self, campaign: Campaign, sample: str, count: SampleCount) -> int:
        """Return how many hits in a row a sample has refused; raise `EndError` if too many."""
        in_a_row = int(count.rejected_in_a_row)
        excused = min(campaign.excused.get(sample, in_a_row), in_a_row)
        campaign.excused[sample] = excused
        refused = in_a_row - excused
        limit = campaign.message.plan.attempts_per_impact or self.get_value("attempts_per_impact")
        if refused >= limit:
            reasons = "; ".join(campaign.verdict.reasons)
            raise EndError(
                f"{sample}: {refused} hits in a row were rejected, the last for {reasons}"
            )
        if campaign.unanswered >= limit:
            raise EndError(f"{sample}: {limit} hits in a row got no verdict")
        return refused

    async def _look_at_hammer(self, campaign: Campaign) -> State:
        def is_swinging() -> bool:
            return self._hammer is not None and self._hammer.state == HammerState.SWINGING

        await self.wait_until(lambda: not is_swinging() or self._is_over(campaign), math.inf)
        hammer = self._hammer
        if hammer is None:
            raise DeviceError("the hammer node says nothing")
        if hammer.armed and hammer.state == HammerState.AWAY:
            campaign.feedback.message = (
                "put the hammer back into its holder, then call hammer/confirm_held"
            )
            return State.WAITING_FOR_HAMMER
        if not hammer.armed:
            is_stop = hammer.disarmed_by == HammerState.EMERGENCY_STOP
            calls = "hammer/reset and then hammer/arm" if is_stop else "hammer/arm"
            why = f"the hammer is not armed ({hammer.message}): to go on, call {calls}"
            campaign.feedback.message = why
            return State.PAUSED
        return State.STRIKING

    async def _pause(self, campaign: Campaign) -> State:
        """Wait a little, or until the hammer says something else."""
        campaign.stands_since = min(campaign.stands_since, time.monotonic())
        hammer = self._hammer
        await self.wait_until(
            lambda: self._hammer is not hammer or self._is_over(campaign), LOOK_PERIOD
        )
        return State.JOINING

    async def _wait_for_hammer(self, campaign: Campaign) -> State:
        """Wait until a person has put the hammer back."""
        await self.wait_until(
            lambda: (
                self._hammer is None
                or self._hammer.state != HammerState.AWAY
                or not self._hammer.armed
                or self._is_over(campaign)
            ),
            math.inf,
        )
        campaign.feedback.message = ""
        return State.COUNTING

    async def _wait_for_sample(self, campaign: Campaign) -> State:
        """Wait until a person has mounted the sample, and set what the holder cannot."""
        sample = campaign.setup.samples.find(campaign.feedback.sample)
        is_set = self._sets_angle
        wanted = "" if is_set or not sample.has_angle else format_angle(sample.release_angle)
        self._confirmed = ""
        text = wanted and f"set the release angle of the hammer to {wanted}"
        campaign.publish(message=text)
        await self.wait_until(
            lambda: self._confirmed == sample.name or self._is_over(campaign), math.inf
        )
        campaign.mounted, campaign.feedback.message = sample.name, ""
        return State.COUNTING

    async def _strike(self, campaign: Campaign) -> State:
        """Strike once, and wait for the verdict; whatever goes wrong is a fault."""
        ids = {"campaign_id": campaign.message.campaign_id}
        sample = campaign.setup.samples.find(campaign.hit["sample"])
        if sample.has_angle and self._sets_angle:
            await self._ask(
                campaign, self._set_angle, SetAngle.Request(angle=sample.release_angle)
            )
        arming = Arm.Request(**ids, **campaign.hit, after=campaign.newest_record)
        record = (await self._ask(campaign, self._arm, arming)).record
        campaign.newest_record = record
        release = Release.Request(
            **ids, stream_id=id_to_msg(campaign.stream_id), record=record, **campaign.hit
        )
        released = await self._ask(campaign, self._release, release)
        campaign.unanswered += 1
        timeout = float(self.get_value("verdict_timeout"))
        swing = released.latest_contact if math.isfinite(released.latest_contact) else 0.0
        await self.wait_until(
            lambda: campaign.verdict.record == record or self._is_over(campaign), timeout + swing
        )
        if campaign.verdict.record != record:
            raise DeviceError(f"no verdict on record {record} came within {timeout:g} s")
        campaign.unanswered, campaign.stands_since = 0, math.inf
        campaign.publish(last=campaign.verdict, message="")
        return State.COUNTING

    async def _disarm_accelerometers(self, campaign: Campaign) -> State:
        """Disarm, so that no later release falls into this record; back to the top."""
        campaign.stands_since = min(campaign.stands_since, time.monotonic())
        # What a fault has spoiled says nothing against the sample.
        campaign.excused.clear()
        await self._try_call(self._disarm, Trigger.Request(), ANSWER_TIMEOUT)
        return State.JOINING

    # What the states need.

    async def _ask(self, campaign: Campaign, client: Any, request: Any) -> Any:
        """Return the good answer of a node; ask again at "not yet"."""
        deadline = time.monotonic() + NOT_YET_TIMEOUT
        while True:
            answer = await self.call(
                client, request, ANSWER_TIMEOUT, lambda: self._is_over(campaign)
            )
            if answer.success:
                return answer
            is_final = not answer.message.startswith(interfaces.NOT_YET)
            if is_final or time.monotonic() > deadline or self._is_over(campaign):
                raise DeviceError(answer.message.removeprefix(interfaces.NOT_YET))
            await self.pause(NOT_YET_PERIOD)

    async def _try_call(self, client: Any, request: Any, timeout: float) -> Any:
        """Return the answer of a node; None: it gives none."""
        if not client.service_is_ready():
            return None
        try:
            return await self.call(client, request, timeout)
        except DeviceError as error:
            self.get_logger().error(str(error))
            return None

    def _is_over(self, campaign: Campaign) -> bool:
        return bool(campaign.handle.is_cancel_requested) or self.stop_requested.done()

    @property
    def _sets_angle(self) -> bool:
        return self._hammer is not None and bool(self._hammer.sets_angle)

    def _is_person_needed(self, campaign: Campaign, sample: str) -> bool:
        """Return whether a person has to mount a sample, or to set the hammer's angle."""
        find = campaign.setup.samples.find
        wanted, is_set = find(sample), self._sets_angle
        if not campaign.message.plan.confirm_samples:
            if wanted.has_angle and not is_set:
                holder = self._hammer.holder if self._hammer else "none"
                raise EndError(
                    f"the holder ({holder}) cannot set a release angle, and nobody is asked to:"
                    " let the campaign confirm the samples (--ask)"
                )
            return False
        is_there = campaign.mounted and find(campaign.mounted).body == wanted.body
        return not (wanted.has_angle and is_set and is_there)

    def _on_hammer_state(self, message: HammerState) -> None:
        self._hammer = message

    def _on_impact(self, message: Impact) -> None:
        if self._campaign is not None:
            self._campaign.verdict = message

    def _confirm(
        self, request: ConfirmSample.Request, response: ConfirmSample.Response
    ) -> ConfirmSample.Response:
        feedback = self._campaign.feedback if self._campaign else None
        if feedback is None or feedback.state != State.WAITING_FOR_SAMPLE:
            response.message = "no campaign is waiting for a sample"
        elif request.sample != feedback.sample:
            response.message = (
                f"the campaign is waiting for {feedback.sample!r}, not {request.sample!r}"
            )
        else:
            self._confirmed = request.sample
            response.success, response.message = True, f"{request.sample} is mounted"
        self.wake_waiters()
        return response

    # The goal and its result.

    async def _execute(self, handle: ServerGoalHandle) -> RunCampaign.Result:
        result = RunCampaign.Result()
        if self._campaign is not None:
            result.message = "another campaign is running: wait for it or cancel it"
            handle.abort()
            return result
        try:
            self._campaign = campaign = self._plan(handle)
            try:
                await self._run(campaign)
                result.success, result.message = True, "complete"
            except RigError as error:
                result.message = str(error)
                self.get_logger().error(f"the campaign ends: {error}")
            await self._finish(campaign, result)
        except RigError as error:
            result.success, result.message = False, result.message or str(error)
        finally:
            self._campaign = None
        if result.success:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result

    def _plan(self, handle: ServerGoalHandle) -> Campaign:
        goal = handle.request
        if not self.is_active:
            raise DeviceError("the campaign node is not active: activate it first")
        if goal.resumed.plan.impacts:
            setup = setup_from_msg(goal.resumed)
            goal.resumed.plan.confirm_samples = goal.confirm_samples
            return Campaign(handle, setup, goal.resumed)
        if goal.impacts < 1:
            raise ParameterError("impacts is 0: a campaign needs at least 1 per sample")
        if goal.keep_hits > goal.impacts:
            raise ParameterError(
                f"keep_hits is {goal.keep_hits} of {goal.impacts} impacts: no more hits can be"
                " kept than are struck"
            )
        setup = self._setup_of_rig
        samples = list(goal.samples) or list(setup.samples.names)
        for name in samples:
            setup.samples.find(name)
            if samples.count(name) > 1:
                raise ParameterError(f"sample {name!r} is asked for twice: once is enough")
        if angles := tuple(goal.release_angles) or self._angles:
            setup = setup.at_angles(angles)
        if goal.keep_hits:
            setup = replace(setup, analysis=replace(setup.analysis, keep_hits=goal.keep_hits))
        message = messages.setup_to_msg(setup, self.get_clock().now().to_msg())
        message.campaign_id = id_to_msg(make_id())
        message.plan = CampaignPlan(
            samples=setup.samples.find_series(samples),
            impacts=goal.impacts,
            attempts_per_impact=goal.attempts_per_impact,
            confirm_samples=goal.confirm_samples,
        )
        return Campaign(handle, setup, message)

    async def _finish(self, campaign: Campaign, result: RunCampaign.Result) -> None:
        """Disarm everything, and collect what there is of the hits, whatever ended it."""
        result.recording, result.setup = campaign.recording, campaign.message
        if self.stop_requested.done():
            return
        for client in (self._disarm_hammer, self._disarm):
            await self._try_call(client, Trigger.Request(), ANSWER_TIMEOUT)
        results = await self._try_call(self._results, GetResults.Request(), RESULTS_TIMEOUT)
        if results is None or results.setup.campaign_id != campaign.message.campaign_id:
            result.success = False
            result.message += ": the estimator has no results, analyze the recording"
            return
        for name in ("hammer", "samples", "speed_exponents", "accepted", "rejected"):
            setattr(result, name, getattr(results, name))


def main() -> int:
    """Run the node."""
    return run_node(CampaignNode)
