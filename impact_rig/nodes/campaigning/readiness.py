"""The rig made ready for the next hit: the hammer enabled, pauses kept and told."""

import math
import time
from dataclasses import replace
from typing import Any

from impact_rig_msgs.action import RunCampaign
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaigning.progress import CampaignProgress
from impact_rig.nodes.campaigning.rig_watch import WORD_TIMEOUT, Obstacle, RigWatch
from impact_rig.nodes.rig_node import RigNode

ENABLE_PERIOD = 1.0
"""How soon a refused enable is asked for again [s], our choice."""


class Readiness:
    """Waits until the next hit can begin, and says what it waits for.

    Parameters
    ----------
    node : RigNode
        The campaign's; its parameter `pause_timeout` is read.
    watch : RigWatch
        What it hears of the rig.
    """

    def __init__(self, node: RigNode, watch: RigWatch) -> None:
        self._node = node
        self._watch = watch
        self._enable = node.create_client(Trigger, interfaces.ARM_HAMMER)
        self._disable = node.create_client(Trigger, interfaces.DISARM_HAMMER)

    async def enable(self) -> str:
        """Give the operator's enable to the hammer; return why that failed, empty: it is armed."""
        try:
            answer = await self._node.call(
                self._enable, Trigger.Request(), is_given_up=self._watch.has_gone
            )
        except DeviceError as error:
            return str(error)
        if not answer.success:
            return str(answer.message)
        await self._node.wait_until(self._is_armed, WORD_TIMEOUT)
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
            patience = self._find_patience(began, obstacle)
            if patience <= 0.0:
                raise DeviceError(
                    f"the pause took longer than {self._node.get_value('pause_timeout'):g} s:"
                    f" {progress.feedback.message}"
                )
            await self._wait_for_change(
                obstacle,
                progress,
                recording,
                min(ENABLE_PERIOD, patience) if obstacle.can_enable else patience,
            )
        if progress.feedback.phase != RunCampaign.Feedback.RUNNING:
            self._node.get_logger().info("the campaign goes on")
            progress.delay(time.monotonic() - began)
            progress.publish(phase=RunCampaign.Feedback.RUNNING, message="")

    def _find_obstacle(self, progress: CampaignProgress, recording: str) -> Obstacle | None:
        """Return what the next hit waits for; raise what ends the campaign."""
        progress.check_cancel()
        if end := self._watch.find_end_of_recording(recording):
            raise DeviceError(end)
        return self._watch.find_obstacle()

    async def _wait_for_change(
        self, obstacle: Obstacle, progress: CampaignProgress, recording: str, timeout: float
    ) -> None:
        await self._node.wait_until(
            lambda: (
                self._watch.find_obstacle() != obstacle
                or progress.is_cancelled
                or bool(self._watch.find_end_of_recording(recording))
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

    def _find_patience(self, began: float, obstacle: Obstacle) -> float:
        """Return how long an obstacle may still last [s]."""
        limit = float(self._node.get_value("pause_timeout"))
        if not limit or obstacle.phase != RunCampaign.Feedback.PAUSED:
            return math.inf
        return began + limit - time.monotonic()

    def _is_armed(self) -> bool:
        return self._watch.hammer is not None and self._watch.hammer.armed
