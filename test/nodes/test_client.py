"""A person at the command line asks a real hammer node."""

import os
import signal

import pytest
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import HammerState
from rclpy.exceptions import InvalidNamespaceException

from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import describe_caller
from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.nodes.client import HammerClient
from impact_rig.nodes.hammer import HammerNode

TIMEOUT = 60.0


@pytest.fixture
def client(harness):
    harness.add(HammerNode)
    with HammerClient("", TIMEOUT) as client:
        yield client


def test_every_word_does_what_it_says_or_is_refused_with_the_reason(client, harness):
    states = harness.listen(interfaces.HAMMER_STATE)
    for action, armed, disarmed_by in (
        ("arm", True, HammerState.CAMPAIGN),
        ("disarm", False, HammerState.PERSON),
        ("stop", False, HammerState.EMERGENCY_STOP),
        ("reset", False, HammerState.PERSON),
    ):
        states.messages.clear()
        assert client.ask(action)
        wanted = (armed, disarmed_by)
        states.wait(
            lambda messages, wanted=wanted: any(
                (item.armed, item.disarmed_by) == wanted for item in messages
            )
        )
        if action == "arm":
            told = f"held, armed (armed by {describe_caller()}); holder: virtual rig"
            assert client.describe() == told
        if action == "stop":
            with pytest.raises(DeviceError, match="refused: an emergency stop lasts"):
                client.ask("arm")
    assert client.ask("confirm") == "held"


@pytest.fixture
def ctrl_c():
    """Let Ctrl-C interrupt, also where who runs the tests is deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_while_a_message_is_taken_ends_the_wait_and_leaves_the_client_usable(
    ctrl_c, client
):
    states = []

    def interrupt(message):
        states.append(message)
        if len(states) == 1:
            os.kill(os.getpid(), signal.SIGINT)

    client.listen(interfaces.HAMMER_STATE, interrupt)
    with pytest.raises(KeyboardInterrupt):
        client.spin_until(lambda: False, TIMEOUT)
    assert states
    assert client.ask("disarm")


def test_a_rig_that_is_not_there_is_said(ros_domain):
    with (
        HammerClient("no_such_rig", 0.1) as client,
        pytest.raises(DeviceError, match="no hammer publishes its state within"),
    ):
        client.describe()


def test_a_client_that_cannot_be_made_leaves_ctrl_c_as_it_was(ros_domain):
    with pytest.raises(InvalidNamespaceException) as error:
        HammerClient("no namespace", 0.1)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert error.tb is not None  # which keeps all that was begun


def test_a_goal_that_cannot_be_run_is_rejected_with_the_reason(start_process):
    start_process("campaign")
    with CampaignClient() as client:
        assert client.spin_until(client._action.server_is_ready, TIMEOUT)
        goal = RunCampaign.Goal(samples=["tin"], impacts=1)
        with pytest.raises(RigError, match="rejected: unknown sample 'tin'"):
            client.run(goal, None)
