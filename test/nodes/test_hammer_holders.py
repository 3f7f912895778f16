"""The hammer node with a relay on a serial port: unplugged, silent, in other hands, misnamed."""

import signal
import threading

import pytest
from impact_rig_msgs.msg import AcquisitionState, HammerState, RecorderState
from impact_rig_msgs.srv import Release
from rclpy.node import Node
from std_srvs.srv import Trigger

from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.testing.peers.serial_relay import SerialRelayPeer

serial = pytest.importorskip("serial", reason="the extra `serial` is not installed")

CYCLES = 2


@pytest.fixture
def releases():
    """Return a count of what the relay has let go."""
    return threading.Semaphore(0)


@pytest.fixture
def board(releases):
    peer = SerialRelayPeer(releases.release)
    peer.start()
    yield peer
    peer.stop()


@pytest.fixture
def rig_file(tmp_path, board):
    path = tmp_path / "rig.toml"
    write_rig_file(path, f'driver = "serial"\nport = "{board.port}"\nanswers = true')
    return path


@pytest.fixture
def states(harness):
    return harness.listen(interfaces.HAMMER_STATE)


def write_rig_file(path, holder):
    path.write_text(f"{read_template()}\n[holder]\n{holder}\n")


def wait_for(states, condition):
    """Wait until the newest state fulfils a condition; return it."""
    return states.wait(lambda messages: bool(messages) and condition(messages[-1]))[-1]


def add_hammer(harness, rig_file):
    return harness.add(
        HammerNode, rig_file=str(rig_file), reconnect_period=0.02, require_recorder=False
    )


def make_ready(harness):
    harness.advertise(interfaces.ACQUISITION_STATE).publish(
        AcquisitionState(state=AcquisitionState.ARMED, record=1, sample="a")
    )
    harness.advertise(interfaces.RECORDER_STATE).publish(
        RecorderState(recording=True, uri="a.mcap")
    )


def arm(harness):
    return harness.call(Trigger, interfaces.ARM_HAMMER)


def release(harness):
    request = Release.Request(record=1, sample="a", impact=1, attempt=1)
    return harness.ask(Release, interfaces.RELEASE_HAMMER, request)


def test_a_release_moves_the_relay_once_and_it_holds_again(
    harness, board, releases, rig_file, states
):
    add_hammer(harness, rig_file)
    make_ready(harness)
    assert arm(harness).success
    assert release(harness).success
    assert releases.acquire(timeout=20.0)
    state = wait_for(states, lambda state: state.message == "back in the holder")
    assert state.holder == f"relay at {board.port}"
    assert board.is_holding
    assert not releases.acquire(blocking=False)


def test_an_unplugged_relay_disarms_and_the_node_is_ready_again_when_it_is_back(
    harness, board, releases, rig_file, states
):
    node = add_hammer(harness, rig_file)
    for _ in range(CYCLES):
        states.messages.clear()
        assert arm(harness).success
        board.unplug()
        lost = wait_for(states, lambda state: state.state == HammerState.FAULT)
        assert (lost.armed, lost.disarmed_by) == (False, HammerState.LOSS)
        assert "is gone" in lost.message or "there is no serial port" in lost.message
        harness.wait_until(lambda: not node.is_configured)
        harness.wait_until(lambda: node.fault == states.messages[-1].message)
        assert "nothing holds the hammer: " in release(harness).message
        board.plug()
        back = wait_for(states, lambda state: state.state == HammerState.HELD)
        assert (back.armed, back.disarmed_by) == (False, HammerState.LOSS)
        harness.wait_until(lambda: node.is_active)
        assert not node.fault
        assert board.is_holding
    assert not releases.acquire(blocking=False)


def test_a_relay_that_does_not_obey_has_released_nothing(
    harness, board, releases, rig_file, states
):
    add_hammer(harness, rig_file)
    commands = harness.listen(interfaces.RELEASE)
    make_ready(harness)
    assert arm(harness).success
    board.is_stuck = True
    answer = release(harness)
    assert not answer.success
    assert "says that it is holding, though it was told to be released" in answer.message
    states.wait(lambda messages: any(item.state == HammerState.FAULT for item in messages))
    assert not commands.messages
    assert not releases.acquire(blocking=False)


def test_a_relay_that_falls_silent_is_lost(harness, board, rig_file, states):
    add_hammer(harness, rig_file)
    board.distort = lambda answer: b""
    lost = wait_for(states, lambda state: state.state == HammerState.FAULT)
    assert "did not answer within 0.4 s" in lost.message
    board.distort = lambda answer: answer
    wait_for(states, lambda state: state.state == HammerState.HELD)


def test_a_relay_in_other_hands_is_used_when_it_is_free(harness, board, rig_file, states):
    with serial.Serial(board.port, exclusive=True):
        node = add_hammer(harness, rig_file)
        assert f"{board.port} is in use by" in node.fault
        assert wait_for(states, lambda state: state.state == HammerState.FAULT)
    wait_for(states, lambda state: state.state == HammerState.HELD)


def test_a_mistake_in_the_rig_file_is_named_with_its_line_and_can_be_mended(
    harness, board, rig_file, states
):
    good = rig_file.read_text()
    number = good.splitlines().index(f'port = "{board.port}"') + 1
    rig_file.write_text(good.replace("port =", "prot ="))
    node = add_hammer(harness, rig_file)
    assert f"rig.toml: line {number}: [holder] has an unknown key 'prot'" in node.fault
    rig_file.write_text(good)
    wait_for(states, lambda state: state.state == HammerState.HELD)
    assert arm(harness).success


def test_a_driver_that_there_is_not_is_named(harness, rig_file, states):
    write_rig_file(rig_file, 'driver = "magnet"')
    node = add_hammer(harness, rig_file)
    assert "driver of [holder] is 'magnet': it must be one of" in node.fault


def test_the_end_of_the_process_does_not_let_go(
    harness, start_process, board, releases, rig_file, states
):
    process = start_process("hammer", rig_file=str(rig_file))
    wait_for(states, lambda state: state.message == "held, not armed")
    make_ready(harness)
    assert arm(harness).success
    process.send_signal(signal.SIGINT)
    process.wait()
    assert board.is_holding
    assert not releases.acquire(blocking=False)


def test_who_else_is_in_the_domain_of_a_relay_is_named_once(harness, rig_file):
    twin = Node("peer", context=harness.peer.context)  # the graph lists their name twice
    node = add_hammer(harness, rig_file)
    harness.wait_until(lambda: "/peer" in node.describe_warning())
    assert (
        "could release the hammer: /peer; give the rig a ROS_DOMAIN_ID" in node.describe_warning()
    )
    twin.destroy_node()


def test_a_virtual_hammer_is_anybody_s(harness):
    node = harness.add(HammerNode)
    harness.wait_until(lambda: "peer" in node.get_node_names())
    node._look_for_others()
    assert not node.describe_warning()
