"""The holder releases only when a release was accepted."""

from itertools import pairwise

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from impact_rig_msgs.msg import HammerState

from impact_rig.core.given.errors import DeviceError
from impact_rig.devices.protocols import HolderState
from impact_rig.nodes.guarded_hammer import NEVER_ARMED, TRANSITIONS, GuardedHammer
from impact_rig.status.states import Disarming, HammerPlace, HammerStatus

CONFIRMED = st.booleans()


class Holder:
    """Counts the calls; fails while `is_broken`."""

    is_by_hand = False
    hammerless = False

    def __init__(self) -> None:
        self.releases = 0
        self.is_broken = False
        self.is_open = True
        self.state = HolderState.HOLDING

    def _obey(self, state):
        assert self.is_open, "a holder was used after it was closed"
        if self.is_broken:
            raise DeviceError("the cable is out")
        self.state = state

    def hold(self):
        self._obey(HolderState.HOLDING)

    def release(self):
        self._obey(HolderState.RELEASED)
        self.releases += 1

    def read_state(self):
        self._obey(self.state)
        return self.state

    def close(self):
        self.is_open = False


class Interlock(RuleBasedStateMachine):
    """Does all that can happen to a hammer, in any order, beside a plain account of the rules."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[HammerStatus] = [HammerStatus(message=NEVER_ARMED)]
        self.hammer = GuardedHammer(self.told.append)
        self.holders: list[Holder] = []
        self.holder: Holder | None = None
        self.accepted = 0
        self.is_enabled = False
        self.is_stopped = False
        self.stopped_by = ""
        self.needs_person = False
        self.is_in_holder = True
        self.lost_for = ""

    def attempt(self, action, *arguments, **options):
        """Do something as the node does: what the holder refuses costs the holder."""
        try:
            return action(*arguments, **options)
        except DeviceError as error:
            self.lose(str(error))
            return str(error)

    def lose(self, reason):
        self.hammer.lose(reason)
        self.hammer.drop()
        self.holder, self.is_enabled, self.is_in_holder = None, False, False
        self.lost_for = reason

    @initialize()
    def begin(self):
        """Hold and arm, or nearly all that follows would be refused."""
        self.take(confirm=True)
        self.arm()

    @precondition(lambda self: self.holder is None)
    @rule(confirm=CONFIRMED)
    def take(self, confirm):
        self.holder = Holder()
        self.holders.append(self.holder)
        self.hammer.take(self.holder, confirm_return=confirm)
        self.is_in_holder = self.is_in_holder or not confirm
        self.is_enabled, self.lost_for = False, ""

    @rule()
    def break_holder(self):
        if self.holder:
            self.holder.is_broken = True

    @rule()
    def fall(self):
        """Let the magnet fail by itself."""
        if self.holder:
            self.holder.state = HolderState.RELEASED

    @rule()
    def watch(self):
        holder, swings = self.holder, self.hammer.condition.state is HammerPlace.SWINGING
        has_let_go = holder and holder.state is HolderState.RELEASED and not swings
        refusal = self.attempt(self.hammer.check)
        assert bool(refusal) == bool(holder and (holder.is_broken or has_let_go))

    @rule()
    def drop(self):
        """Let the node be deactivated: the hammer stays where it is."""
        self.hammer.drop()
        self.holder = None

    @rule()
    def lose_holder(self):
        self.lose("lost")

    @rule()
    def arm(self):
        refusal = self.hammer.arm()
        assert bool(refusal) == (self.is_stopped or self.holder is None)
        self.is_enabled = self.is_enabled or not refusal
        self.needs_person = self.needs_person and bool(refusal)

    @rule()
    def arm_again(self):
        refusal = self.hammer.arm_again()
        assert bool(refusal) == (self.needs_person or self.holder is None)
        self.is_enabled = self.is_enabled or not refusal

    @rule()
    def disarm(self):
        self.hammer.disarm("Anna")
        self.is_enabled, self.needs_person = False, True

    @rule()
    def disarm_for_now(self):
        self.hammer.disarm_for_now("hands are in")
        self.is_enabled = False

    @rule()
    def disarm_by_loss(self):
        self.hammer.disarm_by_loss("the recorder has gone")
        self.is_enabled = False

    @rule(who=st.sampled_from(["Anna", "Ben"]))
    def stop(self, who):
        self.stopped_by = self.stopped_by if self.is_stopped else who
        self.is_stopped, self.is_enabled, self.needs_person = True, False, True
        self.attempt(self.hammer.stop, who)
        assert self.holder is None or self.holder.state is HolderState.HOLDING

    @rule()
    def reset_stop(self):
        self.hammer.reset()
        self.is_stopped, self.stopped_by = False, ""

    @rule(obstacle=st.sampled_from([None, "the accelerometers are not armed"]))
    def release(self, obstacle):
        may_go = self.is_enabled and self.is_in_holder and not obstacle and bool(self.holder)
        works = bool(self.holder) and not self.holder.is_broken
        refusal = self.attempt(self.hammer.release, obstacle)
        assert bool(refusal) == (not may_go or not works)
        if not refusal:
            assert self.hammer.condition.message.startswith("released")
            self.accepted += 1
            self.is_in_holder = False

    @rule(confirm=CONFIRMED)
    def end_swing(self, confirm):
        swings = self.hammer.condition.state is HammerPlace.SWINGING
        self.attempt(self.hammer.end_swing, "back", confirm_return=confirm)
        if swings and self.holder and not confirm:
            self.is_in_holder = True

    @rule()
    def confirm_held(self):
        if not self.attempt(self.hammer.confirm_held):
            self.is_in_holder = True

    @invariant()
    def nothing_lets_go_but_an_accepted_release(self):
        assert sum(holder.releases for holder in self.holders) == self.accepted

    @invariant()
    def it_goes_where_the_table_leads(self):
        for before, after in pairwise(condition.state for condition in self.told):
            assert after in (before, *TRANSITIONS[before])

    @invariant()
    def the_condition_is_what_the_rules_say_and_has_been_told(self):
        condition = self.hammer.condition
        assert condition == self.told[-1]
        assert condition.armed == self.is_enabled
        assert (condition.disarmed_by is Disarming.EMERGENCY_STOP) == self.is_stopped
        assert condition.needs_person == self.needs_person
        assert condition.stopped_by == self.stopped_by
        assert condition.message
        assert "None" not in condition.message
        assert self.lost_for in condition.message
        assert self.holder is None or (condition.state is HammerPlace.HELD) == self.is_in_holder


TestInterlock = Interlock.TestCase
TestInterlock.settings = settings(
    max_examples=60, stateful_step_count=40, suppress_health_check=[HealthCheck.too_slow]
)


def test_causes_of_a_disarming_are_those_of_the_message():
    assert all(getattr(HammerState, value.name) == value for value in Disarming)


class AngledHolder(Holder):
    """Moves half of the way each time it is asked."""

    angle = 0.0

    def set_angle(self, angle):
        self._obey(HolderState.HOLDING)
        self.angle = angle if self.angle else angle / 2.0
        return self.angle == angle


def test_a_holder_moves_the_hammer_only_while_it_is_held_and_armed():
    hammer, holder = GuardedHammer(lambda _: None), AngledHolder()
    fixed = GuardedHammer(lambda _: None)
    fixed.take(Holder(), confirm_return=False)
    fixed.arm()
    assert fixed.set_angle(0.1) == "the holder cannot set a release angle"
    hammer.take(holder, confirm_return=False)
    assert "not armed" in hammer.set_angle(0.1)
    hammer.arm()
    for is_turning in (True, False):
        assert bool(hammer.set_angle(0.1)) == hammer.is_turning == is_turning
    assert (holder.angle, holder.releases) == (0.1, 0)
    hammer.release(None)
    assert "wait for the swing to end" in hammer.set_angle(0.2)
    hammer.stop()
    assert "reset it first" in hammer.arm()
    assert "emergency stop" in hammer.set_angle(0.2)
    assert holder.angle == 0.1


def test_a_hammer_that_was_put_back_is_held_by_the_next_holder_too():
    hammer = GuardedHammer(lambda _: None)
    hammer.take(Holder(), confirm_return=True)
    hammer.arm()
    hammer.release(None)
    hammer.end_swing("back", confirm_return=True)
    for expected in (HammerPlace.AWAY, HammerPlace.HELD):
        hammer.drop()
        hammer.take(Holder(), confirm_return=True)
        assert hammer.condition.state is expected
        hammer.confirm_held()
