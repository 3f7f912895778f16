"""The hammer node with a relay on a serial port: unplugged and back; the end of the process."""

import signal
import threading

import pytest
from fakes.relay_board import RelayBoard
from impact_rig_msgs.msg import HammerState

from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode

from .test_hammer_safety import Rig

pytest.importorskip("serial", reason="the extra `serial` is not installed")

CYCLES = 2
OPTIONS = {"reconnect_period": 0.02, "require_recorder": False}


@pytest.fixture
def releases():
    """Return a count of what the relay has let go."""
    return threading.Semaphore(0)


@pytest.fixture
def board(releases):
    peer = RelayBoard(releases.release)
    peer.plug()
    yield peer
    peer.stop()


@pytest.fixture
def rig_file(tmp_path, board):
    path = tmp_path / "rig.toml"
    write_rig_file(path, f'driver = "serial"\nport = "{board.port}"')
    return path


@pytest.fixture
def rig(harness):
    return Rig(harness)


@pytest.fixture
def add_hammer(harness, rig_file):
    """Return a function that starts a hammer without accelerometer or recorder."""
    return lambda: harness.add(HammerNode, rig_file=str(rig_file), **OPTIONS)


def write_rig_file(path, holder):
    path.write_text(f"{read_template()}\n[holder]\n{holder}\n")


def test_an_unplugged_relay_disarms_and_the_node_is_ready_again_when_it_is_back(
    harness, rig, board, releases, add_hammer
):
    node = add_hammer()
    for _ in range(CYCLES):
        rig.states.messages.clear()
        assert rig.call(interfaces.ARM_HAMMER).success
        board.unplug()
        lost = rig.wait_for_newest(lambda state: state.state == HammerState.FAULT)
        assert (lost.armed, lost.disarmed_by) == (False, HammerState.LOSS)
        assert "is gone" in lost.message or "cannot be opened" in lost.message
        harness.wait_until(lambda: not node.is_configured)
        harness.wait_until(lambda: node.fault == rig.states.messages[-1].message)
        assert "nothing holds the hammer: " in rig.release().message
        board.plug()
        back = rig.wait_for_newest(lambda state: state.state == HammerState.HELD)
        assert (back.armed, back.disarmed_by) == (False, HammerState.LOSS)
        harness.wait_until(lambda: node.is_active)
        assert not node.fault
        harness.wait_until(lambda: board.is_holding)
    assert not releases.acquire(blocking=False)


def test_the_end_of_the_process_does_not_let_go(rig, start_process, board, releases, rig_file):
    process = start_process("hammer", rig_file=str(rig_file), require_recorder=False)
    rig.wait_for_newest(lambda state: state.message == "held, not armed")
    rig._harness.wait_until(lambda: rig.call(interfaces.ARM_HAMMER).success)
    process.send_signal(signal.SIGINT)
    process.wait()
    assert board.is_holding
    assert not releases.acquire(blocking=False)
