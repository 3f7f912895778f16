"""The hammer: holds it, and lets it go when the rest of the rig can record the hit."""

from typing import Any

from impact_rig_msgs.msg import (
    AcquisitionState,
    HammerRelease,
    HammerState,
    RecorderState,
    RecordStored,
)
from impact_rig_msgs.srv import Release
from std_srvs.srv import Trigger

from impact_rig.nodes import interfaces
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode

READINESS_TIMEOUT = 4.0
"""How long a release may wait for the word of accelerometers and recorder [s], our choice: their
states travel by other topics than the request, and one that was lost on its way comes again with
the next heartbeat, 3 s later at the latest."""
DISCOVERY_TIMEOUT = 10.0
"""The same while one of them has not been heard of at all, or the recorder still looks for its
topics [s], our choice: nodes that have just started take a while to find each other. And while the
record before is on its way to the disk: a busy one takes seconds."""


class HammerNode(RigNode):
    """Holds and releases the hammer; refuses, with a reason, what could not be recorded."""

    def __init__(self, **options: Any) -> None:
        super().__init__("hammer", **options)
        self.declare(
            "swing_time", 0.207, "time from release to contact [s]; the paper's 0.207",
            low=0.0, high=60.0,
        )  # fmt: skip
        self.declare("return_time", 0.0, "from contact back into the holder [s]", low=0.0, high=60)
        self.declare("require_recorder", True, "refuse to release while nothing is recorded")
        self._state = HammerState.HELD
        self._armed = False
        self._released: Release.Request | None = None
        self._acquisition: AcquisitionState | None = None
        self._recorder: RecorderState | None = None
        self._unstored = 0
        self._publish_state = self.advertise_state(interfaces.HAMMER_STATE)
        self._release = self.advertise(interfaces.RELEASE)
        self.listen(interfaces.ACQUISITION_STATE, self._keep_acquisition)
        self.listen(interfaces.RECORDER_STATE, self._keep_recorder)
        self.listen(interfaces.RECORD_STORED, self._note_stored)
        self.create_service(Trigger, interfaces.ARM_HAMMER, self._arm)
        self.create_service(Trigger, interfaces.DISARM_HAMMER, self._disarm)
        self.create_service(
            Release, interfaces.RELEASE_HAMMER, self._let_go, callback_group=self.waiting_group
        )

    def activate(self) -> None:
        """Say that the hammer is held and not armed."""
        self._change(HammerState.HELD, armed=False, message="held, not armed")

    def deactivate(self) -> None:
        """Take the operator's enable back."""
        if self.context.ok():
            self._change(self._state, armed=False, message="node inactive")

    def diagnose(self) -> dict[str, Any]:
        """Return what the hammer does."""
        return {"armed": self._armed, "held": self._state == HammerState.HELD}

    def _keep_acquisition(self, message: AcquisitionState) -> None:
        self._acquisition = message
        if message.state == AcquisitionState.ARMED:
            # A new arming: what looks like an earlier request is another one.
            self._released = None

    def _keep_recorder(self, message: RecorderState) -> None:
        previous, self._recorder = self._recorder, message
        if not message.recording or (previous and previous.uri != message.uri):
            # What one recording did not store, the next one will not.
            self._unstored = 0

    def _note_stored(self, message: RecordStored) -> None:
        if message.complete and message.record == self._unstored:
            self._unstored = 0

    def _change(self, state: int, *, armed: bool, message: str) -> None:
        self._state, self._armed = state, armed
        self._publish_state(state=state, armed=armed, message=message)

    def _arm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.is_active
        response.message = "armed" if self.is_active else "the hammer node is not active"
        if self.is_active:
            self._change(self._state, armed=True, message="armed by the operator")
        return response

    def _disarm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._change(self._state, armed=False, message="disarmed by the operator")
        response.success, response.message = True, "disarmed"
        return response

    async def _let_go(
        self, request: Release.Request, response: Release.Response
    ) -> Release.Response:
        if not self._find_own_obstacle():
            await self.wait_until(lambda: self._is_settled(request), DISCOVERY_TIMEOUT)
            await self.wait_until(lambda: not self._find_obstacle(request), READINESS_TIMEOUT)
        # The same request again: the hammer went, and the first answer was lost.
        if self._released != request:
            response.message = self._find_own_obstacle() or self._find_obstacle(request)
            if response.message:
                self.get_logger().warning(f"release refused: {response.message}")
                return response
            self._swing(request)
        response.success = True
        if self._recorder is not None and self._recorder.recording:
            response.recording = self._recorder.uri
        return response

    def _swing(self, request: Release.Request) -> None:
        self._released = request
        if self._recorder is not None and self._recorder.recording:
            self._unstored = request.record
        swing_time = float(self.get_value("swing_time"))
        release = HammerRelease(
            record=request.record,
            sample=request.sample,
            impact=request.impact,
            attempt=request.attempt,
            swing_time=swing_time,
        )
        release.header.stamp = self.get_clock().now().to_msg()
        self._change(HammerState.SWINGING, armed=self._armed, message="released")
        self._release.publish(release)
        self.run_once_after(swing_time + float(self.get_value("return_time")), self._catch)

    def _catch(self) -> None:
        self._change(HammerState.HELD, armed=self._armed, message="back in the holder")

    def _is_settled(self, request: Release.Request) -> bool:
        """Whether nodes that are just starting have found each other, and the disk is quiet."""
        if self._acquisition is None:
            return False
        if not self.get_value("require_recorder"):
            return True
        recorder = self._recorder
        return recorder is not None and not recorder.waiting and not self._is_unstored(request)

    def _is_unstored(self, request: Release.Request) -> bool:
        """Whether the record before this one is still on its way to the disk."""
        return self._unstored not in (0, request.record)

    def _find_own_obstacle(self) -> str:
        """Return why the hammer itself may not go now; empty: it may."""
        if not self.is_active:
            return "the hammer node is not active: activate it first"
        if not self._armed:
            return "the hammer is not armed: call hammer/arm first"
        if self._state != HammerState.HELD:
            return "the hammer is not in its holder: wait for the swing to end"
        return ""

    def _find_obstacle(self, request: Release.Request) -> str:
        """Return why the rest of the rig could not record the hit; empty: it could."""
        acquisition, recorder = self._acquisition, self._recorder
        if acquisition is None or acquisition.state != AcquisitionState.ARMED:
            return "the accelerometers are not armed: call accelerometer/arm first"
        if (acquisition.record, acquisition.sample) != (request.record, request.sample):
            return (
                f"the accelerometers are armed for record {acquisition.record} on"
                f" {acquisition.sample!r}, not for record {request.record} on"
                f" {request.sample!r}"
            )
        if self.get_value("require_recorder") and not (recorder and recorder.recording):
            why = recorder.message if recorder else "no recorder has reported"
            return f"nothing is being recorded ({why}): start the recorder first"
        if self.get_value("require_recorder") and self._is_unstored(request):
            return (
                f"the recorder has not said that record {self._unstored} is stored: wait for it,"
                " or start the recorder anew"
            )
        return ""


def main() -> int:
    """Run the node."""
    return run_node(HammerNode)


if __name__ == "__main__":
    raise SystemExit(main())
