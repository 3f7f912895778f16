"""The campaign: a loop over the ledger of the estimator, as an explicit state machine."""

import contextlib
import math
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs import msg, srv
from impact_rig_msgs.action import RunCampaign
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.duration import Duration
from std_srvs.srv import Trigger

from impact_rig.configuration.rig_file import load_rig_file, read_today
from impact_rig.core.estimates.checks import advise_check
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.core.given.findings import Finding, join_findings
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup, Sample, format_angle
from impact_rig.core.hit.verdict import SHOWS_NOTHING
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.acts import BEAT, REACTION, Standstill
from impact_rig.nodes.campaign_plan import plan_campaign
from impact_rig.nodes.campaign_results import ResultsWriter
from impact_rig.nodes.campaign_state import (
    TASKS,
    TASKS_IN_PAUSE,
    TRANSITIONS,
    ArmingError,
    Campaign,
    EndError,
    HeldError,
    tell,
)
from impact_rig.nodes.guarded_hammer import SOMEBODY
from impact_rig.nodes.identity import Identity, id_from_msg, id_to_msg
from impact_rig.nodes.intake import Received
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.rig_node import Answer, RigNode
from impact_rig.recordings.fields import NANOSECONDS, NO_ID, from_message
from impact_rig.status.states import Disarming, HammerPlace, HammerStatus, Step, Task

LOOK_PERIOD = 0.5
"""How often a campaign checks whether its pause is over [s]."""
PAUSE_TIMEOUT = 1.0
"""How long the hammer may take to answer that it is disarmed, before it is asked again [s]."""
RESULTS_TIMEOUT = 600.0
"""How long the estimator may take to read a run, or to fit the model to a hundred samples [s]."""

CHECK_ATTEMPTS = 3
"""Hits in a row that fail the operational check, and end a campaign [-], our choice."""
BLIND_HITS = 5
"""Hits in a row that showed nothing, and end a campaign [-]: a cable off stays off."""
LAST_VERDICT_TIMEOUT = 2.0
"""How long the verdict on a hit is waited for that the end has cut off [s]."""
DISPLAYS = ("visualizer", "page")
DISPLAY_TIMEOUT = 1.0
"""How long a campaign's start may wait for a display [s]."""


class CampaignNode(RigNode):
    """An action server that runs campaigns on the rig's other nodes."""

    # How long an estimator may be silent at a campaign's end, before its results are given up [s].
    silence = 30.0

    def __init__(self, **options: Any) -> None:
        super().__init__("campaign", **options)
        self._setup_of_rig: RigSetup = PAPER_SETUP
        self._angles: tuple[float, ...] = ()
        self._check_mass: Sample | None = None
        self._checked_on = ""  # day of the latest operational check that was passed
        self._campaign: Campaign | None = None
        self._ended: Campaign | None = None  # the latest that is over
        self._estimator = messages.OWN_ESTIMATOR  # of the latest results
        self._hammer = HammerStatus(message="it has published no state")
        self._setup = self.advertise(interfaces.SETUP)
        self.listen(interfaces.HAMMER_STATE, self._on_hammer_state)
        self.listen(interfaces.IMPACT.unread, self._on_impact)
        self._writer = ResultsWriter(lambda error: self.get_logger().error(error))
        self.listen(interfaces.VIRTUAL_IMPACT, self._writer.on_truth)
        self._told = self.number_state(interfaces.CAMPAIGN_STATE, tell)
        self._standstill = Standstill()
        self.create_timer(BEAT / self.pace, self._check_clock)
        self.offer_act(interfaces.PAUSE_CAMPAIGN, self._hold)
        self.offer_act(interfaces.RESUME_CAMPAIGN, self._go_on, self._told)
        self.create_service(srv.ConfirmSample, interfaces.CONFIRM_SAMPLE, self._on_confirm_sample)
        names = ("recorder", "accelerometer", "estimator", "hammer", *DISPLAYS)
        self._joins = {
            name: self.create_client(srv.JoinCampaign, interfaces.make_join_name(name))
            for name in names
        }
        self._results = self.create_client(srv.GetResults, interfaces.GET_RESULTS)
        self._set_armed = self.create_client(srv.SetArmed, interfaces.SET_ARMED)
        self._set_angle = self.create_client(srv.SetAngle, interfaces.SET_ANGLE)
        self._arm = self.create_client(srv.Arm, interfaces.ARM_ACCELEROMETER)
        self._disarm = self.create_client(Trigger, interfaces.DISARM_ACCELEROMETER)
        self._release = self.create_client(srv.Release, interfaces.RELEASE_HAMMER)
        self._work: Mapping[Step, Callable[[Campaign], Awaitable[Step]]] = {
            Step.JOINING: self._join_nodes,
            Step.COUNTING: self._count_hits,
            Step.WAITING_FOR_SAMPLE: self._wait_for_sample,
            Step.PAUSED: self._pause,
            Step.WAITING_FOR_HAMMER: self._wait_for_hammer,
            Step.STRIKING: self._strike,
            Step.DISARMING: self._disarm_accelerometers,
        }
        self._server = ActionServer(
            self,
            RunCampaign,
            interfaces.RUN_CAMPAIGN,
            execute_callback=self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def describe_warning(self) -> str | None:
        """Return that the results are those of another estimator than the rig's."""
        return messages.describe_estimator(self._estimator)

    def configure(self) -> None:
        """Read the rig file."""
        rig = load_rig_file(self.get_value("rig_file"))
        self._setup_of_rig, self._angles = rig.setup, rig.release_angles
        self._check_mass = rig.check_mass

    def activate(self) -> None:
        """Publish the set-up for the rig's other nodes."""
        self._setup.publish(messages.setup_to_msg(self._setup_of_rig, Time()))
        if self._campaign is None:
            self._told.publish(state=Step.ENDED)

    def _check_clock(self) -> None:
        """Let a person arm again if this process was stopped, or the computer asleep."""
        stood_still = self._standstill.look()
        if not stood_still:
            return
        self.get_logger().warning(f"the campaign node {stood_still}")
        self._told.renew()
        if campaign := self._campaign:
            campaign.arms_until = 0.0
            self._let_disarm(campaign, f"the campaign node {stood_still}")

    def _take_word(self, campaign: Campaign) -> None:
        """Note that a person has said just now that the hammer may go."""
        campaign.arms_until, campaign.seen = time.monotonic() + REACTION, self._hammer.number

    def _let_disarm(self, campaign: Campaign, why: str) -> None:
        """Ask the hammer to disarm, and wait for nothing."""
        request = srv.SetArmed.Request(campaign_id=campaign.setup.campaign_id, why=why)
        self._set_armed.call_async(request)

    def close(self) -> None:
        """Close, when the results are written."""
        super().close()
        self._writer.close()

    # The states.

    async def _run(self, campaign: Campaign) -> None:
        state, task = Step.JOINING, Task.NOTHING
        while state is not Step.COMPLETE:
            # While it looks, what was asked for still is.
            is_looking = state in (Step.JOINING, Step.COUNTING)
            asked = {} if is_looking else {"task": TASKS.get(state, task), "until": Time()}
            campaign.change(state=state, **asked)
            if state is not Step.COUNTING:  # a moment after each hit
                campaign.publish()
            self._check_end(campaign)
            try:
                if campaign.is_held and is_looking:
                    raise HeldError(campaign.held_for)
                if is_looking and (stranger := self.intake.find_any_stranger()):
                    raise DeviceError(stranger)
                following = await self._work[state](campaign)
                task = Task.NOTHING
            except DeviceError as error:
                self._check_end(campaign)
                if campaign.state.message != str(error):
                    self.get_logger().warning(str(error))
                campaign.state.message = str(error)
                campaign.is_announced = True
                following, task = Step.PAUSED, TASKS_IN_PAUSE.get(type(error), Task.NOTHING)
                if state is Step.STRIKING:
                    following, campaign.stumbled_at = Step.DISARMING, time.monotonic()
            if following not in TRANSITIONS[state]:
                raise RuntimeError(f"no way leads from {state.name} to {following.name}")
            state = following

    def _check_end(self, campaign: Campaign) -> None:
        """Raise `EndError` if the client, this node's end or a long pause ends the campaign."""
        if campaign.handle.is_cancel_requested:
            pause = campaign.state.message
            raise EndError(f"cancelled in a pause: {pause}" if pause else "cancelled by a client")
        if campaign.is_superseded:
            raise EndError("another client goes on with it")
        if self.stop_requested.done():
            raise EndError("the campaign node has been stopped")
        limit = float(self.get_value("pause_timeout"))
        if limit and time.monotonic() - campaign.stands_since > limit:
            reason = campaign.state.message
            raise EndError(f"the pause took longer than {limit:g} s: {reason}")

    async def _join_nodes(self, campaign: Campaign) -> Step:
        """Ask every node to take part, and whether it is ready."""
        # Who joins publishes its state, which those take that have joined before: the hammer needs
        # those of all others, and by the accelerometers' id the others know the running stream.
        if campaign.stream_id == NO_ID:
            await self._announce(campaign)
            campaign.is_announced = True
        await self._join_node(campaign, "hammer")
        answer = await self._join_node(campaign, "accelerometer")
        campaign.stream_id = id_from_msg(answer.stream_id)
        campaign.recording = (await self._join_node(campaign, "recorder")).recording
        await self._join_node(campaign, "estimator")
        self._ask_displays(campaign)  # a silent one delays nothing
        self._setup.publish(campaign.setup)
        campaign.has_joined = True
        return Step.COUNTING

    async def _announce(self, campaign: Campaign) -> None:
        """Send the campaign's id to its listeners before any node publishes with it."""
        for name in ("recorder", "hammer", "accelerometer"):
            await self._join_node(campaign, name, announced=True)
        answers = self._ask_displays(campaign, announced=True)
        await self._wait(
            campaign, lambda: all(answer.done() for answer in answers), DISPLAY_TIMEOUT
        )

    def _ask_displays(self, campaign: Campaign, *, announced: bool = False) -> list[Any]:
        """Ask the displays that are there to take part; return their answers to come."""
        request = srv.JoinCampaign.Request(setup=campaign.setup, announced=announced)
        displays = [self._joins[name] for name in DISPLAYS]
        return [it.call_async(request) for it in displays if it.service_is_ready()]

    async def _join_node(
        self, campaign: Campaign, name: str, *, announced: bool = False
    ) -> srv.JoinCampaign.Response:
        client = self._joins[name]
        # At the start there may be a run to read; later its silence is a pause.
        is_reading = name == "estimator" and not campaign.has_joined
        answer = await self.call(
            client,
            srv.JoinCampaign.Request(
                setup=campaign.setup,
                stream_id=id_to_msg(campaign.stream_id),
                recording=campaign.recording,
                announced=announced,
            ),
            RESULTS_TIMEOUT if is_reading else self.answer_timeout,
            lambda: campaign.is_to_end or not client.service_is_ready(),
        )
        if not answer.success:
            raise DeviceError(answer.message)
        return answer

    async def _count_hits(self, campaign: Campaign) -> Step:
        """Ask the ledger what is missing, and whether the hammer can strike it."""
        request = srv.GetResults.Request(counts_only=True)
        ledger = await self.call(self._results, request)
        if ledger.setup.campaign_id != campaign.setup.campaign_id:
            raise DeviceError("the estimator was started again")
        self._estimator = ledger.estimator
        if ledger.waiting_record:
            raise DeviceError(
                f"the recorder has not stored record {ledger.waiting_record} yet: see to its disk"
            )
        campaign.newest_record = max(campaign.newest_record, ledger.newest_record)
        plan, counts = campaign.setup.plan, _find_counts(campaign.setup, ledger)
        missing = [name for name in plan.samples if counts[name].accepted < plan.impacts]
        sample = missing[0] if missing else plan.samples[-1]
        if sample != campaign.state.sample:
            campaign.state.task = Task.NOTHING  # which was for another
        campaign.change(
            sample=sample,
            impact=min(counts[sample].accepted, plan.impacts),
            counts=list(counts.values()),
        )
        check_sample = campaign.setup.check_sample
        if check_sample and check_sample not in missing:
            self._checked_on = read_today()
        if not missing:
            return Step.COMPLETE
        most = CHECK_ATTEMPTS if sample == check_sample else plan.attempts_per_impact or 10
        if campaign.failures >= most:
            raise EndError(
                f"{sample}: {campaign.failures} hits in a row were rejected or got no verdict, the"
                f" last one: {campaign.failure}"
            )
        if campaign.blind >= BLIND_HITS:
            raise EndError(
                f"{sample}: {campaign.blind} hits in a row showed nothing, the last one:"
                f" {campaign.failure}: see to sample, hammer, sensors and cables"
            )
        campaign.hit = {
            "sample": sample,
            "impact": counts[sample].accepted + 1,
            "attempt": counts[sample].attempts + 1,
        }
        await self._wait_while_at(campaign, HammerPlace.SWINGING)
        if campaign.state.mounted != sample and self._is_person_needed(campaign, sample):
            await self._take_enable(campaign, f"while {sample} is mounted")
            # From now on nobody knows what is mounted, but the person whose hands are in.
            campaign.state.mounted, campaign.state.message = "", self._describe_mounting(campaign)
            return Step.WAITING_FOR_SAMPLE
        campaign.state.mounted = sample
        return await self._check_hammer(campaign)

    def _is_person_needed(self, campaign: Campaign, sample: str) -> bool:
        """Return whether a person has to mount a sample, or to set the hammer's angle."""
        wanted, is_set = campaign.find_sample(sample), self._hammer.sets_angle
        if not campaign.setup.plan.confirm_samples:
            if wanted.has_angle and not is_set:
                raise EndError(
                    f"the holder ({self._hammer.holder}) cannot set a release angle, and no person"
                    " is asked to: let the campaign confirm the samples (--ask)"
                )
            return False
        mounted = campaign.state.mounted
        is_there = mounted and campaign.find_sample(mounted).body == wanted.body
        return not (wanted.has_angle and is_set and is_there)

    async def _check_hammer(self, campaign: Campaign) -> Step:
        if self._hammer.is_away:
            await self._take_enable(campaign, "while the hammer is put back")
            campaign.state.message = "put the hammer back into its holder, and say that it is back"
            return Step.WAITING_FOR_HAMMER
        self._check_clock()
        if campaign.is_held:
            raise HeldError(campaign.held_for)
        until, campaign.arms_until = campaign.arms_until, 0.0
        if time.monotonic() < until and not self._hammer.needs_person:
            await self._give_enable(campaign, min(until, time.monotonic() + REACTION))
        if not self._hammer.armed:
            acts = "reset the stop, then arm" if self._hammer.is_stopped else "arm"
            raise ArmingError(
                f"the hammer is not armed ({self._hammer.message}): to go on, make sure that it"
                f" can strike no one, then {acts}"
            )
        if time.monotonic() - campaign.stumbled_at > interfaces.LEASE:
            # It was on show for so long that the campaign stands: as in a pause.
            raise DeviceError(campaign.state.message)
        return Step.STRIKING

    async def _pause(self, campaign: Campaign) -> Step:
        """Disarm the hammer; wait a little, or until its state changes.

        Who reads that the campaign pauses may walk up to the hammer: it goes when a person has
        armed it again, and not because what was missing is back.
        """
        campaign.stands_since = min(campaign.stands_since, time.monotonic())
        campaign.stumbled_at = math.inf
        if campaign.has_joined or time.monotonic() - campaign.stands_since > REACTION:
            campaign.arms_until = 0.0  # who said that it may go has read this
        if campaign.state.task != Task.ARM:  # else a person has just armed it, as was asked for
            with contextlib.suppress(DeviceError):
                await self._take_enable(campaign, campaign.state.message)
        hammer, was_held = self._hammer, campaign.is_held
        await self._wait(
            campaign,
            lambda: self._hammer.number != hammer.number or campaign.is_held != was_held,
            LOOK_PERIOD / self.pace,
        )
        return Step.JOINING

    async def _wait_for_hammer(self, campaign: Campaign) -> Step:
        """Wait until a person has put the hammer back."""
        away = self._hammer
        await self._wait_while_at(campaign, HammerPlace.AWAY)
        campaign.state.message = ""
        # One that was started again counts from one: nobody has said that the hammer is back.
        if not self._hammer.is_away and self._hammer.number > away.number:
            self._take_word(campaign)
        return Step.COUNTING

    async def _wait_while_at(self, campaign: Campaign, place: HammerPlace) -> None:
        """Wait while the hammer is at a place.

        A hammer node that was started again meanwhile publishes for this campaign once it is asked
        to join.
        """

        def has_left() -> bool:
            is_at = self._hammer.state is place
            is_in_hands = self._hammer.is_away and self._hammer.armed
            return not is_at or is_in_hands or campaign.is_to_end or campaign.is_held

        while not await self.wait_until(has_left, LOOK_PERIOD / self.pace):
            await self._join_node(campaign, "hammer")

    async def _wait_for_sample(self, campaign: Campaign) -> Step:
        """Wait until a person has mounted the sample, or another is needed for a verdict."""
        verdict = campaign.verdict

        def is_over() -> bool:
            is_known = bool(campaign.state.mounted) or campaign.verdict is not verdict
            return is_known or campaign.is_held or self._hammer.armed

        await self._wait(campaign, is_over)
        return Step.COUNTING

    def _describe_mounting(self, campaign: Campaign) -> str:
        """Return what a person has to do besides mounting the sample."""
        sample = campaign.find_sample(campaign.state.sample)
        if sample.name == campaign.setup.check_sample and (
            advice := advise_check(self._setup_of_rig)
        ):
            return advice
        if not sample.has_angle or self._hammer.sets_angle:
            return ""
        return f"set the release angle of the hammer to {format_angle(sample.release_angle)}"

    async def _give_enable(self, campaign: Campaign, until: float) -> None:
        """Arm the hammer for a person who has just said that it may go; ask again until a time."""
        request = srv.SetArmed.Request(campaign_id=campaign.setup.campaign_id, armed=True)
        request.seen = campaign.seen
        request.deadline = stamp_to_msg(self._hammer.stamp + round(REACTION * NANOSECONDS))
        answer = await self.call(self._set_armed, request)
        # What it knows of the others may be older than their answers.
        while not answer.success and time.monotonic() < until:
            await self.wait_until(lambda: False, 0.05)
            answer = await self.call(self._set_armed, request)
        if not answer.success:
            raise DeviceError(f"the hammer cannot be armed: {answer.message}")
        await self.wait_until(lambda: self._hammer.armed, self.answer_timeout)

    async def _take_enable(self, campaign: Campaign, why: str) -> None:
        """Disarm the hammer: hands may be near it."""
        if not self._hammer.armed:
            return
        request = srv.SetArmed.Request(campaign_id=campaign.setup.campaign_id, why=why)
        await self.call(self._set_armed, request, PAUSE_TIMEOUT)
        if not await self.wait_until(lambda: not self._hammer.armed, PAUSE_TIMEOUT):
            raise DeviceError("the hammer does not say that it is disarmed: keep away from it")

    async def _strike(self, campaign: Campaign) -> Step:
        """Strike once, and wait for the verdict; every failure is a `DeviceError`."""
        campaign.stumbled_at = math.inf
        ids = {"campaign_id": campaign.setup.campaign_id}
        sample = campaign.find_sample(campaign.hit["sample"])
        if sample.has_angle and self._hammer.sets_angle:
            await self._ask(
                campaign, self._set_angle, srv.SetAngle.Request(angle=sample.release_angle)
            )
        await self._count_down(campaign)
        arming = srv.Arm.Request(**ids, **campaign.hit, after=campaign.newest_record)
        record = (await self._ask(campaign, self._arm, arming)).record
        campaign.newest_record = record
        release = srv.Release.Request(
            **ids, stream_id=id_to_msg(campaign.stream_id), record=record, **campaign.hit
        )
        self._check_held_back(campaign)
        released = await self._ask(campaign, self._release, release)
        if released.by_hand:
            until = self.get_clock().now() + Duration(seconds=released.latest_contact)
            campaign.publish(task=Task.LET_GO, until=until.to_msg())
        timeout = float(self.get_value("verdict_timeout"))
        campaign.awaited = record
        campaign.failures += 1
        campaign.failure = f"no verdict on record {record} came within {timeout:g} s"
        timeout += released.latest_contact
        await self._wait(campaign, lambda: campaign.verdict.record == record, timeout)
        verdict = campaign.verdict
        if verdict.record != record:
            raise DeviceError(campaign.failure)
        reasons = [from_message(Finding, item) for item in verdict.reasons]
        campaign.failure = join_findings(reasons)
        shows_nothing = any(item.reason in SHOWS_NOTHING for item in reasons)
        campaign.blind = campaign.blind + 1 if shows_nothing else 0
        if verdict.accepted:
            campaign.failures = 0
        campaign.stands_since = math.inf
        campaign.change(last=verdict, message="", task=Task.NOTHING, until=Time())
        return Step.COUNTING

    async def _count_down(self, campaign: Campaign) -> None:
        """Give notice that the hammer goes; who wants it back disarms it or pauses."""
        if not (lead_time := self._hammer.lead_time):
            return
        until = self.get_clock().now() + Duration(seconds=lead_time)
        campaign.publish(task=Task.KEEP_AWAY, until=until.to_msg())
        await self._wait(campaign, lambda: not self._hammer.armed or campaign.is_held, lead_time)
        campaign.publish(task=Task.NOTHING, until=Time())
        self._check_held_back(campaign)

    def _check_held_back(self, campaign: Campaign) -> None:
        """Raise `DeviceError` if somebody does not want the next release any more."""
        self._check_clock()
        if campaign.is_held or campaign.is_to_end or not self._hammer.armed:
            why = campaign.held_for or self._hammer.message
            raise DeviceError(f"the hammer was held back before its release: {why}")

    async def _disarm_accelerometers(self, campaign: Campaign) -> Step:
        """Disarm, so that no later release falls into this record; back to the top."""
        campaign.stands_since = min(campaign.stands_since, time.monotonic())
        await self._call_if_there(self._disarm, Trigger.Request())
        return Step.JOINING

    # Helpers of the states.

    async def _wait(
        self, campaign: Campaign, condition: Callable[[], bool], timeout: float = math.inf
    ) -> None:
        """Wait for a condition, so long, or until the client cancels the campaign."""
        await self.wait_until(lambda: condition() or campaign.is_to_end, timeout)

    async def _ask(self, campaign: Campaign, client: Any, request: Any) -> Any:
        """Return the good answer of a node; for two timeouts ask again at "later".

        Nodes that have just started take a while to find each other.
        """
        deadline = time.monotonic() + 2.0 * self.answer_timeout
        while True:
            answer = await self.call(client, request, is_given_up=lambda: campaign.is_to_end)
            if answer.success:
                return answer
            if not answer.later or time.monotonic() > deadline or campaign.is_to_end:
                raise DeviceError(answer.message)
            await self.wait_until(lambda: False, 0.02)

    async def _call_if_there(self, client: Any, request: Any, timeout: float | None = None) -> Any:
        """Return the answer of a node; None: it gives none."""
        with contextlib.suppress(DeviceError):
            return await self.call(client, request, timeout, lambda: not client.service_is_ready())
        return None

    def _on_hammer_state(self, received: Received[HammerStatus]) -> None:
        before, self._hammer = self._hammer, received.value
        campaign, hammer = self._campaign, self._hammer
        is_ours = before.armed and not hammer.armed and hammer.disarmed_by is Disarming.CAMPAIGN
        # A word that was given while the campaign's own disarming was on its way still counts.
        if campaign and is_ours and campaign.seen == before.number:
            campaign.seen = hammer.number

    def _on_impact(self, received: Received[msg.Impact]) -> None:
        if self._campaign is not None:
            self._campaign.verdict = received.value
        elif self._ended is not None:  # a person decided on a hit
            asked = self._results.call_async(srv.GetResults.Request())
            asked.add_done_callback(self._count_again)

    def _count_again(self, done: Any) -> None:
        """Publish and write what a person's verdict makes of a campaign that is over."""
        ended, ledger = self._ended, done.result()
        if ended is None or self._campaign is not None:
            return
        setup = ended.setup
        if ledger.setup.campaign_id == setup.campaign_id:
            if not setup.plan.trial:
                self._writer.write(ledger, ended.recording)
            self._told.publish(counts=list(_find_counts(setup, ledger).values()))

    def _on_confirm_sample(
        self, request: srv.ConfirmSample.Request, response: srv.ConfirmSample.Response
    ) -> srv.ConfirmSample.Response:
        campaign = self._campaign
        if refusal := self._told.refuse(request):
            response.message = refusal
        elif campaign is None or campaign.state.state != Step.WAITING_FOR_SAMPLE:
            response.message = "no campaign is waiting for a sample"
        elif request.sample != (wanted := campaign.state.sample):
            response.message = f"the campaign is waiting for {wanted!r}, not {request.sample!r}"
        else:
            campaign.state.mounted, campaign.state.task = request.sample, Task.NOTHING
            campaign.state.message = ""
            self._take_word(campaign)
            response.success, response.message = True, f"{request.sample} is mounted"
        self.wake_waiters()
        return response

    def _hold(self, who: str) -> Answer:
        """Let the campaign stand until a person resumes it; the hammer is disarmed at once."""
        campaign = self._campaign
        if campaign is None:
            return False, "no campaign is running"
        campaign.held_for = f"paused by {who or SOMEBODY}"
        self._let_disarm(campaign, campaign.held_for)
        self.wake_waiters()
        return True, "the campaign pauses, the hammer is disarmed"

    def _go_on(self, _: str) -> Answer:
        """Let the campaign go on as it began: it arms the hammer, once."""
        campaign = self._campaign
        if campaign is None or not campaign.is_held:
            return False, "no campaign is paused by a person"
        if self._hammer.is_stopped:
            return False, "an emergency stop lasts: reset it, then arm the hammer"
        if self._hammer.needs_person:
            return False, f"arm the hammer first ({self._hammer.message})"
        campaign.held_for = ""
        self._take_word(campaign)
        self.wake_waiters()
        return True, "the campaign arms the hammer and goes on"

    # The goal and its result.

    def _plan(self, goal: RunCampaign.Goal) -> msg.RigSetup:
        if refusal := self._told.refuse(goal):
            raise DeviceError(refusal)
        if not self.is_active:
            raise DeviceError("the campaign node is not active: activate it first")
        if self._campaign is not None:
            raise DeviceError(
                "another campaign is running: wait for it, cancel it, or go on with it (--resume)"
            )
        stamp = self.get_clock().now().to_msg()
        due = self._check_mass if self._checked_on != read_today() else None
        return plan_campaign(goal, self._setup_of_rig, self._angles, stamp, due)

    async def _execute(self, handle: ServerGoalHandle) -> RunCampaign.Result:
        result = RunCampaign.Result()
        try:
            await self._supersede(id_from_msg(handle.request.resumed.campaign_id))
            setup = self._plan(handle.request)
        except RigError as error:
            result.message = str(error)
            self.get_logger().error(f"the campaign is rejected: {error}")
            handle.abort()
            return result
        self.membership.join(Identity(id_from_msg(setup.campaign_id)))
        self._writer.begin()
        self._campaign = campaign = Campaign(handle, setup, self._told)
        campaign.seen = self._hammer.number
        campaign.publish(
            impacts=setup.plan.impacts,
            counts=[msg.SampleCount(sample=name) for name in setup.plan.samples],
        )
        try:
            await self._run(campaign)
            result.success, result.message = True, "complete"
        except Exception as error:  # noqa: BLE001 - else the client would get no reason
            result.message = str(error) if isinstance(error, RigError) else repr(error)
            self.get_logger().error(f"the campaign ends: {result.message}")
        finally:
            await self._finish(campaign, result)
            campaign.is_announced = True
            campaign.publish(
                state=Step.COMPLETE if result.success else Step.ENDED,
                message="" if result.success else result.message,
                task=Task.NOTHING,
                until=Time(),
            )
            self._campaign, self._ended = None, campaign
        if result.success:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result

    async def _supersede(self, campaign_id: bytes) -> None:
        """End the campaign that runs, if it is to go on for another client: its own has gone."""
        running = self._campaign
        if running is not None and id_from_msg(running.setup.campaign_id) == campaign_id:
            running.is_superseded = True
            self.wake_waiters()
            await self.wait_until(lambda: self._campaign is not running, RESULTS_TIMEOUT)

    async def _finish(self, campaign: Campaign, result: RunCampaign.Result) -> None:
        """Disarm everything, and collect the results so far, for every reason to end."""
        result.recording, result.setup = campaign.recording, campaign.setup
        if self.stop_requested.done():
            return
        with contextlib.suppress(DeviceError):
            await self._take_enable(campaign, "at the campaign's end")
        await self._call_if_there(self._disarm, Trigger.Request())
        # A hit that the end has cut off is in the recording, and so in the results.
        await self.wait_until(
            lambda: campaign.verdict.record >= campaign.awaited, LAST_VERDICT_TIMEOUT
        )
        # Before the first hit it may read a run; later it answers soon, or not at all.
        patience = self.silence if campaign.has_joined else RESULTS_TIMEOUT
        counts = srv.GetResults.Request(counts_only=True)
        results = await self._call_if_there(self._results, counts, patience)
        if results is not None:
            results = await self._call_if_there(
                self._results, srv.GetResults.Request(), RESULTS_TIMEOUT
            )
        if results is None or results.setup.campaign_id != campaign.setup.campaign_id:
            result.success = False
            result.message += ": the estimator has no results, analyze the recording"
            return
        for name in ("estimator", "hammer", "samples", "speed_exponents", "accepted", "rejected"):
            setattr(result, name, getattr(results, name))
        is_trial = campaign.setup.plan.trial
        written = self._writer.write(result, "" if is_trial else campaign.recording)
        if await self.wait_until(written.done, RESULTS_TIMEOUT):
            faults = written.result().items()
            result.truths = [msg.VirtualImpact(record=it, faults=told) for it, told in faults]


def _find_counts(
    setup: msg.RigSetup, ledger: srv.GetResults.Response
) -> dict[str, msg.SampleCount]:
    """Return the hits of each sample of a plan, in its order."""
    counts = {count.sample: count for count in ledger.counts}
    return {name: counts.get(name, msg.SampleCount(sample=name)) for name in setup.plan.samples}
