"""The accelerometers: armed for one hit at a time, they stream it, or everything, as blocks."""

import functools
import time
from dataclasses import replace
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, AcquisitionState, HammerRelease, RigSetup
from impact_rig_msgs.srv import Arm
from std_srvs.srv import Trigger

from impact_rig.configuration.processes import CONTINUOUS
from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.acquisition.running_stream import RunningStream
from impact_rig.nodes.acquisition.virtual_rig_parameters import (
    declare_virtual_rig,
    read_virtual_rig,
)
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recording.interfaces.messages import setup_from_msg

CONNECTION_TIMEOUT = 10.0
"""How long arming may wait for estimator and recorder to connect [s], our choice."""
TRIGGERED = "triggered"
MODES = (TRIGGERED, CONTINUOUS)
"""Each hit's record, as a trigger cuts it out; or all that comes, in which the estimator finds the
impacts."""


class AccelerometerNode(RigNode):
    """Streams what the virtual rig's accelerometers see: after each release, or all the time."""

    def __init__(self, **options: Any) -> None:
        super().__init__("accelerometer", **options)
        self._declare_stream()
        declare_virtual_rig(self)
        self._rig_settings = VirtualRigSettings()
        self._rig: VirtualRig | None = None
        self._label: HitLabel | None = None
        self._struck = False
        self._record = 0
        self._blocks_sent = 0
        self._publisher: Any = None
        self._hits: Any = None
        self._stream: RunningStream | None = None
        self._dropped_before = 0
        self._publish_state = functools.partial(
            self.advertise_state(interfaces.ACQUISITION_STATE), source=interfaces.VIRTUAL_SOURCE
        )
        self._virtual_impact = self.advertise(interfaces.VIRTUAL_IMPACT)
        self.listen(interfaces.SETUP, self._take_setup)
        self.listen(interfaces.RELEASE, self._swing)
        self.create_service(
            Arm, interfaces.ARM_ACCELEROMETER, self._arm, callback_group=self.waiting_group
        )
        self.create_service(Trigger, interfaces.DISARM_ACCELEROMETER, self._disarm)

    def _declare_stream(self) -> None:
        self.declare(
            "mode", TRIGGERED,
            f"{TRIGGERED}: blocks of each hit, on `acceleration`; {CONTINUOUS}: blocks of all that"
            " comes, on `acceleration/stream`, in which the estimator finds the impacts",
        )  # fmt: skip
        self.declare("block_size", 1000, "points per block of a hit [-]", low=1, high=10_000_000)
        self.declare(
            "stream_block_size", 25_000, "points per block of the running stream [-]",
            low=1, high=10_000_000,
        )  # fmt: skip
        self.declare(
            "stream_depth", interfaces.STREAM_DEPTH,
            "blocks of the running stream that may wait before the oldest are lost [-]",
            low=1, high=100_000,
        )  # fmt: skip
        self.declare(
            "required_subscribers", "estimator, recorder",
            "nodes of this namespace, by commas, that must be connected to `acceleration` before"
            " a release",
        )  # fmt: skip
        self.declare(
            "trigger_timeout", 0.5, "how long after the expected contact a trigger may come [s]",
            low=0.0, high=60.0,
        )  # fmt: skip

    def configure(self) -> None:
        """Read how the virtual rig behaves, and offer what the mode wants."""
        mode = self.get_value("mode")
        if mode not in MODES:
            raise DeviceError(f"mode is {mode!r}: it must be one of " + ", ".join(MODES))
        self._rig_settings = read_virtual_rig(self)
        if self._rig is not None:
            self._rig = VirtualRig(self._rig.setup, self._rig_settings)
        if mode == CONTINUOUS:
            topic = interfaces.make_stream_topic(self.get_value("stream_depth"))
            self._publisher = self.advertise(topic)
            self._hits = self.listen(interfaces.ACCELERATION, self._take_hit)
        else:
            self._publisher = self.advertise(interfaces.ACCELERATION)

    def cleanup(self) -> None:
        """Take back what the mode wanted."""
        self.destroy_publisher(self._publisher)
        if self._hits is not None:
            self.destroy_subscription(self._hits)
        self._publisher = self._hits = None

    def activate(self) -> None:
        """Begin the running stream, and say that the accelerometers can be armed."""
        if self.get_value("mode") == CONTINUOUS:
            self._dropped_before = 0
            self._stream = RunningStream(
                self,
                self._publisher,
                self._rig_settings,
                self.get_value("stream_block_size"),
                self.get_value("stream_depth"),
            )
        self._finish("ready")

    def deactivate(self) -> None:
        """Disarm, and end the running stream."""
        if self._stream is not None:
            self._stream.stop()
            self._stream = None
        if self.context.ok():
            self._finish("node inactive")

    def find_warning(self) -> str:
        """Return what the running stream has lost since this was asked last."""
        dropped = self._stream.dropped if self._stream else 0
        lost, self._dropped_before = dropped - self._dropped_before, dropped
        if not lost:
            return ""
        return f"{lost} blocks of the stream were lost: this computer does not hold its rate"

    def diagnose(self) -> dict[str, Any]:
        """Return how much has been streamed."""
        flow = self._stream.describe() if self._stream else {"blocks sent": self._blocks_sent}
        subscribers = self._publisher.get_subscription_count() if self._publisher else 0
        return {
            "record": self._record,
            "armed": self._label is not None,
            **flow,
            "subscribers": subscribers,
        }

    def _take_setup(self, message: RigSetup) -> None:
        self._rig = VirtualRig(setup_from_msg(message), self._rig_settings)

    async def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        await self.wait_until(
            lambda: bool(self._rig) and not self._find_missing_subscribers(), CONNECTION_TIMEOUT
        )
        label = HitLabel(
            sample=request.sample,
            record=self._record + 1,
            impact=request.impact,
            attempt=request.attempt,
        )
        armed = self._label
        if armed is not None and not self._struck and armed == replace(label, record=armed.record):
            # The same request again: its first answer was lost.
            response.success, response.record = True, armed.record
            return response
        response.message = self._find_obstacle(label)
        response.success = not response.message
        if response.success:
            self._label, self._struck = label, False
            self._record = response.record = label.record
            if self._stream is not None:
                self._stream.label = label
            self._publish_state(
                state=AcquisitionState.ARMED,
                record=label.record,
                sample=label.sample,
                message="waiting for the trigger" + self._tell_loss(),
            )
        return response

    def _find_obstacle(self, label: HitLabel) -> str:
        """Return why the accelerometers may not be armed; empty: they may."""
        if not self.is_active:
            return "the accelerometer node is not active: activate it first"
        if self._label is not None:
            return f"already armed for record {self._label.record}: disarm first"
        if self._rig is None:
            return "no set-up has been received: start the campaign node first"
        if missing := self._find_missing_subscribers():
            return f"{missing}: start it first, or change the parameter required_subscribers"
        try:
            self._rig.check_sample(label.sample)
        except RigError as error:
            return str(error)
        return ""

    def _find_missing_subscribers(self) -> str:
        required = self.get_value("required_subscribers")
        if self._stream is None:
            return self.find_missing_subscribers(self._publisher, required)
        hits, stream = interfaces.ACCELERATION.name, self._publisher.topic_name
        if not self.count_publishers(hits):
            return f"nobody finds impacts in {stream}"
        return self.find_missing_listeners(
            self.resolve_topic_name(hits), required
        ) or self.find_missing_subscribers(self._publisher, "")

    def _disarm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._finish("disarmed by the operator")
        response.success, response.message = True, "disarmed"
        return response

    def _swing(self, message: HammerRelease) -> None:
        label = self._label
        if not self.is_active or self._rig is None or label is None:
            return
        if message.record != label.record or self._struck:
            return
        self._struck = True
        released = time.monotonic()
        hit = self._rig.strike(label)
        self._virtual_impact.publish(messages.virtual_hit_to_msg(hit, message.header.stamp))
        timeout = float(self.get_value("trigger_timeout"))
        # While the simulation works the hammer is on its way.
        if self._stream is not None:
            swing = max(message.swing_time - (time.monotonic() - released), 0.0)
            self._stream.lay(hit, swing)
            self.run_once_after(swing + timeout, lambda: self._give_up(label))
            return
        is_missed = Fault.MISSED_TRIGGER in hit.faults
        wait = message.swing_time + (timeout if is_missed else 0.0)
        blocks = self._prepare(hit, wait - (time.monotonic() - released))
        left = max(wait - (time.monotonic() - released), 0.0)
        self.run_once_after(left, lambda: self._send(label, blocks))

    def _prepare(self, hit: VirtualHit, wait: float) -> list[AccelerationBlock]:
        """Return the messages of a hit that comes `wait` seconds from now."""
        stamp = self.get_clock().now().nanoseconds + round(max(wait, 0.0) * 1e9)
        blocks = hit.split(int(self.get_value("block_size")), stamp)
        return [messages.block_to_msg(block) for block in blocks]

    def _send(self, label: HitLabel, blocks: list[AccelerationBlock]) -> None:
        if self._label != label:
            return
        for block in blocks:
            self._publisher.publish(block)
            self._blocks_sent += 1
        self._finish("record complete")

    def _take_hit(self, message: AccelerationBlock) -> None:
        """End the arming when its impact has been found in the running stream."""
        if self._label is not None and message.record == self._label.record and message.last:
            self._finish("record complete")

    def _give_up(self, label: HitLabel) -> None:
        if self._label == label and self._stream is not None:
            self._stream.end_arming()
            self._finish("no impact came in time")

    def _finish(self, message: str) -> None:
        self._label = None
        if self._stream is not None:
            self._stream.label = NOT_ARMED
        self._publish_state(
            state=AcquisitionState.IDLE, record=self._record, message=message + self._tell_loss()
        )

    def _tell_loss(self) -> str:
        """Return what the running stream has lost so far, to be added to a state."""
        dropped = self._stream.dropped if self._stream else 0
        return f"; {dropped} blocks of the stream were lost so far" if dropped else ""


def main() -> int:
    """Run the node."""
    return run_node(AccelerometerNode)


if __name__ == "__main__":
    raise SystemExit(main())
