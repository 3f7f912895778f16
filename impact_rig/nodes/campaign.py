"""The campaign: samples times impacts, the next sample asked for, rejected hits repeated."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import Impact
from impact_rig_msgs.srv import ConfirmSample, GetResults
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle

from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup, format_angle
from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.campaign_hits import (
    CampaignProgress,
    CancelledError,
    InterruptedHitError,
    Readiness,
    Striker,
    describe_loss,
    find_obstacle,
    is_lost_since,
)
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import Read, RigNode
from impact_rig.nodes.rig_state import ACCELEROMETER, ESTIMATOR, HAMMER, RECORDER, RigState
from impact_rig.recordings.messages import stamp_from_msg

LEASE_DIFFERENCE = 0.2
"""How far apart two nodes may hear that a lease is over [s], our choice."""
CONFIRMATION_TIMEOUT = 24 * 3600.0
"""How long a person may take to mount a sample [s]: a campaign may wait overnight."""


class CampaignNode(RigNode):
    """An action server that runs campaigns on the rig's other nodes."""

    def __init__(self, **options: Any) -> None:
        super().__init__("campaign", **options)
        self.declare("rig_file", "", "path of the rig file; empty: the paper's rig and samples")
        self.declare(
            "attempts_per_impact", 10, "rejected hits in a row before a campaign gives up [-]",
            low=1, high=1000, read=Read.AT_USE,
        )  # fmt: skip
        self.declare(
            "verdict_timeout", 10.0, "longest time from the latest contact to the verdict [s]",
            low=0.1, high=3600.0, read=Read.AT_USE,
        )  # fmt: skip
        self.declare(
            "pause_timeout", 0.0,
            "how long a campaign may wait for what a hit needs and was lost [s]; 0: for ever",
            low=0.0, high=1e6, read=Read.AT_USE,
        )  # fmt: skip
        self._setup_of_rig: RigSetup = PAPER_SETUP
        self._angles: tuple[float, ...] = ()
        self._progress: CampaignProgress | None = None
        self._confirmed = ""
        self._setup = self.advertise(interfaces.SETUP)
        self._rig = RigState(self, (HAMMER, ACCELEROMETER, ESTIMATOR, RECORDER))
        self._readiness = Readiness(self, self._rig)
        self._striker = Striker(self, self._rig)
        self._rig[ESTIMATOR].take = self._striker.keep_verdict
        self.create_service(ConfirmSample, interfaces.CONFIRM_SAMPLE, self._confirm)
        self._results = self.create_client(GetResults, interfaces.GET_RESULTS)
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
        progress = self._progress
        if progress is None:
            return {"campaign": "none"}
        return {
            "campaign": f"{progress.feedback.sample}, {progress.feedback.impact} hits",
            "rejected": progress.feedback.rejected,
        }

    def describe_warning(self) -> str:
        """Return whose clocks differ."""
        return self._rig.describe_clock_differences()

    def _publish_setup(self, setup: RigSetup) -> Any:
        message = messages.setup_to_msg(setup, self.get_clock().now().to_msg())
        self._setup.publish(message)
        return message.header.stamp

    def _confirm(
        self, request: ConfirmSample.Request, response: ConfirmSample.Response
    ) -> ConfirmSample.Response:
        feedback = self._progress.feedback if self._progress else None
        if feedback is None or feedback.phase != RunCampaign.Feedback.WAITING_FOR_SAMPLE:
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

    async def _execute(self, handle: ServerGoalHandle) -> RunCampaign.Result:
        result = RunCampaign.Result()
        if self._progress is not None:
            result.message = "another campaign is running: wait for it or cancel it"
            handle.abort()
            return result
        try:
            self._progress = self._plan(handle)
            await self._run(self._progress)
        except CancelledError as error:
            result.message = str(error)
        except RigError as error:
            result.message = str(error)
            self.get_logger().error(f"campaign stopped: {error}")
        else:
            result.success, result.message = True, "complete"
        finally:
            progress, self._progress = self._progress, None
        if self.stop_requested.done():  # nobody is waited for any more
            result.success, result.message = False, "the campaign node has been stopped"
        else:
            await self._finish(result, 0 if progress is None else progress.judged)
        if result.success:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result

    def _plan(self, handle: ServerGoalHandle) -> CampaignProgress:
        goal = handle.request
        if not self.is_active:
            raise DeviceError("the campaign node is not active: activate it first")
        if goal.impacts < 1:
            raise ParameterError("impacts is 0: a campaign needs at least 1 per sample")
        if goal.keep_hits > goal.impacts:
            raise ParameterError(
                f"keep_hits is {goal.keep_hits} of {goal.impacts} impacts: no more hits can be"
                " kept than are struck"
            )
        setup = self._setup_of_rig
        samples: Sequence[str] = goal.samples or setup.samples.names
        for name in samples:
            setup.samples.find(name)
            if list(samples).count(name) > 1:
                raise ParameterError(f"sample {name!r} is asked for twice: once is enough")
        if angles := tuple(goal.release_angles) or self._angles:
            setup = setup.at_angles(angles)
        if goal.keep_hits:
            setup = replace(setup, analysis=replace(setup.analysis, keep_hits=goal.keep_hits))
        return CampaignProgress(
            handle=handle,
            setup=setup,
            samples=setup.samples.find_series(samples),
            impacts=goal.impacts,
            attempts=goal.attempts_per_impact or self.get_value("attempts_per_impact"),
        )

    async def _run(self, progress: CampaignProgress) -> None:
        if progress.handle.request.resume:
            await self._take_up(progress)
        else:
            await self._begin(progress.setup)
        progress.started = time.monotonic()
        for number, sample in enumerate(progress.samples, start=1):
            progress.publish(
                sample=sample,
                sample_number=number,
                sample_count=len(progress.samples),
                impact=0,
                impacts=progress.impacts,
            )
            wanted = [
                impact
                for impact in range(1, progress.impacts + 1)
                if (sample, impact) not in progress.known
            ]
            progress.publish(impact=progress.impacts - len(wanted))
            if wanted:
                await self._mount(progress, number - 1)
            for impact in wanted:
                await self._strike_until_accepted(progress, sample, impact)

    async def _begin(self, setup: RigSetup) -> None:
        """Give every node the set-up anew, which starts the estimates afresh, and arm."""
        stamp = self._publish_setup(setup)
        deadline = time.monotonic() + float(self.get_value("verdict_timeout"))
        while (await self.call(self._results, GetResults.Request())).setup_stamp != stamp:
            if time.monotonic() > deadline:
                raise DeviceError("the estimator does not take the set-up: see its diagnostics")
        self._striker.begin(stamp)
        if describe_loss(self._rig):
            # A node that was killed and started again counts twice until its lease is over; the
            # hammer hears of that a little later or earlier than this node.
            await self.wait_until(lambda: not describe_loss(self._rig), 2.0 * interfaces.LEASE)
            await self.pause(LEASE_DIFFERENCE)
        refusal = await self._readiness.enable()
        if refusal:
            # So with this node, if it was killed and started again, or whatever is heard late.
            await self.pause(interfaces.LEASE + LEASE_DIFFERENCE)
            refusal = await self._readiness.enable()
        if refusal:
            raise DeviceError(f"the hammer cannot be armed: {refusal}")

    async def _take_up(self, progress: CampaignProgress) -> None:
        """Go on with a campaign whose node has died: the estimator knows how far it had come."""
        timeout = float(self.get_value("verdict_timeout"))
        deadline = time.monotonic() + timeout
        while True:
            results = await self.call(self._results, GetResults.Request())
            judged = max((hit.record for hit in (*results.accepted, *results.rejected)), default=0)
            if time.monotonic() > deadline or not self._striker.is_verdict_due(judged):
                break
            progress.check_cancel()
            await self.pause(LEASE_DIFFERENCE)
        if not stamp_from_msg(results.setup_stamp):
            raise DeviceError("the estimator knows no campaign to go on with: start it anew")
        await self._striker.disarm()
        self._striker.take_up(judged, results.setup_stamp)
        progress.take_up(results)

    async def _mount(self, progress: CampaignProgress, place: int) -> None:
        """See that a sample is mounted and the hammer comes from its release angle.

        The holder sets the angle where it can; otherwise a person is asked to.
        """
        series = [progress.setup.samples.find(name) for name in progress.samples[: place + 1]]
        sample, before = series[-1], series[-2:-1]
        hammer, is_attended = self._rig[HAMMER].state, progress.handle.request.confirm_samples
        is_set = sample.has_angle and hammer is not None and hammer.sets_angle
        progress.angle = sample.release_angle if is_set else math.nan
        if is_attended and not (is_set and [item.body for item in before] == [sample.body]):
            angle = "" if is_set or not sample.has_angle else format_angle(sample.release_angle)
            await self._await_sample(
                progress, sample.name, angle and f"set the release angle of the hammer to {angle}"
            )
        elif sample.has_angle and not is_set:
            raise ParameterError(
                f"the holder ({hammer.holder if hammer else 'none'}) cannot set a release angle,"
                " and nobody is asked to: let the campaign confirm the samples (--ask)"
            )

    async def _await_sample(self, progress: CampaignProgress, sample: str, wanted: str) -> None:
        self._confirmed = ""
        progress.publish(phase=RunCampaign.Feedback.WAITING_FOR_SAMPLE, message=wanted)
        confirmed = await self.wait_until(
            lambda: self._confirmed == sample or progress.is_cancelled,
            CONFIRMATION_TIMEOUT,
        )
        progress.check_cancel()
        if not confirmed:
            raise DeviceError(f"nobody confirmed that {sample!r} is mounted")
        progress.publish(phase=RunCampaign.Feedback.RUNNING, message="")

    async def _strike_until_accepted(
        self, progress: CampaignProgress, sample: str, impact: int
    ) -> None:
        verdict, attempt, rejected = Impact(), progress.tried[sample, impact], 0
        while rejected < progress.attempts:
            await self._readiness.wait(progress, self._striker.recording)
            attempt, losses = attempt + 1, self._rig.losses
            try:
                verdict = await self._striker.strike(
                    progress, HitLabel(sample, 0, impact, attempt)
                )
            except InterruptedHitError as error:
                self.get_logger().warning(f"{sample}, hit {impact}.{attempt} is lost: {error}")
                if find_obstacle(self._rig) is None:
                    progress.publish(phase=RunCampaign.Feedback.PAUSED, message=str(error))
                continue
            if verdict.accepted:
                progress.accepted += 1
                progress.publish(impact=progress.feedback.impact + 1, last=verdict)
                return
            reasons = "; ".join(verdict.reasons)
            self.get_logger().warning(f"{sample}, hit {impact}.{attempt} rejected: {reasons}")
            progress.publish(rejected=progress.feedback.rejected + 1, last=verdict)
            # A hit that a loss has spoiled says nothing against the next one.
            rejected += not is_lost_since(self._rig, losses)
        raise DeviceError(
            f"{sample}, hit {impact}: {progress.attempts} hits in a row were rejected, the last"
            f" for {'; '.join(verdict.reasons)}"
        )

    async def _finish(self, result: RunCampaign.Result, judged: int) -> None:
        """Disarm everything and collect what there is of the hits, whatever ended the campaign."""
        await self._readiness.disable()
        await self._striker.disarm()
        results = await self._try_call(self._results, GetResults.Request())
        if results is None:
            result.success = False
            result.message += ": the estimator tells no results, analyze the recording"
        else:
            result.hammer = results.hammer
            result.samples = results.samples
            result.speed_exponents = results.speed_exponents
            result.accepted = results.accepted
            result.rejected = results.rejected
            known = sum(each.impacts_accepted + each.impacts_rejected for each in results.samples)
            if result.success and known < judged:
                result.success = False
                result.message = (
                    f"the estimator began anew and knows {known} hits of {judged}: analyze the"
                    " recording, which has them all"
                )
        result.recording = self._striker.recording

    async def _try_call(self, client: Any, request: Any) -> Any:
        try:
            return await self.call(client, request)
        except DeviceError as error:
            self.get_logger().error(str(error))
            return None


def main() -> int:
    """Run the node."""
    return run_node(CampaignNode)
