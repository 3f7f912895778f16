"""The hammer goes only when its hit can be recorded; what takes the operator's enable."""

import signal
import threading

import pytest
from fakes.relay_board import RelayBoard
from impact_rig_msgs.msg import AcquisitionState, HammerState, RecorderState
from impact_rig_msgs.srv import Act, Release

from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode

HIT = {"record": 4, "sample": "steel small", "impact": 2, "attempt": 1}
ARMED, OTHER = (
    AcquisitionState(state=AcquisitionState.ARMED, record=record, sample="steel small")
    for record in (4, 3)
)
RECORDING = RecorderState(recording=True, uri="a.mcap")


class Rig:
    """A hammer among accelerometers and a recorder that say what a test wants."""

    def __init__(self, harness) -> None:
        self._harness = harness
        self.acquisition = harness.advertise(interfaces.ACQUISITION_STATE)
        self.recorder = harness.advertise(interfaces.RECORDER_STATE)
        self.campaign = harness.advertise(interfaces.CAMPAIGN_STATE)
        self.states = harness.listen(interfaces.HAMMER_STATE)
        self.releases = harness.listen(interfaces.RELEASE)
        self.hammer = None

    def start(self, *, arming=ARMED, recorder=RECORDING, arm=True, **parameters):
        """Start the hammer node, ready and armed."""
        self.hammer = self._harness.add(HammerNode, **{"swing_time": 0.01, **parameters})
        self.acquisition.publish(arming)
        self.recorder.publish(recorder)
        self._harness.wait_until(self.has_heard)
        if arm:
            # A busy machine may stand still, and the hammer then refuses for a while.
            self._harness.wait_until(lambda: self.call(interfaces.ARM_HAMMER).success)

    def has_heard(self):
        """Whether the hammer has heard of accelerometers and recorder."""
        return None not in (self.hammer._accelerometer.state, self.hammer._recorder.state)

    def call(self, name):
        return self._harness.call(Act, name)

    def ask(self, **changes):
        request = Release.Request(**{**HIT, **changes})
        return self._harness.call(Release, interfaces.RELEASE_HAMMER, request)

    def release(self, **changes):
        """Ask again while the hammer has not heard of the rest of the rig."""
        request = Release.Request(**{**HIT, **changes})
        return self._harness.ask(Release, interfaces.RELEASE_HAMMER, request)

    def wait(self, condition):
        """Return the first state that fulfils a condition."""
        found = self.states.wait(lambda messages: any(condition(item) for item in messages))
        return next(item for item in found if condition(item))

    def wait_for_loss(self):
        return self.wait(lambda item: item.disarmed_by == HammerState.LOSS)


@pytest.fixture
def rig(harness):
    return Rig(harness)


def test_the_hammer_refuses_with_the_reason_and_says_not_yet_while_others_are_not_ready(rig):
    rig.start(arming=AcquisitionState(message="ready"), arm=False)
    assert "not armed: arm it first" in rig.ask().message
    rig._harness.wait_until(lambda: rig.call(interfaces.ARM_HAMMER).success)
    assert "the accelerometers are not armed (ready): call accel" in rig.ask().message
    rig.acquisition.publish(OTHER)
    rig._harness.wait_until(lambda: rig.hammer._armed_record == OTHER.record)
    answer = rig.ask()
    assert (answer.success, answer.later) == (False, True)
    assert "armed for record 3" in answer.message
    assert not rig.releases.messages
    rig.acquisition.publish(ARMED)
    assert rig.release().success


def test_accelerometers_at_fault_or_a_recorder_that_stops_disarm_the_hammer_until_they_are_back(
    rig,
):
    rig.start()
    rig.acquisition.publish(
        AcquisitionState(state=AcquisitionState.FAULT, message="the cable is out")
    )
    state = rig.wait_for_loss()
    assert not state.armed
    assert state.message == "the accelerometer's device is lost: the cable is out"
    assert "the cable is out" in rig.call(interfaces.ARM_HAMMER).message
    assert "the cable is out" in rig.release().message
    rig.acquisition.publish(AcquisitionState(state=AcquisitionState.IDLE))
    rig.acquisition.publish(ARMED)
    rig._harness.wait_until(lambda: rig.call(interfaces.ARM_HAMMER).success)
    rig.recorder.publish(RecorderState(recording=False, message="disk full"))
    rig.wait(lambda item: "nothing is being recorded: disk full" in item.message)
    assert not rig.states.messages[-1].armed
    rig.recorder.publish(RecorderState(recording=True, uri="b.mcap"))
    rig._harness.wait_until(lambda: rig.call(interfaces.ARM_HAMMER).success)
    assert rig.release().success


@pytest.mark.parametrize("name", ["acquisition", "recorder", "campaign"])
def test_a_node_that_goes_disarms_the_hammer(rig, harness, name):
    rig.start()
    harness.peer.destroy_publisher(getattr(rig, name))
    assert "has gone: start it again" in rig.wait_for_loss().message
    assert "has gone" in rig.call(interfaces.ARM_HAMMER).message


def test_a_stop_works_in_every_state_of_the_node_and_outlasts_it(rig, harness):
    rig.hammer = node = harness.add(HammerNode, autostart=False)
    assert rig.call(interfaces.EMERGENCY_STOP).success
    rig.wait(lambda item: item.disarmed_by == HammerState.EMERGENCY_STOP)
    for transition in (node.trigger_configure, node.trigger_activate, node.trigger_deactivate):
        harness.wait(harness.executor.create_task(transition))
        assert "reset it first" in rig.call(interfaces.ARM_HAMMER).message
    assert rig.call(interfaces.RESET_HAMMER).message == (
        "the emergency stop is ended; the hammer is not armed: arm it first"
    )
    assert "not active" in rig.call(interfaces.ARM_HAMMER).message


@pytest.fixture
def start_by_hand(rig, tmp_path):
    """Return a function that starts a hammer which an operator releases within some time."""

    def start(patience):
        path = tmp_path / "rig.toml"
        holder = f'[holder]\ndriver = "manual"\npatience = "{patience}"\n'
        path.write_text(f"{read_template()}\n{holder}")
        rig.start(rig_file=str(path))

    return start


def test_an_operator_may_take_his_time_and_everybody_knows_how_long(rig, start_by_hand):
    start_by_hand("5 min")
    answer = rig.release()
    assert answer.success
    assert answer.latest_contact == 300.0
    assert rig.releases.wait_for_count(1)[0].latest_contact == 300.0
    assert rig.wait(lambda item: item.message == "the operator may let go").holder == "operator"
    rig.acquisition.publish(AcquisitionState(state=AcquisitionState.IDLE, record=4))
    state = rig.wait(lambda item: item.message == "the record has ended")
    assert state.state == HammerState.HELD
    assert state.armed


def test_an_operator_who_does_not_let_go_is_not_waited_for_for_ever(rig, start_by_hand):
    start_by_hand("1 s")
    assert rig.release().success
    state = rig.wait(lambda item: item.message == "the hammer was not released within 1 s")
    assert state.state == HammerState.HELD


@pytest.mark.parametrize("asks_to_arm", [False, True])
def test_what_was_asked_of_a_stopped_process_does_not_fire_when_it_goes_on(
    harness, start_process, asks_to_arm
):
    acquisition = harness.advertise(interfaces.ACQUISITION_STATE)
    recorder = harness.advertise(interfaces.RECORDER_STATE)
    hammer = start_process("hammer", swing_time=0.01)
    states = harness.listen(interfaces.HAMMER_STATE)
    states.wait(lambda messages: messages[-1].state == HammerState.HELD)
    for publisher, message in ((acquisition, ARMED), (recorder, RECORDING)):
        harness.wait_until(lambda it=publisher: it.get_subscription_count() == 1)
        publisher.publish(message)
    assert harness.call(Act, interfaces.ARM_HAMMER).success
    states.wait(lambda messages: messages[-1].armed)
    hammer.process.send_signal(signal.SIGSTOP)
    releases = harness.listen(interfaces.RELEASE)
    arm = harness.peer.create_client(Act, interfaces.ARM_HAMMER)
    release = harness.peer.create_client(Release, interfaces.RELEASE_HAMMER)
    for client in (arm, release):
        harness.wait_until(client.service_is_ready)
    armed = arm.call_async(Act.Request()) if asks_to_arm else None
    released = release.call_async(Release.Request(**HIT))
    threading.Event().wait(interfaces.LEASE + 0.2)
    states.messages.clear()
    hammer.process.send_signal(signal.SIGCONT)
    if armed is not None:
        assert "stood still" in harness.wait(armed).message
    assert "not armed (the hammer node stood still" in harness.wait(released).message
    first = states.wait_for_count(1)[0]  # before anything else that was asked
    assert first.disarmed_by == HammerState.LOSS
    assert not any(state.armed for state in states.messages)
    assert not releases.messages
    # When all is known again, a person arms, and the hammer goes.
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
    assert harness.ask(Release, interfaces.RELEASE_HAMMER, Release.Request(**HIT)).success
    assert len(releases.wait_for_count(1)) == 1


def test_the_end_of_the_process_does_not_let_go(rig, harness, start_process, tmp_path):
    pytest.importorskip("serial", reason="the extra `serial` is not installed")
    releases = threading.Semaphore(0)
    board = RelayBoard(releases.release)
    board.plug()
    path = tmp_path / "rig.toml"
    path.write_text(f'{read_template()}\n[holder]\ndriver = "serial"\nport = "{board.port}"\n')
    process = start_process("hammer", rig_file=str(path))
    rig.wait(lambda state: state.message == "held, not armed")
    harness.wait_until(lambda: rig.call(interfaces.ARM_HAMMER).success)
    process.process.send_signal(signal.SIGINT)
    process.wait()
    assert board.is_holding
    assert not releases.acquire(blocking=False)
    board.stop()


def test_one_arming_lets_the_hammer_go_once_whatever_is_asked(rig):
    rig.start()
    answer = rig.release()
    assert answer.success, answer.message
    (command,) = rig.releases.wait_for_count(1)
    assert (command.record, command.sample, command.impact, command.swing_time) == (
        4, "steel small", 2, 0.01,
    )  # fmt: skip
    seen = rig.states.wait(lambda messages: messages[-1].message == "back in the holder")
    assert [item.state for item in seen][-2:] == [HammerState.SWINGING, HammerState.HELD]
    # Said again, as to who comes late: no other arming.
    rig.acquisition.publish(ARMED)
    assert rig.release().success  # The answer to the first one may have been lost.
    refused = rig.release(attempt=2)
    assert refused.message == (
        "the hammer was released for record 4 already: arm the accelerometers again"
    )
    assert len(rig.releases.messages) == 1
