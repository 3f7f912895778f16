"""One hit of a campaign: accelerometers armed, hammer released, verdict awaited."""

import math
from typing import Any

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import Impact
from impact_rig_msgs.srv import Arm, Release
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaigning.progress import CampaignProgress
from impact_rig.nodes.campaigning.rig_watch import WORD_TIMEOUT, RigWatch
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.unhurried import UnhurriedTopic


class InterruptedHitError(DeviceError):
    """Something that the hit needs was lost: it is no hit, and the campaign goes on later."""


class Striker:
    """Strikes the mounted sample, one hit at a time.

    Parameters
    ----------
    node : RigNode
        The campaign's; its parameter `verdict_timeout` is read.
    watch : RigWatch
        What it hears of the rig.

    Attributes
    ----------
    recording : str
        Where the hits are recorded, as the last release said; empty: nowhere, or none yet.
    """

    def __init__(self, node: RigNode, watch: RigWatch) -> None:
        self.recording = ""
        self._node = node
        self._watch = watch
        self._verdicts: dict[int, Impact] = {}
        self._stored: set[int] = set()
        self._stored_words = UnhurriedTopic(node, interfaces.RECORD_STORED)
        self._newest = 0
        self._unjudged: set[int] = set()
        self._is_armed_in_vain = False
        watch.follow_estimator(self._keep_verdict)
        self._arm = node.create_client(Arm, interfaces.ARM_ACCELEROMETER)
        self._disarm = node.create_client(Trigger, interfaces.DISARM_ACCELEROMETER)
        self._release = node.create_client(Release, interfaces.RELEASE_HAMMER)

    def begin(self) -> None:
        """Forget the campaign before."""
        self.recording = ""
        self._newest = 0
        for memory in (self._verdicts, self._stored, self._unjudged):
            memory.clear()

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
            If something was lost, and no verdict will come; the accelerometers are disarmed, so
            that no later release falls into this record.
        CancelledError
            If the client asked for it.
        DeviceError
            If it failed though nothing is lost.
        """
        if verdict := self._take_late_verdict():
            return verdict
        losses = self._watch.losses
        if self._is_armed_in_vain:
            await self.disarm()
        try:
            return await self._strike(progress, label, losses)
        except InterruptedHitError:
            progress.check_cancel()
            await self.disarm()
            if verdict := self._take_late_verdict():
                return verdict
            raise

    async def disarm(self) -> None:
        """Disarm the accelerometers, if they are there; else before they are armed again."""
        self._is_armed_in_vain = True
        if not self._disarm.service_is_ready() or self._watch.is_acquisition_lost():
            return
        try:
            await self._node.call(
                self._disarm, Trigger.Request(), is_given_up=self._watch.is_acquisition_lost
            )
            self._is_armed_in_vain = False
        except DeviceError as error:
            self._node.get_logger().error(str(error))

    def _take_late_verdict(self) -> Impact | None:
        """Return the verdict on an interrupted hit that has come after all, once.

        It counts like any other, else its hit would be in the results beside the one that is
        struck in its place.
        """
        for record in self._unjudged & self._verdicts.keys():
            return self._take_verdict(record)
        return None

    def _take_verdict(self, record: int) -> Impact:
        """Return the verdict on a record, and forget the record: long campaigns have many."""
        self._unjudged.remove(record)
        self._stored.discard(record)
        return self._verdicts.pop(record)

    async def _strike(self, progress: CampaignProgress, label: HitLabel, losses: int) -> Impact:
        hit = {"sample": label.sample, "impact": label.impact, "attempt": label.attempt}
        armed = await self._ask(
            progress, self._arm, Arm.Request(**hit), losses, "the accelerometers cannot be armed"
        )
        record = armed.record
        if record <= self._newest:
            raise DeviceError(
                f"the accelerometers have counted record {record} after {self._newest}: they were"
                " started anew; start the campaign anew, too, so that no two hits have one number"
            )
        self._newest = record
        # What was said before of another record of this number is not said of this one.
        self._note_stored()
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
        """Return the answer of another node, if it is a good one."""
        try:
            answer = await self._node.call(
                client,
                request,
                is_given_up=lambda: progress.is_cancelled or self._watch.has_gone(),
            )
            if answer.success:
                return answer
            reason = answer.message
        except DeviceError as error:
            reason = str(error)
        progress.check_cancel()
        await self._node.wait_until(
            lambda: self._watch.is_lost_since(losses) or progress.is_cancelled, WORD_TIMEOUT
        )
        progress.check_cancel()
        if self._watch.is_lost_since(losses):
            raise InterruptedHitError(f"{failure}: {reason}")
        raise DeviceError(f"{failure}: {reason}")

    async def _await_verdict(
        self, progress: CampaignProgress, record: int, latest_contact: float, losses: int
    ) -> None:
        timeout = float(self._node.get_value("verdict_timeout"))
        longest_swing = latest_contact if math.isfinite(latest_contact) else 0.0
        await self._node.wait_until(
            lambda: (
                record in self._verdicts
                or progress.is_cancelled
                or bool(self._watch.find_broken_way())
                or self._has_lost(record)
            ),
            timeout + longest_swing,
        )
        if loss := self._watch.find_broken_way():
            # Told at once; but the verdict may still be on its way, or come when they are back.
            progress.publish(phase=RunCampaign.Feedback.PAUSED, message=loss)
            await self._node.wait_until(
                lambda: (
                    record in self._verdicts or progress.is_cancelled or self._has_lost(record)
                ),
                timeout,
            )
        if record in self._verdicts:
            return
        progress.check_cancel()
        cause = self._explain_silence(record, timeout)
        if not self._has_lost(record) and self._watch.is_lost_since(losses):
            raise InterruptedHitError(cause)
        raise DeviceError(cause)

    def _has_lost(self, record: int) -> bool:
        """Whether the recorder has stopped before it stored a record."""
        end = self._watch.find_end_of_recording(self.recording)
        return bool(end) and not self._is_stored(record)

    def _explain_silence(self, record: int, timeout: float) -> str:
        """Return why there is no verdict on a record, as far as it can be known here."""
        if self._has_lost(record):
            return self._watch.find_end_of_recording(self.recording)
        cause = f"no verdict on record {record} came within {timeout:g} s"
        if self.recording and not self._is_stored(record):
            cause += f": the recorder has not said that record {record} is stored"
        return cause

    def _keep_verdict(self, message: Impact) -> None:
        if message.record in self._unjudged:
            self._verdicts[message.record] = message

    def _is_stored(self, record: int) -> bool:
        self._note_stored()
        return record in self._stored

    def _note_stored(self) -> None:
        for message in self._stored_words.take():
            if message.complete and message.record in self._unjudged:
                self._stored.add(message.record)
