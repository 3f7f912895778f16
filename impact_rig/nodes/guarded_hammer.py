"""The hammer with its interlock: the one place that releases a holder.

It knows no clock, no messages and no other node, so that its promise can be tested by itself: the
holder releases after an accepted release, and never else.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.protocols import AngledHolder, HammerHolder, HolderState
from impact_rig.status.states import Disarming, HammerPlace, HammerStatus

TRANSITIONS: Mapping[HammerPlace, tuple[HammerPlace, ...]] = {
    HammerPlace.HELD: (HammerPlace.SWINGING, HammerPlace.FAULT),
    HammerPlace.SWINGING: (HammerPlace.HELD, HammerPlace.AWAY, HammerPlace.FAULT),
    HammerPlace.AWAY: (HammerPlace.HELD, HammerPlace.FAULT),
    HammerPlace.FAULT: (HammerPlace.HELD, HammerPlace.AWAY),
}
"""Where a hammer may be next."""


NEVER_ARMED = "held, not armed"
"""The message of a hammer that has just been started, or is back."""
SOMEBODY = "an operator"
_AWAY = "put it back, and say that it is back"


class GuardedHammer:
    """Releases the hammer when it is held and armed, and nothing else forbids it.

    At first, and whenever a holder has been taken, it is disarmed. An emergency stop lasts until
    it is reset, whatever happens to the holder meanwhile. When a method raises `DeviceError`, the
    holder does not do what it should: it is to be lost and dropped.

    Parameters
    ----------
    publish : callable
        Called with every new condition.
    """

    def __init__(self, publish: Callable[[HammerStatus], None]) -> None:
        self._publish = publish
        self._condition = HammerStatus(message=NEVER_ARMED)
        self._holder: HammerHolder | None = None
        self._fault: str | None = None
        self._is_known_held = True
        self.is_turning = False  # on its way to the release angle that was last asked for

    @property
    def condition(self) -> HammerStatus:
        """Its state."""
        return self._condition

    @property
    def is_stopped(self) -> bool:
        """Whether an emergency stop lasts."""
        return self._condition.is_stopped

    def take(self, holder: HammerHolder, *, confirm_return: bool) -> None:
        """Use a holder that has been configured: the hammer is held and disarmed.

        Parameters
        ----------
        holder : HammerHolder
            Holds.
        confirm_return : bool
            A hammer that left its last holder, or may have while that was lost, is away until
            a person confirms that it is back.
        """
        self._holder, self._fault = holder, None
        self._is_known_held = self._is_known_held or not confirm_return
        if self._is_known_held:
            self._change(state=HammerPlace.HELD, armed=False, message=NEVER_ARMED)
        else:
            self._change(state=HammerPlace.AWAY, armed=False, message=_AWAY)

    def drop(self) -> None:
        """Close the holder, which goes on holding as far as its device lets it."""
        if self._holder is not None:
            self._holder.close()
            self._holder = None

    def lose(self, reason: str) -> None:
        """Note that the holder is lost: the hammer may be anywhere."""
        self._fault, self._is_known_held = reason, False
        # A disarming before, above all by a person, is still the last one.
        taker = Disarming.LOSS if self._condition.armed else self._condition.disarmed_by
        self._change(state=HammerPlace.FAULT, armed=False, disarmed_by=taker, message=reason)

    def arm(self, who: str = "") -> str | None:
        """Take a person's enable; return why it is refused, if it is."""
        return self._arm(f"armed by {who or SOMEBODY}")

    def arm_again(self) -> str | None:
        """Take a campaign's enable; return why it is refused, if it is.

        What a person has stopped or disarmed is armed by a person.
        """
        if self._condition.needs_person and not self.is_stopped:
            return f"arm the hammer first ({self._condition.message})"
        return self._arm("armed by the campaign")

    def _arm(self, message: str) -> str | None:
        reason = self._describe_stop() or self._describe_fault()
        if not reason and not self._condition.armed:
            self._change(armed=True, disarmed_by=Disarming.CAMPAIGN, message=message)
        return reason

    def disarm(self, who: str = "") -> None:
        """Take the enable back for a person."""
        taker = Disarming.EMERGENCY_STOP if self.is_stopped else Disarming.PERSON
        self._change(armed=False, disarmed_by=taker, message=f"disarmed by {who or SOMEBODY}")

    def disarm_for_now(self, why: str) -> None:
        """Take the enable back for a campaign, which may give it again."""
        if self._condition.armed:
            self._change(armed=False, disarmed_by=Disarming.CAMPAIGN, message=why)

    def disarm_by_loss(self, reason: str) -> None:
        """Take the enable back because a hit could not be recorded."""
        if self._condition.armed:
            self._change(armed=False, disarmed_by=Disarming.LOSS, message=reason)

    def stop(self, who: str = "") -> None:
        """Take the enable back until `reset`, and see that the holder holds.

        A stop that lasts keeps the name of who called it first.
        """
        by = self._condition.stopped_by if self.is_stopped else who
        self._change(
            armed=False,
            disarmed_by=Disarming.EMERGENCY_STOP,
            message=f"emergency stop{f' by {by}' if by else ''}",
            stopped_by=by,
        )
        if self._holder is not None:
            self._holder.hold()

    def reset(self, who: str = "") -> None:
        """End an emergency stop, and nothing else: a person arms the hammer."""
        if self.is_stopped:
            self._change(
                disarmed_by=Disarming.PERSON,
                message=f"emergency stop ended by {who or SOMEBODY}, not armed",
                stopped_by="",
            )

    def describe_obstacle(self) -> str | None:
        """Return why the hammer itself may not go now; None: it may."""
        if reason := self._describe_stop() or self._describe_fault():
            return reason
        condition = self._condition
        if not condition.armed:
            why = f" ({condition.message})" if condition.disarmed_by is Disarming.LOSS else ""
            return f"the hammer is not armed{why}: arm it first"
        if condition.state is HammerPlace.AWAY:
            return f"the hammer is not in its holder: {_AWAY}"
        if condition.state is HammerPlace.SWINGING:
            return "the hammer is not in its holder: wait for the swing to end"
        return None

    @property
    def is_hammerless(self) -> bool:
        """Whether no hammer hangs in the holder."""
        return self._holder is not None and self._holder.hammerless

    @property
    def can_set_angle(self) -> bool:
        """Whether the holder can set a release angle."""
        return isinstance(self._holder, AngledHolder)

    def set_angle(self, angle: float) -> str | None:
        """Move the hammer to a release angle [rad].

        Returns
        -------
        str or None
            Why it is not there, or not yet, see `is_turning`; None: it is there.
        """
        self.is_turning = False
        if reason := self.describe_obstacle():
            return reason
        if not isinstance(self._holder, AngledHolder):
            return "the holder cannot set a release angle"
        self.is_turning = not self._holder.set_angle(angle)
        return "the holder moves the hammer to its release angle" if self.is_turning else None

    def release(self, obstacle: str | None) -> str | None:
        """Release the hammer, if nothing forbids it.

        Parameters
        ----------
        obstacle : str or None
            Why the rest of the rig could not record the hit; None: it could.

        Returns
        -------
        str or None
            Why it was refused; None: the hammer goes.
        """
        reason = self.describe_obstacle() or obstacle
        if reason or self._holder is None:
            return reason
        # Also if the holder fails now: where the hammer is becomes unknown.
        self._is_known_held = False
        self._holder.release()
        message = "the operator may let go" if self._holder.is_by_hand else "released"
        self._change(state=HammerPlace.SWINGING, message=message)
        return None

    def end_swing(self, message: str, *, confirm_return: bool) -> None:
        """Hold again after a swing, if there was one.

        Parameters
        ----------
        message : str
            What ended it.
        confirm_return : bool
            The hammer is away until a person confirms that it is back.
        """
        if self._holder is None or self._condition.state is not HammerPlace.SWINGING:
            return
        self._holder.hold()
        self._is_known_held = not confirm_return
        if confirm_return:
            self._change(state=HammerPlace.AWAY, message=_AWAY)
            return
        if not self._condition.armed:  # Why it was disarmed while it swung is not forgotten.
            message = f"{message}; {self._condition.message}"
        self._change(state=HammerPlace.HELD, message=message)

    def confirm_held(self) -> str | None:
        """Confirm that the hammer is back; return why that is refused, if it is."""
        if self._holder is None or self._fault:
            return self._describe_fault()
        if self._condition.state is HammerPlace.SWINGING:
            return "the hammer swings: wait for the swing to end"
        self._holder.hold()
        self._is_known_held = True
        if self._condition.state is HammerPlace.AWAY:
            self._change(state=HammerPlace.HELD, message="put back into the holder")
        return None

    def check(self) -> None:
        """Raise `DeviceError` if the holder is lost, or has released without an order."""
        if self._holder is None:
            return
        state = self._holder.read_state()
        if state is HolderState.RELEASED and self._condition.state is not HammerPlace.SWINGING:
            raise DeviceError("the holder has released the hammer without an order")

    def _describe_stop(self) -> str | None:
        return "an emergency stop lasts: reset it first" if self.is_stopped else None

    def _describe_fault(self) -> str | None:
        if self._holder is not None and self._fault is None:
            return None
        return f"nothing holds the hammer: {self._fault or 'activate the hammer node first'}"

    def _change(self, **changes: Any) -> None:
        message = changes.get("message", self._fault)
        if self._fault and message != self._fault:
            # The reason of a loss stays in the message until the hammer is back.
            changes["message"] = f"{message}; {self._fault}"
        condition = replace(self._condition, **changes)
        if condition != self._condition:
            self._condition = condition
            self._publish(condition)
