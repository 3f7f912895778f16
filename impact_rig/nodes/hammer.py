"""The hammer: holds it, and lets it go when the rest of the rig can record the hit."""

import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from impact_rig_msgs.msg import AcquisitionState, HammerRelease
from impact_rig_msgs.srv import Release, SetAngle
from std_srvs.srv import Trigger

from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.core.setup import check_release_angles
from impact_rig.devices.drivers import HOLDERS, VIRTUAL, make_device, read_driver_name
from impact_rig.nodes import interfaces
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.guarded_hammer import (
    ON_ITS_WAY,
    GuardedHammer,
    HammerCondition,
    HammerPlace,
)
from impact_rig.nodes.identity import id_from_msg
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import LONGEST_PAUSE, OWN_NODES, Read
from impact_rig.nodes.rig_state import ACCELEROMETER, CAMPAIGN, RECORDER, RigState

Answer = TypeVar("Answer", Trigger.Response, SetAngle.Response)
WATCH_PERIOD = 0.5
"""How often holder, accelerometers and recorder are looked after [s], our choice: an operator who
pulls a plug wants to see the enable go."""
CATCH_UP_TIME = interfaces.LEASE + 0.5
"""How long a process that was stopped refuses to release when it goes on [s]: by then it has heard
what was said meanwhile, and missed who has died."""


class HammerNode(DeviceNode):
    """Holds and releases the hammer; refuses, with a reason, what could not be recorded.

    A release needs a holder that holds, the operator's enable, accelerometers that are armed for
    this hit, and a recorder that records. The loss of any of them takes the enable back. Only a
    release that was asked for lets the hammer go: not the start, not the end, nor a watchdog.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("hammer", **options)
        self.declare(
            "swing_time", 0.207, "time from release to contact [s]; the paper's 0.207",
            low=0.0, high=60.0, read=Read.AT_USE,
        )  # fmt: skip
        self.declare(
            "return_time", 0.0, "from contact back into the holder [s]",
            low=0.0, high=60.0, read=Read.AT_USE,
        )  # fmt: skip
        self.declare(
            "confirm_return", False,
            "after each swing, wait until somebody calls hammer/confirm_held", read=Read.AT_USE,
        )  # fmt: skip
        self.declare(
            "require_recorder", True, "refuse to release while nothing is recorded",
            read=Read.AT_USE,
        )  # fmt: skip
        self._patience = 0.0
        self._identity = ""
        self._moves_by_message = False
        self._others: tuple[str, ...] = ()
        self._released: Release.Request | None = None
        self._armed = 0
        self._swings = 0
        self._publish_state = self.advertise_state(interfaces.HAMMER_STATE)
        self._release = self.advertise(interfaces.RELEASE)
        self._hammer = GuardedHammer(self._tell)
        self._newest, self._recorded_to, self._losses = 0, "", 0
        self._seen_running, self._is_caught_up_at = _read_clock(), 0.0
        self._rig = RigState(self, (ACCELEROMETER, RECORDER, CAMPAIGN), self._note_loss)
        self._rig[ACCELEROMETER].take = self._take_acquisition
        for name, callback in (
            (interfaces.ARM_HAMMER, self._arm),
            (interfaces.DISARM_HAMMER, self._disarm),
            (interfaces.CONFIRM_HELD, self._confirm_held),
            (interfaces.EMERGENCY_STOP, self._stop),
            (interfaces.RESET_HAMMER, self._reset),
        ):
            self.create_service(Trigger, name, callback)
        self.create_service(SetAngle, interfaces.SET_ANGLE, self._set_angle)
        self.create_service(Release, interfaces.RELEASE_HAMMER, self._let_go)
        self.offer_to_join()
        self.create_timer(WATCH_PERIOD, self._watch)

    # What the lifecycle asks for.

    def configure(self) -> None:
        """Open the holder, which holds from now on."""
        path = self.get_value("rig_file")
        table = load_rig_file(path).holder
        try:
            holder = make_device(HOLDERS, table)
        except ParameterError as error:
            raise ParameterError(f"rig file {path}: {error}") from None
        try:
            self._identity = holder.configure()
        except RigError:
            holder.close()
            raise
        self._patience = holder.patience if holder.is_by_hand else 0.0
        self._moves_by_message = not (holder.is_by_hand or read_driver_name(table) == VIRTUAL)
        self._hammer.take(holder, confirm_return=self.get_value("confirm_return"))

    def activate(self) -> None:
        """Say what the hammer does."""
        self._tell(self._hammer.condition)

    def deactivate(self) -> None:
        """Take the operator's enable back."""
        if self._hammer.condition.is_armed:
            self._hammer.disarm("disarmed when the hammer node was deactivated")

    def cleanup(self) -> None:
        """Close the holder; it goes on holding as far as it can."""
        self._hammer.drop()

    def publish_fault(self, text: str) -> None:
        """Say that the holder is lost, and why."""
        self._hammer.lose(text)

    def lose_device(self, error: RigError) -> None:
        """Take the enable back, let the holder go, and look for it again."""
        self._hammer.lose(str(error))
        super().lose_device(error)

    def diagnose(self) -> dict[str, Any]:
        """Return what the hammer does."""
        condition = self._hammer.condition
        return {
            "holder": self._identity,
            "armed": condition.is_armed,
            "held": condition.place is HammerPlace.HELD,
        }

    def describe_warning(self) -> str:
        """Return that an emergency stop lasts, or that others could move the hammer."""
        return "an emergency stop lasts" if self._hammer.is_stopped else self._describe_others()

    # What is heard and seen.

    def _tell(self, condition: HammerCondition) -> None:
        if self.context.ok():
            self._publish_state(
                state=condition.place,
                armed=condition.is_armed,
                disarmed_by=condition.disarmed_by,
                message=condition.message,
                holder=self._identity,
                sets_angle=self._hammer.can_set_angle,
            )

    def _take_acquisition(self, message: AcquisitionState) -> None:
        self._note_loss()
        is_armed = message.state == AcquisitionState.ARMED
        is_new, self._armed = is_armed and message.record != self._armed, message.record * is_armed
        if is_new:
            # What looks like an earlier request is another one.
            self._released = None
            self._rig.forget_stored(message.record)
        elif message.state == AcquisitionState.IDLE and self._waits_for_operator(message.record):
            self._end_swing(self._swings, "the record has ended")

    def _waits_for_operator(self, record: int) -> bool:
        """Whether an operator has been told to let the hammer go for a record."""
        return bool(self._patience and self._released and self._released.record == record)

    def _watch(self) -> None:
        """See whether what a release needs is still there; never releases."""
        self._note_pause()
        self._look_for_others()
        self._note_loss()
        self._guard(self._hammer.check)

    def _guard(self, act: Callable[[], str | None]) -> str:
        """Do something with the holder, which is lost if that fails; return why it failed."""
        try:
            return act() or ""
        except DeviceError as error:
            self.lose_device(error)
            return str(error)

    def _note_loss(self) -> None:
        """Take the enable back if accelerometers, recorder or campaign are lost."""
        self._hammer.note_loss(self._describe_loss())

    def _note_pause(self) -> None:
        """Note whether this process was stopped, or the computer asleep, since the last time."""
        now = _read_clock()
        if (pause := now - self._seen_running) > LONGEST_PAUSE:
            self._is_caught_up_at = now + CATCH_UP_TIME
            self.get_logger().warning(f"this process did not run for {pause:.1f} s")
        self._seen_running = now

    def _look_for_others(self) -> None:
        """Say once who else is in the domain of a holder that lets go by itself."""
        others = tuple(sorted(set(self._list_others()))) if self._moves_by_message else ()
        if others != self._others:
            self._others = others
            if others:
                self.get_logger().warning(self._describe_others())

    def _list_others(self) -> Iterator[str]:
        own = self.get_namespace()
        for name, namespace in self.get_node_names_and_namespaces():
            if namespace != own or not (name.startswith("_") or name in OWN_NODES):
                yield f"{namespace.rstrip('/')}/{name}"

    def _describe_others(self) -> str:
        if not self._others:
            return ""
        return (
            f"others are in ROS domain {self.context.get_domain_id()}, and could release the"
            f" hammer: {', '.join(self._others)}; give the rig a ROS_DOMAIN_ID of its own"
        )

    # Whether the rest of the rig could record a hit.

    def _describe_loss(self) -> str:
        """Return what was there and is lost; empty: nothing.

        What has not been heard of yet, or has come to a normal end, is not lost.
        """
        rig = self._rig
        if self._is_state_published_twice():
            return f"another node publishes {interfaces.HAMMER_STATE.name}: end it"
        if loss := rig.describe_loss(ACCELEROMETER, CAMPAIGN):
            return loss
        if not self.get_value("require_recorder"):
            return ""
        stop = rig.describe_stop_of_recorder() if rig.was_recorded else ""
        return rig.describe_loss(RECORDER) or stop

    def _is_state_published_twice(self) -> bool:
        """Whether another node publishes this one's state."""
        return self.count_publishers(interfaces.HAMMER_STATE.name) > 1

    def _describe_rig_obstacle(self, request: Release.Request) -> str:
        """Return why the rest of the rig could not record a hit; empty: it could."""
        return (
            self._describe_loss()
            or self._describe_own_obstacle()
            or self._describe_acquisition_obstacle(request)
            or self._describe_recorder_obstacle(request)
        )

    def _describe_own_obstacle(self) -> str:
        """Return that what this node knows, and was asked before, may be old."""
        if _read_clock() < self._is_caught_up_at:
            return "the hammer node was stopped for a time, and hears what has been said meanwhile"
        return ""

    def _describe_acquisition_obstacle(self, request: Release.Request) -> str:
        acquisition = self._rig[ACCELEROMETER].state
        if acquisition is None or acquisition.state != AcquisitionState.ARMED:
            return (
                self._rig.describe_inactivity(ACCELEROMETER)
                or "the accelerometers are not armed: call accelerometer/arm first"
            )
        if (acquisition.record, acquisition.sample) != (request.record, request.sample):
            return (
                f"the accelerometers are armed for record {acquisition.record} on"
                f" {acquisition.sample!r}, not for record {request.record} on"
                f" {request.sample!r}"
            )
        return ""

    def _describe_recorder_obstacle(self, request: Release.Request) -> str:
        if not self.get_value("require_recorder"):
            return ""
        if not self._rig.recording:
            recorder = self._rig[RECORDER].state
            why = recorder.message if recorder else "no recorder has reported"
            return f"nothing is being recorded ({why}): start the recorder first"
        if self._is_unstored(request):
            return (
                f"the recorder has not said that record {self._newest} is stored: wait for it,"
                " or start the recorder anew"
            )
        return ""

    def _is_unstored(self, request: Release.Request) -> bool:
        """Whether the record before this one is still on its way to the disk."""
        rig, newest = self._rig, self._newest
        # What one recording did not store, the next one will not; nor what was on its way when
        # accelerometers or recorder were lost.
        is_awaited = bool(self._recorded_to) and rig.recording == self._recorded_to
        is_awaited = is_awaited and rig.losses == self._losses
        return is_awaited and newest != request.record and not rig.is_stored(newest)

    # What is asked of the hammer.

    def _arm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        state = self._hammer.condition
        is_ours_to_say = state.place is not HammerPlace.FAULT and not self._hammer.is_stopped
        if is_ours_to_say and not self.is_active:
            return _answer(response, "the hammer node is not active: activate it first")
        return _answer(response, self._describe_loss() or self._hammer.arm(), "armed")

    def _disarm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._hammer.disarm("disarmed by the operator")
        return _answer(response, "", "disarmed")

    def _confirm_held(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, self._guard(self._hammer.confirm_held), "held")

    def _set_angle(
        self, request: SetAngle.Request, response: SetAngle.Response
    ) -> SetAngle.Response:
        try:
            check_release_angles([request.angle])
        except ParameterError as error:
            return _answer(response, str(error))
        reason = self._guard(lambda: self._hammer.set_angle(request.angle))
        is_moving = reason == ON_ITS_WAY
        return _answer(response, interfaces.NOT_YET * is_moving + reason, "there")

    def _stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.get_logger().warning("emergency stop")
        lost = self._guard(self._hammer.stop)
        told = (
            f"stopped, but the holder is lost: {lost}" if lost else "stopped: hammer/reset ends it"
        )
        return _answer(response, "", told)

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        was_stopped = self._hammer.is_stopped
        self._hammer.reset()
        done = "the emergency stop is ended" if was_stopped else "there was no emergency stop"
        if not self.is_active:
            now = "the hammer node is not active: activate it, then call hammer/arm"
        else:
            now = self._hammer.describe_obstacle() or "the hammer is armed"
        return _answer(response, "", f"{done}; {now}")

    def _let_go(self, request: Release.Request, response: Release.Response) -> Release.Response:
        self._note_pause()
        if id_from_msg(request.campaign_id) != self.membership.identity.campaign_id:
            response.message = "the hammer takes part in another campaign"
            return response
        # The same request again: the hammer went, and the first answer was lost.
        if self._released != request:
            if self._released is not None and self._released.record == request.record:
                response.message = (
                    f"the hammer was released for record {request.record} already: arm the"
                    " accelerometers anew"
                )
                return response
            obstacle = self._describe_rig_obstacle(request)
            # The states of accelerometers and recorder travel by other topics than the request.
            if obstacle and not self._hammer.describe_obstacle():
                response.message = interfaces.NOT_YET + obstacle
                return response
            response.message = self._try_release(request)
            if response.message:
                self.get_logger().warning(f"release refused: {response.message}")
                return response
        response.success = True
        response.recording = self._rig.recording
        response.latest_contact = self._compute_latest_contact()
        return response

    def _try_release(self, request: Release.Request) -> str:
        """Let the hammer go for a hit, if nothing forbids it; return what does."""
        swing_time = float(self.get_value("swing_time"))
        release = HammerRelease(
            campaign_id=request.campaign_id,
            stream_id=request.stream_id,
            record=request.record,
            sample=request.sample,
            impact=request.impact,
            attempt=request.attempt,
            swing_time=swing_time,
            latest_contact=self._compute_latest_contact(),
        )
        release.header.stamp = self.get_clock().now().to_msg()
        reason = self._guard(lambda: self._hammer.release(self._describe_rig_obstacle(request)))
        if not reason:
            self._newest, self._recorded_to = request.record, self._rig.recording
            self._losses = self._rig.losses
            self._release.publish(release)
            self._released = request
            self._swings += 1
            swing, text = self._swings, self._describe_end()
            self.run_once_after(
                self._compute_latest_contact() + float(self.get_value("return_time")),
                lambda: self._end_swing(swing, text),
            )
        return reason

    def _compute_latest_contact(self) -> float:
        return self._patience or float(self.get_value("swing_time"))

    def _describe_end(self) -> str:
        if not self._patience:
            return "back in the holder"
        return f"nobody let the hammer go within {self._patience:g} s"

    def _end_swing(self, swing: int, message: str) -> None:
        """Hold the hammer again, if no later swing has begun."""
        is_away = bool(self.get_value("confirm_return"))
        if swing == self._swings:
            self._guard(lambda: self._hammer.end_swing(message, confirm_return=is_away))


def _read_clock() -> float:
    """Return a time that nobody sets and that goes on while the computer sleeps [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def _answer(response: Answer, reason: str, done: str = "") -> Answer:
    """Fill in an answer: why not, or what was done."""
    response.success, response.message = not reason, reason or done
    return response


def main() -> int:
    """Run the node."""
    return run_node(HammerNode)
