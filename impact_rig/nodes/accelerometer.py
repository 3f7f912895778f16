"""The accelerometers: armed for one hit at a time, they stream it, or everything, as blocks."""

import math
from collections.abc import Callable
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, AcquisitionState, HammerRelease, RigSetup
from impact_rig_msgs.srv import Arm, JoinCampaign
from std_srvs.srv import Trigger

from impact_rig.configuration.processes import CONTINUOUS
from impact_rig.core import setup
from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.records import HitLabel
from impact_rig.devices.protocols import AcquisitionPlan
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.accelerometer_source import (
    COMPLETE,
    Arming,
    BlockOutput,
    OpenSource,
    SourceThread,
    open_source,
)
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.identity import Identity, id_from_msg, id_to_msg, make_id
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.messages import NO_ID, setup_from_msg

TRIGGERED = "triggered"
MODES = (TRIGGERED, CONTINUOUS)
"""Each hit's record, as a trigger cuts it out; or all that comes, in which the estimator finds the
impacts."""


def declare_stream(node: RigNode) -> None:
    """Declare source, mode, blocks, and what an arming waits for."""
    node.declare(
        "source", "", "lines of TOML that go before the rig file's table [source]: seed = 7"
    )
    node.declare(
        "mode", TRIGGERED,
        f"{TRIGGERED}: blocks of each hit, on `acceleration`; {CONTINUOUS}: blocks of all that"
        " comes, on `acceleration/stream`, in which the estimator finds the impacts",
        choices=MODES,
    )  # fmt: skip
    node.declare("block_size", 1000, "points per block of a hit [-]", low=1, high=10_000_000)
    node.declare(
        "stream_block_size", 25_000, "points per block of the running stream [-]",
        low=1, high=10_000_000,
    )  # fmt: skip
    node.declare(
        "stream_depth", interfaces.STREAM_DEPTH,
        "blocks of the running stream that may wait before the oldest are lost [-]",
        low=1, high=100_000,
    )  # fmt: skip
    node.declare(
        "required_subscribers", "estimator, recorder",
        "nodes of this namespace, by commas, that must be connected to `acceleration` before"
        " a release", live=True,
    )  # fmt: skip
    node.declare(
        "trigger_timeout", 0.5,
        "how long after the latest contact a trigger may come, and how long the rest of a record"
        " may take from block to block [s]", low=0.0, high=60.0,
    )  # fmt: skip


class OfferedTopic:
    """The topic that the mode wants, from the first configuration on.

    It stays when the node is unconfigured, so that what was published last reaches everybody, and
    nobody must be met anew when a lost device is back.

    Parameters
    ----------
    node : RigNode
        The accelerometers'.
    take_hit : callable
        Called with each block that is found in a running stream.
    """

    def __init__(self, node: RigNode, take_hit: Callable[[AccelerationBlock], None]) -> None:
        self.publisher: Any = None
        self._node = node
        self._take_hit = take_hit
        self._topic: interfaces.Topic | None = None
        self._hits: Any = None

    def offer(self, plan: AcquisitionPlan) -> None:
        """Offer what a plan wants, if that is something else than before."""
        topic = interfaces.ACCELERATION
        if plan.continuous:
            topic = interfaces.make_stream_topic(plan.depth)
        if topic == self._topic:
            return
        if self.publisher is not None:
            self._node.destroy_publisher(self.publisher)
        if self._hits is not None:
            self._node.destroy_subscription(self._hits)
            self._hits = None
        self._topic, self.publisher = topic, self._node.advertise(topic)
        if plan.continuous:
            self._hits = self._node.listen(interfaces.ACCELERATION, self._take_hit)

    def count_subscribers(self) -> int:
        """Return how many are connected."""
        return self.publisher.get_subscription_count() if self.publisher else 0

    def describe_missing(self, required: str) -> str:
        """Return which of the required nodes, named by commas, would miss a hit."""
        if self.publisher is None:
            return "nothing is offered yet"
        hits = interfaces.ACCELERATION.name
        if self._hits is not None and not self._node.count_publishers(hits):
            return f"nobody finds impacts in {self.publisher.topic_name}"
        topic = self._node.resolve_topic_name(hits)
        if name := self._node.find_missing_subscriber(topic, required):
            return f"the node {name!r} does not listen to {topic}"
        if not self._node.is_connected(self.publisher):
            return f"a subscriber of {self.publisher.topic_name} is still connecting"
        return ""


ARMING_PAUSE = 0.05
"""How long an answer waits for the source to arm before it is "not yet" [s], our choice: a fast
device is armed in one request, and nothing else of the node waits for long."""


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
        self._setup: setup.RigSetup | None = None
        self._open: OpenSource | None = None
        self._output: BlockOutput | None = None
        self._thread: SourceThread | None = None
        self._arming: Arming | None = None
        self._cut_off: Arming | None = None
        self._is_lost = False
        self._record = 0
        self._stream_id = NO_ID
        self._identity: dict[str, Any] = {}
        self._topic = OfferedTopic(self, self._take_hit)
        self._publish = self.advertise_state(interfaces.ACQUISITION_STATE)
        self._virtual_impact = self.advertise(interfaces.VIRTUAL_IMPACT)
        self.listen(interfaces.SETUP, self._on_setup)
        self.listen(interfaces.RELEASE, self._swing)
        self.create_service(Arm, interfaces.ARM_ACCELEROMETER, self._arm)
        self.create_service(Trigger, interfaces.DISARM_ACCELEROMETER, self._disarm)
        self.offer_to_join()

    # Lifecycle.

    def configure(self) -> None:
        """Open the source, and offer what the mode wants."""
        super().configure()
        opened = open_source(self, continuous=self.get_value("mode") == CONTINUOUS)
        self._open = opened
        self._identity = {
            "source": opened.acquisition.identity,
            "hammerless": opened.hammerless is not None,
        }
        self._is_lost = False
        self._topic.offer(opened.plan)
        self._output = opened.make_output(self._topic.publisher, self.membership)
        if opened.hammerless is not None and self._setup is not None:
            opened.hammerless.take_setup(self._setup)

    def cleanup(self) -> None:
        """Let the source go."""
        if self._open is not None:
            self._open.source.close()
            self._open = None

    def activate(self) -> None:
        """Begin to read the source, and say that the accelerometers can be armed."""
        opened, output = self._open, self._output
        self._stream_id = make_id()
        self._use_stream()
        if opened is None or output is None:
            raise DeviceError("the accelerometer node is not configured: configure it first")
        if opened.plan.continuous:
            output.restart()
            opened.source.arm()
        self._thread = SourceThread(
            opened.source,
            output,
            is_continuous=opened.plan.continuous,
            patience=opened.plan.record_duration + float(self.get_value("trigger_timeout")),
            on_armed=lambda arming: self.run_soon(lambda: self._note_armed(arming)),
            on_ended=lambda arming, why: self.run_soon(lambda: self._note_ended(arming, why)),
            on_failed=lambda error: self.run_soon(lambda: self._lose(opened, error)),
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

    def describe_warning(self) -> str:
        """Return what has been lost since this was asked last."""
        return self._output.describe_warning() if self._output else ""

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

    def join(self, request: JoinCampaign.Request, response: JoinCampaign.Response) -> str:
        """Take part in a campaign: what is streamed from now on belongs to it."""
        self._use_stream()
        response.stream_id = id_to_msg(self._stream_id)
        self._take_setup(request.setup)
        return ""

    def _use_stream(self) -> None:
        campaign_id = self.membership.identity.campaign_id
        self.membership.identity = Identity(campaign_id, self._stream_id)

    def _on_setup(self, message: RigSetup) -> None:
        """Follow the set-ups of a campaign that has not asked to join, until one has."""
        if not self.membership.is_joined:
            self._take_setup(message)

    def _take_setup(self, message: RigSetup) -> None:
        self._setup = setup_from_msg(message)
        if self._open is not None and self._open.hammerless is not None:
            self._open.hammerless.take_setup(self._setup)

    def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        if id_from_msg(request.campaign_id) != self.membership.identity.campaign_id:
            response.message = "the accelerometers take part in another campaign"
            return response
        # Started in the middle of a campaign: numbers go on where they were.
        self._record = max(self._record, request.after)
        label = HitLabel(request.sample, self._record + 1, request.impact, request.attempt)
        arming = self._arming
        # The same request again: it was to wait, or its first answer was lost.
        if arming is None or not arming.is_for(label):
            response.message = self._describe_obstacle(label)
            if response.message or self._thread is None:
                return response
            if delay := self._describe_delay():
                response.message = interfaces.NOT_YET + delay
                return response
            arming = Arming(label)
            self._arming, self._record, self._cut_off = arming, label.record, None
            self._thread.arm(arming)
        if arming.armed.wait(ARMING_PAUSE):
            self._note_armed(arming)
        response.success, response.record = arming.is_armed, arming.label.record
        if not arming.is_armed:
            response.message = interfaces.NOT_YET + "the source is being armed"
        return response

    def _describe_delay(self) -> str:
        """Return what arming waits for that comes by itself; empty: nothing."""
        # The verdict on a hit may be faster than the word of its end from the source's thread.
        if self._arming is not None:
            return f"record {self._arming.label.record} is just ending"
        if self._setup is None:
            return "no set-up has been received: start the campaign node first"
        if missing := self._topic.describe_missing(self.get_value("required_subscribers")):
            return f"{missing}: start it first, or change the parameter required_subscribers"
        return ""

    def _describe_obstacle(self, label: HitLabel) -> str:
        """Return why the accelerometers may not be armed, now or soon; empty: they may."""
        if not self.is_active:
            why = self.fault or "activate it first"
            return f"the accelerometer node is not active: {why}"
        if self._arming is not None and not self._arming.is_read:
            return f"already armed for record {self._arming.label.record}: disarm first"
        if self._setup is None:
            return ""
        try:
            self._setup.samples.find(label.sample)
            if self._open is not None and self._open.hammerless is not None:
                self._open.hammerless.check_sample(label.sample)
        except RigError as error:
            return str(error)
        return ""

    def _note_armed(self, arming: Arming) -> None:
        if arming.is_over or arming.is_armed:
            return
        arming.is_armed = True
        self._tell(AcquisitionState.ARMED, "waiting for the trigger", arming.label.sample)

    def _swing(self, message: HammerRelease) -> None:
        arming, opened = self._arming, self._open
        if arming is None or opened is None or message.record != arming.label.record:
            self._answer_late(message.record)
            return
        if not arming.is_armed or arming.is_released:
            return
        by_hand = message.latest_contact
        swing = by_hand if math.isfinite(by_hand) and by_hand > 0.0 else message.swing_time
        timeout = float(self.get_value("trigger_timeout"))
        arming.is_released = True
        if opened.hammerless is not None:
            hit = opened.hammerless.strike(arming.label, message.swing_time)
            if hit is not None:
                truth = messages.virtual_hit_to_msg(
                    hit, message.header.stamp, self.membership.identity
                )
                self._virtual_impact.publish(truth)
        # Not before: what a simulated hit takes to be computed is not waited for in vain.
        arming.release(swing + timeout + opened.plan.record_duration)

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
