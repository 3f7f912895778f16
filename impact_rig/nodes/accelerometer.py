"""The accelerometers: armed for one hit at a time, they stream it, or everything, as blocks."""

import math
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, AcquisitionState, HammerRelease, RigSetup
from impact_rig_msgs.srv import Arm
from std_srvs.srv import Trigger

from impact_rig.configuration.processes import CONTINUOUS
from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.setup import samples
from impact_rig.core.signals.record import HitLabel
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.acquisition.arming import Arming
from impact_rig.nodes.acquisition.block_output import BlockOutput
from impact_rig.nodes.acquisition.handover import Handover
from impact_rig.nodes.acquisition.offered_topic import OfferedTopic
from impact_rig.nodes.acquisition.open_source import OpenSource, open_source
from impact_rig.nodes.acquisition.source_thread import COMPLETE, SourceThread
from impact_rig.nodes.acquisition.stream_parameters import MODES, declare_stream
from impact_rig.nodes.acquisition.virtual_rig_parameters import declare_virtual_rig
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.process import run_node
from impact_rig.recording.interfaces.messages import setup_from_msg

CONNECTION_TIMEOUT = 10.0
"""How long arming may wait for estimator and recorder to connect [s], our choice."""
ENDING_TIMEOUT = 1.0
"""How long the source's thread may take to say what it has done [s], our choice: it does so at
once, unless the computer is busy."""
ARMING_TIMEOUT = 10.0
"""How long a device may take to arm [s], our choice: longer than any time-out of a driver."""


class AccelerometerNode(DeviceNode):
    """Streams what a source of accelerations delivers: of each arming a record, or all the time.

    The source is read in a thread of its own, which also publishes what comes; everything else
    happens in the executor.

    Each release gets exactly one verdict, whatever goes wrong meanwhile, unless somebody disarms
    or deactivates: see `HitBlocks` and `RunningStream`. When the device is lost the arming is
    over, the state is FAULT, and the node is unconfigured until the device is back; an arming
    whose hammer has not been let go leaves nothing behind. A release that was on its way while
    the device was lost is answered by a block that says that nothing came.

    In triggered mode a hit that nobody let go of, because someone has bumped the hammer, is
    published like any other and judged by the estimator; the state says so, and the arming is
    over: the hammer refuses to release for it.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("accelerometer", **options)
        declare_stream(self)
        declare_virtual_rig(self)
        self._handover = Handover(self)
        self._setup: samples.RigSetup | None = None
        self._open: OpenSource | None = None
        self._output: BlockOutput | None = None
        self._thread: SourceThread | None = None
        self._arming: Arming | None = None
        self._cut_off: Arming | None = None
        self._is_lost = False
        self._record = 0
        self._identity: dict[str, Any] = {}
        self._topic = OfferedTopic(self, self._take_hit)
        self._publish = self.advertise_state(interfaces.ACQUISITION_STATE)
        self._virtual_impact = self.advertise(interfaces.VIRTUAL_IMPACT)
        self.listen(interfaces.SETUP, self._take_setup)
        self.listen(interfaces.RELEASE, self._swing)
        self.create_service(
            Arm, interfaces.ARM_ACCELEROMETER, self._arm, callback_group=self.waiting_group
        )
        self.create_service(Trigger, interfaces.DISARM_ACCELEROMETER, self._disarm)

    # Lifecycle.

    def configure(self) -> None:
        """Open the source, and offer what the mode wants."""
        mode = self.get_value("mode")
        if mode not in MODES:
            raise DeviceError(f"mode is {mode!r}: it must be one of " + ", ".join(MODES))
        opened = open_source(self, continuous=mode == CONTINUOUS)
        self._open = opened
        self._identity = {
            "source": opened.acquisition.identity,
            "simulated": opened.simulated is not None,
        }
        self._is_lost = False
        self._topic.offer(opened.plan)
        self._output = opened.make_output(self._topic.publisher)
        if opened.simulated is not None and self._setup is not None:
            opened.simulated.take_setup(self._setup)

    def cleanup(self) -> None:
        """Let the source go."""
        if self._open is not None:
            self._open.source.close()
            self._open = None

    def activate(self) -> None:
        """Begin to read the source, and say that the accelerometers can be armed."""
        opened, output = self._open, self._output
        if opened is None or output is None:
            raise DeviceError("the accelerometer node is not configured: configure it first")
        if opened.plan.continuous:
            output.restart()
            opened.source.arm()
        hand_over = self._handover.hand_over
        self._thread = SourceThread(
            opened.source,
            output,
            is_continuous=opened.plan.continuous,
            patience=opened.plan.record_duration + float(self.get_value("trigger_timeout")),
            on_armed=lambda arming: hand_over(lambda: self._note_armed(arming)),
            on_ended=lambda arming, why: hand_over(lambda: self._note_ended(arming, why)),
            on_failed=lambda error: hand_over(lambda: self._lose(opened, error)),
        )
        self._thread.start()
        self._tell(AcquisitionState.IDLE, "ready")

    def deactivate(self) -> None:
        """Disarm, and read no more."""
        thread, self._thread = self._thread, None
        if thread is not None and not thread.stop():
            self.get_logger().error("the source's driver does not come back from what it does")
        self._end_arming()
        if self.context.ok() and not self._is_lost:
            self._tell(AcquisitionState.IDLE, "node inactive")

    def publish_fault(self, text: str) -> None:
        """Say on the node's state topic that the source is lost, and why."""
        self._tell(AcquisitionState.FAULT, text)

    def find_warning(self) -> str:
        """Return what has been lost since this was asked last."""
        return self._output.find_warning() if self._output else ""

    def diagnose(self) -> dict[str, Any]:
        """Return what is read, and how much has been streamed."""
        return {
            "source": self._identity.get("source", ""),
            "record": self._record,
            "armed": self._arming is not None,
            **(self._output.describe() if self._output else {}),
            "subscribers": self._topic.count_subscribers(),
        }

    # The course of an arming.

    def _take_setup(self, message: RigSetup) -> None:
        self._setup = setup_from_msg(message)
        if self._open is not None and self._open.simulated is not None:
            self._open.simulated.take_setup(self._setup)

    async def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        await self.wait_until(
            lambda: (
                not self.is_active or bool(self._setup and not self._find_missing_subscribers())
            ),
            CONNECTION_TIMEOUT,
        )
        # The verdict on a hit may be faster than the word of its end from the source's thread.
        await self.wait_until(
            lambda: self._arming is None or not self._arming.is_read, ENDING_TIMEOUT
        )
        label = HitLabel(request.sample, self._record + 1, request.impact, request.attempt)
        arming = self._arming
        # The same request again: its first answer was lost.
        if arming is None or not arming.is_for(label):
            response.message = self._find_obstacle(label)
            if response.message or self._thread is None:
                return response
            arming = Arming(label)
            self._arming, self._record, self._cut_off = arming, label.record, None
            self._thread.arm(arming)
        await self.wait_until(lambda: arming.is_armed or arming.is_over, ARMING_TIMEOUT)
        response.success, response.record = arming.is_armed, arming.label.record
        if not arming.is_armed:
            response.message = self.fault or "the source was disarmed, or did not answer, in time"
        return response

    def _find_obstacle(self, label: HitLabel) -> str:
        """Return why the accelerometers may not be armed; empty: they may."""
        if not self.is_active:
            why = self.fault or "activate it first"
            return f"the accelerometer node is not active: {why}"
        if self._arming is not None:
            return f"already armed for record {self._arming.label.record}: disarm first"
        if self._setup is None:
            return "no set-up has been received: start the campaign node first"
        if missing := self._find_missing_subscribers():
            return f"{missing}: start it first, or change the parameter required_subscribers"
        try:
            self._setup.samples.find(label.sample)
            if self._open is not None and self._open.simulated is not None:
                self._open.simulated.check_sample(label.sample)
        except RigError as error:
            return str(error)
        return ""

    def _find_missing_subscribers(self) -> str:
        return self._topic.find_missing(self.get_value("required_subscribers"))

    def _note_armed(self, arming: Arming) -> None:
        if arming.is_over:
            return
        arming.is_armed = True
        self._tell(AcquisitionState.ARMED, "waiting for the trigger", arming.label.sample)

    def _swing(self, message: HammerRelease) -> None:
        # Started anew in the middle of a campaign: numbers go on where they were.
        self._record = max(self._record, message.record)
        arming, opened = self._arming, self._open
        if arming is None or opened is None or message.record != arming.label.record:
            self._answer_late(message.record)
            return
        if not arming.is_armed or arming.is_released:
            return
        by_hand = message.latest_contact
        swing = by_hand if math.isfinite(by_hand) and by_hand > 0.0 else message.swing_time
        timeout = float(self.get_value("trigger_timeout"))
        arming.release(swing + timeout + opened.plan.record_duration)
        if opened.simulated is None:
            return
        hit = opened.simulated.strike(arming.label, message.swing_time)
        if hit is not None:
            truth = messages.virtual_hit_to_msg(hit, message.header.stamp)
            self._virtual_impact.publish(truth)

    def _answer_late(self, record: int) -> None:
        """Say that nothing came of an arming that was cut off before its release was heard of."""
        cut_off, output = self._cut_off, self._output
        if cut_off is None or output is None or cut_off.label.record != record:
            return
        self._cut_off = None
        output.begin(cut_off.label)
        output.end(is_awaited=True)

    def _take_hit(self, message: AccelerationBlock) -> None:
        """End the arming when its impact has been found in the running stream."""
        arming = self._arming
        if arming is not None and message.record == arming.label.record and message.last:
            self._end_arming()
            self._tell(AcquisitionState.IDLE, COMPLETE)

    def _note_ended(self, arming: Arming, why: str) -> None:
        if self._arming is arming:
            arming.is_over, self._arming = True, None
            self._tell(AcquisitionState.IDLE, why)

    def _disarm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._end_arming()
        if self.is_active:
            self._tell(AcquisitionState.IDLE, "disarmed by the operator")
        response.success, response.message = True, "disarmed"
        return response

    def _end_arming(self) -> None:
        arming, self._arming = self._arming, None
        if arming is not None:
            arming.is_over = True
            if self._thread is not None:
                self._thread.end(arming)

    def _lose(self, opened: OpenSource, error: RigError) -> None:
        if self._open is not opened:
            return
        arming = self._arming
        # Here, where releases are heard of, it is known whether somebody waits for a verdict.
        is_awaited = arming is not None and arming.is_released
        is_closed = False
        if self._output is not None:
            is_closed = self._output.end(is_awaited=is_awaited)
            self._output.finish()
        self._cut_off = None if is_closed else arming
        self._is_lost = True
        self.lose_device(error)

    def _tell(self, state: int, message: str, sample: str = "") -> None:
        missing = self._output.flow.missing_points if self._output else 0
        loss = f"; {missing} points of the source were lost so far" if missing else ""
        self._publish(
            state=state,
            record=self._record,
            sample=sample,
            message=message + loss,
            **self._identity,
        )


def main() -> int:
    """Run the node."""
    return run_node(AccelerometerNode)


if __name__ == "__main__":
    raise SystemExit(main())
