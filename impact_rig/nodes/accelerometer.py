"""The accelerometers: armed for one hit at a time, they stream it, or everything, as blocks."""

from dataclasses import replace
from typing import Any

from impact_rig_msgs.msg import HammerRelease, InputLevels
from impact_rig_msgs.srv import Arm, JoinCampaign
from std_srvs.srv import SetBool

from impact_rig.configuration.parameters import CONTINUOUS
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.setup import RigSetup
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.accelerometer_source import (
    COMPLETE,
    Arming,
    OpenSource,
    SourceThread,
    open_source,
)
from impact_rig.nodes.acts import BEAT
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.identity import id_from_msg, id_to_msg, make_id
from impact_rig.nodes.intake import Received
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, Answer
from impact_rig.recordings.fields import NO_ID, fill_message
from impact_rig.status.states import HammerPlace, HammerStatus, Phase

LEVELS_PERIOD = 0.2
"""How often the levels of the inputs are published [s]."""
MONITORING = "the inputs are shown"


class AccelerometerNode(DeviceNode):
    """Streams a source's accelerations: one record for each arming, or all the time.

    A separate thread reads the source and publishes the blocks; everything else
    happens in the executor.

    Each release gets one verdict, see `SourceThread`. When the device is lost the arming is over,
    the state is FAULT, and the node is unconfigured until the device is back.

    In triggered mode a hit without a release, because someone has bumped the hammer, is published
    like any other and judged by the estimator; the state says so, and the arming is over: the
    hammer refuses to release for it.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("accelerometer", **options)
        self._setup: RigSetup | None = None
        self._open: OpenSource | None = None
        self._thread: SourceThread | None = None
        self._arming: Arming | None = None
        self._record = 0
        self._hammer = HammerStatus(armed=True)
        self._stream_id = NO_ID
        self._is_continuous = self.get_value("mode") == CONTINUOUS
        self._is_monitoring = False
        self._blocks = self.advertise(
            interfaces.STREAM if self._is_continuous else interfaces.ACCELERATION
        )
        if self._is_continuous:
            self.listen(interfaces.ACCELERATION, self._on_hit)
        self._publish_state = self.advertise_state(interfaces.ACQUISITION_STATE)
        self._virtual_impact = self.advertise(interfaces.VIRTUAL_IMPACT)
        self._levels = self.advertise(interfaces.INPUT_LEVELS)
        self.create_timer(LEVELS_PERIOD, self._publish_levels)
        # The hammer's state is not believed if somebody else speaks on its topic.
        self.create_timer(BEAT, self._check_enable)
        self.listen(interfaces.SETUP, self._on_setup)
        self.listen(interfaces.RELEASE, self._on_release)
        self.listen(interfaces.HAMMER_STATE, self._on_hammer_state)
        self.create_service(Arm, interfaces.ARM_ACCELEROMETER, self._on_arm)
        self.offer(interfaces.DISARM_ACCELEROMETER, self._disarm)
        self.create_service(SetBool, interfaces.MONITOR_INPUT, self._on_monitor)
        self.offer_to_join()

    # Lifecycle.

    def configure(self) -> None:
        """Open the source."""
        super().configure()
        self._open = open_source(self, continuous=self._is_continuous or self._is_monitoring)
        self._use_setup(self._setup)

    def cleanup(self) -> None:
        """Close the source."""
        if self._open is not None:
            self._open.source.close()
            self._open = None

    def activate(self) -> None:
        """Begin to read the source; the accelerometers can be armed."""
        opened = self._open
        if opened is None:
            raise DeviceError("the accelerometer node is not configured: configure it first")
        self._stream_id = make_id()
        self._use_stream()
        if opened.plan.continuous:
            opened.source.arm()
        self._thread = SourceThread(
            opened,
            None if self._is_monitoring else self._blocks,
            self.membership,
            patience=opened.plan.record_duration + float(self.get_value("trigger_timeout")),
            check_period=DIAGNOSTIC_PERIOD / self.pace,
            on_ended=lambda arming, why: self.run_soon(lambda: self._on_ended(arming, why)),
            on_failed=lambda error: self.run_soon(lambda: self._on_failed(opened, error)),
        )
        self._thread.start()
        self._publish(Phase.IDLE, MONITORING if self._is_monitoring else "ready")

    def deactivate(self) -> None:
        """Disarm, and read no more."""
        thread, self._thread, self._arming = self._thread, None, None
        if thread is not None and not thread.stop():
            self.get_logger().error("the source's driver does not return from a call")
        if self.context.ok():
            self._publish(Phase.IDLE, "node inactive")

    def publish_fault(self, text: str) -> None:
        """Publish in the node's state that the source is lost, and why."""
        self._publish(Phase.FAULT, text)

    def describe_warning(self) -> str | None:
        """Return how many points were lost since the node was activated."""
        lost = self._thread.flow.missing_points if self._thread else 0
        if not lost:
            return None
        return f"{lost} points of the source were lost: this computer does not hold its rate"

    def diagnose(self) -> dict[str, Any]:
        """Return how much was streamed, and to how many."""
        figures = {"subscribers": self._blocks.get_subscription_count()}
        if self._thread is not None:
            flow = self._thread.flow
            sent = {"blocks sent": flow.blocks, "points sent": flow.points}
            figures |= {**sent, "points lost": flow.missing_points}
        return figures

    # Campaign and set-up.

    def join(
        self, setup: RigSetup, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> None:
        """Take part in a campaign: blocks from now on carry its id."""
        if self._is_monitoring:
            self._reopen(is_monitoring=False)
        self._use_stream()
        response.stream_id = id_to_msg(self._stream_id)
        self._use_setup(setup)

    def _use_stream(self) -> None:
        identity = self.membership.identity
        self.membership.identity = replace(identity, stream_id=self._stream_id)

    def _on_setup(self, received: Received[RigSetup]) -> None:
        """Use set-ups without a campaign, until one has asked this node to join."""
        if not self.membership.is_joined:
            self._use_setup(received.value)

    def _use_setup(self, setup: RigSetup | None) -> None:
        self._setup = setup
        if setup is not None and self._open is not None and self._open.hammerless:
            self._open.hammerless.take_setup(setup)

    # The input monitor.

    def _on_monitor(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        """Begin or end the input monitor; a running stream has its levels anyway."""
        response.success = self._is_continuous or request.data == self._is_monitoring
        if response.success:
            return response
        if not self.is_active or self._is_bound or self._arming is not None:
            why = self.fault or "a campaign is under way, or a hit is awaited"
            response.message = f"the inputs cannot be shown: {why}"
            return response
        try:
            self._reopen(is_monitoring=request.data)
        except RigError as error:
            response.message = str(error)
        response.success = not response.message
        return response

    def _reopen(self, *, is_monitoring: bool) -> None:
        """Open the source again, for the monitor as a running stream that is not published.

        Raises
        ------
        RigError
            If the device cannot stream, and waits for hits as before; or if it is lost.
        """
        self.deactivate()
        self.cleanup()
        self._is_monitoring = is_monitoring
        try:
            self.configure()
            self.activate()
        except RigError as error:
            if is_monitoring:
                self._reopen(is_monitoring=False)
            else:
                self.lose_device(error)
            raise
        if not is_monitoring:
            self._levels.publish(InputLevels())

    def _publish_levels(self) -> None:
        if self._thread is None or not (self._is_continuous or self._is_monitoring):
            return
        levels = self._thread.levels.read()
        if levels.channels and self._levels.get_subscription_count():
            message = fill_message(InputLevels(), levels, messages.make_message)
            message.header.stamp = self.get_clock().now().to_msg()
            self._levels.publish(message)

    # The course of an arming.

    def _on_arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        if id_from_msg(request.campaign_id) != self.membership.identity.campaign_id:
            response.message = "the accelerometers take part in another campaign"
            return response
        # A node that is started in the middle of a campaign goes on with its numbers.
        self._record = max(self._record, request.after)
        label = HitLabel(request.sample, self._record + 1, request.impact, request.attempt)
        arming = self._arming
        # The same request again: its first answer was "not yet", or was lost.
        if (
            arming is None
            or arming.is_released
            or arming.label != replace(label, record=arming.label.record)
        ):
            response.message = self._describe_obstacle(label) or ""
            if response.message or self._thread is None:
                return response
            if delay := self._describe_delay():
                response.message, response.later = delay, True
                return response
            arming = self._arming = Arming(label)
            self._record = label.record
            self._thread.arm(arming)
        # A fast device is armed in one request, and nothing else of the node waits for long.
        response.success, response.record = arming.armed.wait(0.05), arming.label.record
        if response.success:
            self._publish(Phase.ARMED, "waiting for the trigger", label.sample)
        else:
            response.message, response.later = "the source is being armed", True
        return response

    def _describe_delay(self) -> str | None:
        """Return why arming must wait for a moment; None: it need not."""
        if self._arming is not None:
            return f"record {self._arming.label.record} has not ended"
        if self._setup is None:
            return "no set-up has been received: start the campaign node first"
        hits, blocks = interfaces.ACCELERATION.name, self._blocks
        if self._is_continuous and not self.count_publishers(hits):
            return f"no node finds impacts in {blocks.topic_name}: start the estimator"
        topic = self.resolve_topic_name(hits)
        listeners = ("estimator", "recorder") if self.membership.is_joined else ()
        if name := self.find_missing_subscriber(topic, listeners):
            return f"the node {name!r} does not listen to {topic}: start it first"
        if not self.is_connected(blocks):
            return f"a subscriber of {blocks.topic_name} is still connecting"
        return None

    def _describe_obstacle(self, label: HitLabel) -> str | None:
        """Return why the accelerometers may not be armed, now or soon."""
        if not self.is_active:
            why = self.fault or "activate it first"
            return f"the accelerometer node is not active: {why}"
        if self._is_monitoring:
            return "the input monitor runs: end it first"
        if self._arming is not None and not self._arming.is_released:
            return f"already armed for record {self._arming.label.record}: disarm first"
        if self._setup is None:
            return None
        try:
            self._setup.samples.find(label.sample)
            if self._open is not None and self._open.hammerless is not None:
                self._open.hammerless.check_sample(label.sample)
        except RigError as error:
            return str(error)
        return None

    def _on_release(self, received: Received[HammerRelease]) -> None:
        message = received.value
        arming, opened = self._arming, self._open
        if arming is None or opened is None or message.record != arming.label.record:
            return
        if not arming.armed.is_set() or arming.is_released:
            return
        swing = message.latest_contact or message.swing_time
        timeout = float(self.get_value("trigger_timeout"))
        arming.is_released = True
        if opened.hammerless is not None:
            hit = opened.hammerless.strike(arming.label, message.swing_time)
            if hit is not None:
                truth = messages.virtual_hit_to_msg(
                    hit, message.header.stamp, self.membership.identity
                )
                self._virtual_impact.publish(truth)
        # After the computation of a simulated hit, which takes its time.
        arming.release(swing + timeout + opened.plan.record_duration)
        self._check_enable()

    def _on_hammer_state(self, received: Received[HammerStatus]) -> None:
        self._hammer = received.value
        self._check_enable()

    def _check_enable(self) -> None:
        """End the record of a swing if the hammer is disarmed, or somebody else speaks in the rig.

        Its hit does not count.
        """
        arming, hammer = self._arming, self._hammer
        if arming is None or not arming.is_released or self._thread is None:
            return
        why = self.intake.find_any_stranger()
        if not hammer.armed and hammer.state in (HammerPlace.SWINGING, HammerPlace.FAULT):
            why = hammer.message
        if why is not None:
            self._thread.withdraw(arming, why)

    def _on_hit(self, received: Received[Block]) -> None:
        """End the arming when its impact has been found in the running stream."""
        arming, block = self._arming, received.value
        if arming is not None and block.label.record == arming.label.record and block.last:
            self._end_arming(is_judged=True)
            self._publish(Phase.IDLE, COMPLETE)

    def _on_ended(self, arming: Arming, why: str) -> None:
        if self._arming is arming:
            self._arming = None
            self._publish(Phase.IDLE, why)

    def _disarm(self) -> Answer:
        self._end_arming()
        if self.is_active:
            self._publish(Phase.IDLE, "disarmed by the operator")
        return True, "disarmed"

    def _end_arming(self, *, is_judged: bool = False) -> None:
        arming, self._arming = self._arming, None
        if arming is not None and self._thread is not None:
            self._thread.end(arming, is_judged=is_judged)

    def _on_failed(self, opened: OpenSource, error: RigError) -> None:
        if self._open is opened:
            self.lose_device(error)

    def _publish(self, state: Phase, message: str, sample: str = "") -> None:
        missing = self._thread.flow.missing_points if self._thread else 0
        loss = f"; {missing} points of the source were lost so far" if missing else ""
        fields: dict[str, Any] = {}
        if self._open is not None:
            fields["source"] = self._open.acquisition.identity
            fields["hammerless"] = self._open.hammerless is not None
        self._publish_state(
            state=state, record=self._record, sample=sample, message=message + loss, **fields
        )
