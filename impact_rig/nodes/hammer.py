"""The hammer: holds it, and releases it when the rest of the rig can record the hit."""

import functools
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import HammerRelease
from impact_rig_msgs.srv import Release, SetAngle, SetArmed

from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.setup import check_release_angles
from impact_rig.devices.drivers import HOLDERS, make_device
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import BEAT, Standstill
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.guarded_hammer import GuardedHammer
from impact_rig.nodes.identity import id_from_msg, identity_from_msg
from impact_rig.nodes.intake import LAST_WORDS
from impact_rig.nodes.rig_member import RigMember
from impact_rig.nodes.rig_node import Answer
from impact_rig.recordings.messages import label_from_msg
from impact_rig.status.states import HammerPlace, HammerStatus, Phase

LEAD_TIME = 3.0
"""Notice before a holder releases a hammer that can strike [s], unless another is stated."""
_OTHER_CAMPAIGN = "the hammer takes part in another campaign"


class HammerNode(DeviceNode):
    """Holds and releases the hammer; refuses a hit that could not be recorded.

    A release needs a holder that holds, the operator's enable, accelerometers that are armed for
    this hit, and a recorder that records. The loss of any of them takes the enable back, and so
    does a time in which this process stood still: meanwhile a person may have walked up to the
    hammer. Only a release that was asked for moves the hammer: no start, no end, no watchdog does.
    """

    def __init__(self, **options: Any) -> None:
        # From the first callback on: a start may take longer than a lease, and nothing is armed.
        self._standstill = Standstill()
        super().__init__("hammer", **options)
        self._patience = 0.0  # [s], within which an operator releases by hand; 0: a device does
        self._holder = ""
        self._released: Release.Request | None = None
        self._armed_record = 0
        self._swing = self.create_timer(1.0, self._on_swing_time)
        self._swing.cancel()
        self._told = self.number_state(interfaces.HAMMER_STATE)
        self._stopped_at = Time()
        self._release = self.advertise(interfaces.RELEASE)
        self._hammer = GuardedHammer(self._publish_condition)
        self._accelerometer = RigMember(
            self, "accelerometer", interfaces.ACQUISITION_STATE, self._on_acquisition_state
        )
        self._recorder = RigMember(self, "recorder", interfaces.RECORDER_STATE, self._check_rig)
        self.offer_act(interfaces.ARM_HAMMER, self._arm, self._told)
        self.offer_act(interfaces.CONFIRM_HELD, self._confirm_held, self._told)
        self.offer_act(interfaces.RESET_HAMMER, self._reset, self._told)
        # Whatever the person saw, and however late: these keep the hammer where it is.
        self.offer_act(interfaces.DISARM_HAMMER, self._disarm)
        self.offer_act(interfaces.EMERGENCY_STOP, self._stop)
        self.create_service(SetArmed, interfaces.SET_ARMED, self._on_set_armed)
        self.create_service(SetAngle, interfaces.SET_ANGLE, self._on_set_angle)
        self.create_service(Release, interfaces.RELEASE_HAMMER, self._on_release)
        self.offer_to_join(self._check_rig)
        # An operator who pulls a plug wants to see the enable go.
        self.create_timer(BEAT / self.pace, self._watch)

    # Every callback first looks whether this process stood still before it.

    def create_timer(
        self, timer_period_sec: float, callback: Any, *arguments: Any, **options: Any
    ) -> Any:
        """Create a timer."""
        watched = self._watch_clock(callback)
        return super().create_timer(timer_period_sec, watched, *arguments, **options)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **options: Any) -> Any:
        """Create a service."""
        return super().create_service(srv_type, srv_name, self._watch_clock(callback), **options)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, qos_profile: Any, **options: Any
    ) -> Any:
        """Create a subscription."""
        watched = self._watch_clock(callback)
        return super().create_subscription(msg_type, topic, watched, qos_profile, **options)

    def _watch_clock(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return a callback that is preceded by a look at the clock."""

        @functools.wraps(callback)
        def run(*arguments: Any) -> Any:
            self._check_clock()
            return callback(*arguments)

        return run

    # The lifecycle.

    def configure(self) -> None:
        """Open the holder, which holds from now on."""
        super().configure()
        path = self.get_value("rig_file")
        try:
            holder = make_device(HOLDERS, load_rig_file(path).holder)
        except ParameterError as error:
            raise ParameterError(f"rig file {path}: {error}") from None
        try:
            self._holder = holder.configure()
        except RigError:
            holder.close()
            raise
        self._patience = holder.patience if holder.is_by_hand else 0.0
        self._hammer.take(holder, confirm_return=self.get_value("confirm_return"))

    def activate(self) -> None:
        """Publish the hammer's state."""
        self._publish_condition(self._hammer.condition)

    def deactivate(self) -> None:
        """Take the operator's enable back."""
        self._hammer.disarm_for_now("disarmed when the hammer node was deactivated")

    def cleanup(self) -> None:
        """Close the holder; it goes on holding as far as it can."""
        self._hammer.drop()

    def publish_fault(self, text: str) -> None:
        """Publish that the holder is lost, and why; take the enable back."""
        self._hammer.lose(text)

    def describe_warning(self) -> str | None:
        """Return that an emergency stop lasts."""
        return "an emergency stop lasts" if self._hammer.is_stopped else None

    def _publish_condition(self, condition: HammerStatus) -> None:
        now, was_stopped = self.get_clock().now().to_msg(), self._stopped_at != Time()
        if condition.is_stopped != was_stopped:
            self._stopped_at = now if condition.is_stopped else Time()
        if self.context.ok():
            self._told.publish(
                state=condition.state,
                armed=condition.armed,
                disarmed_by=condition.disarmed_by,
                message=condition.message,
                holder=self._holder,
                hammerless=self._hammer.is_hammerless,
                sets_angle=self._hammer.can_set_angle,
                stopped_by=condition.stopped_by,
                stopped_at=self._stopped_at,
                since=now,
                lead_time=self._lead_time,
            )

    @property
    def _lead_time(self) -> float:
        """Notice before each release [s]."""
        stated = float(self.get_value("lead_time"))
        if stated >= 0.0:
            return stated
        return 0.0 if self._patience or self._hammer.is_hammerless else LEAD_TIME

    # The rest of the rig.

    def _on_acquisition_state(self) -> None:
        self._check_rig()
        state = self._accelerometer.state
        if state is None:
            return
        is_armed = state.state is Phase.ARMED
        is_new = is_armed and state.record != self._armed_record
        self._armed_record = state.record if is_armed else 0
        if is_new:
            # A request that equals an earlier one is a request for this arming.
            self._released = None
        elif (
            state.state is Phase.IDLE
            and self._patience  # only a release by hand ends with its record
            and self._released is not None
            and self._released.record == state.record
        ):
            self._end_swing("the record has ended")

    def _watch(self) -> None:
        """Check that the nodes which a release needs are still there; never release."""
        self._check_rig()
        self._run_guarded(self._hammer.check)

    def _check_clock(self) -> None:
        """Take the enable back if this process was stopped, or the computer asleep."""
        if stood_still := self._standstill.look():
            text = f"the hammer node {stood_still}"
            self.get_logger().warning(text)
            self._hammer.disarm_by_loss(text)
            self._told.renew()

    def _check_rig(self) -> None:
        """Take the enable back if something that a hit needs is lost."""
        if loss := self._describe_loss():
            self._hammer.disarm_by_loss(loss)

    def _describe_loss(self) -> str | None:
        """Return why the hammer must be disarmed; None: nothing is lost."""
        if self._standstill.is_catching_up:
            return "the hammer node stood still, and catches up on what has come meanwhile"
        # It may have seen a stranger a beat before the others did: armed, it finds them listening.
        if stranger := self.intake.find_any_stranger(LAST_WORDS + 2.0 * BEAT):
            return stranger
        for member in (self._accelerometer, self.campaign, self._recorder):
            if loss := member.describe_loss():
                return loss
        recorder = self._recorder.state
        if recorder is None or recorder.recording:
            return None
        return f"nothing is being recorded: {recorder.message}"

    def _describe_obstacle(self, request: Release.Request) -> str | None:
        """Return why the rest of the rig could not record a hit."""
        if loss := self._describe_loss():
            return loss
        acquisition = self._accelerometer.state
        if acquisition is None or acquisition.state is not Phase.ARMED:
            why = acquisition.message if acquisition else "no accelerometers have reported"
            return f"the accelerometers are not armed ({why}): call accelerometer/arm first"
        if (acquisition.record, acquisition.sample) != (request.record, request.sample):
            return (
                f"the accelerometers are armed for record {acquisition.record} on"
                f" {acquisition.sample!r}, not for record {request.record} on"
                f" {request.sample!r}"
            )
        if self._recorder.state is None:
            return "no recorder has reported: start the recorder first"
        return None

    # The services.

    def _run_guarded(self, act: Callable[[], str | None]) -> str | None:
        """Do something with the holder, which is lost if that fails; return why it failed."""
        try:
            return act()
        except DeviceError as error:
            self.lose_device(error)
            return str(error)

    def _arm(self, who: str) -> Answer:
        return _answer(self._describe_arming() or self._hammer.arm(who), "armed")

    def _describe_arming(self) -> str | None:
        """Return why this node cannot take an enable."""
        is_sound = self._hammer.condition.state is not HammerPlace.FAULT
        if is_sound and not self._hammer.is_stopped and not self.is_active:
            return "the hammer node is not active: activate it first"
        return self._describe_loss()

    def _on_set_armed(
        self, request: SetArmed.Request, response: SetArmed.Response
    ) -> SetArmed.Response:
        if id_from_msg(request.campaign_id) != self.membership.identity.campaign_id:
            refusal: str | None = _OTHER_CAMPAIGN
        elif request.armed:
            refusal = (
                self._told.refuse(request) or self._describe_arming() or self._hammer.arm_again()
            )
        else:
            refusal = None
            self._hammer.disarm_for_now(request.why)
        response.success, response.message = _answer(refusal, "done")
        return response

    def _disarm(self, who: str) -> Answer:
        self._hammer.disarm(who)
        return True, "disarmed"

    def _confirm_held(self, _: str) -> Answer:
        return _answer(self._run_guarded(self._hammer.confirm_held), "held")

    def _on_set_angle(
        self, request: SetAngle.Request, response: SetAngle.Response
    ) -> SetAngle.Response:
        try:
            check_release_angles([request.angle])
        except ParameterError as error:
            response.message = str(error)
            return response
        reason = self._run_guarded(lambda: self._hammer.set_angle(request.angle))
        response.later = self._hammer.is_turning
        response.success, response.message = _answer(reason, "there")
        return response

    def _stop(self, who: str) -> Answer:
        fault = self._run_guarded(lambda: self._hammer.stop(who))
        self.get_logger().warning(f"emergency stop{f' by {who}' if who else ''}")
        if fault:
            return True, f"stopped, but the holder is lost: {fault}"
        return True, "stopped: a reset ends it"

    def _reset(self, who: str) -> Answer:
        was_stopped = self._hammer.is_stopped
        self._hammer.reset(who)
        done = "the emergency stop is ended" if was_stopped else "there was no emergency stop"
        obstacle = self._hammer.describe_obstacle()
        return True, f"{done}; {obstacle or 'the hammer is armed'}"

    def _on_release(
        self, request: Release.Request, response: Release.Response
    ) -> Release.Response:
        if id_from_msg(request.campaign_id) != self.membership.identity.campaign_id:
            response.message = _OTHER_CAMPAIGN
            return response
        # The same request again: the hammer went, and the first answer was lost.
        if self._released != request:
            if self._released is not None and self._released.record == request.record:
                response.message = (
                    f"the hammer was released for record {request.record} already: arm the"
                    " accelerometers again"
                )
                return response
            obstacle = self._describe_obstacle(request)
            # The states of accelerometers and recorder travel by other topics than the request.
            if obstacle and not self._hammer.describe_obstacle():
                response.message, response.later = obstacle, True
                return response
            stamp = self.get_clock().now().to_msg()
            if refusal := self._run_guarded(lambda: self._hammer.release(obstacle)):
                self.get_logger().warning(f"release refused: {refusal}")
                response.message = refusal
                # Who asked may believe another sender of this state.
                self._publish_condition(self._hammer.condition)
                return response
            self._begin_swing(request, stamp)
        response.success = True
        response.latest_contact = self._compute_latest_contact()
        response.by_hand = self._patience > 0.0
        return response

    def _begin_swing(self, request: Release.Request, stamp: Time) -> None:
        """Publish that the hammer goes, and when its swing ends."""
        release = HammerRelease(
            **asdict(label_from_msg(request)),
            swing_time=float(self.get_value("swing_time")),
            latest_contact=self._compute_latest_contact(),
        )
        self._release.publish(identity_from_msg(request).fill(release, stamp))
        self._released = request
        duration = self._compute_latest_contact() + float(self.get_value("return_time"))
        self._swing.timer_period_ns = round(duration * 1e9)
        self._swing.reset()

    def _compute_latest_contact(self) -> float:
        return self._patience or float(self.get_value("swing_time"))

    def _on_swing_time(self) -> None:
        by_hand = f"the hammer was not released within {self._patience:g} s"
        self._end_swing(by_hand if self._patience else "back in the holder")

    def _end_swing(self, message: str) -> None:
        """Hold the hammer again."""
        self._swing.cancel()
        is_away = bool(self.get_value("confirm_return"))
        self._run_guarded(lambda: self._hammer.end_swing(message, confirm_return=is_away))


def _answer(reason: str | None, done: str) -> Answer:
    """Return an answer: why not, or what was done."""
    return not reason, reason or done
