"""A person at the command line asks a real hammer node."""

import os
import subprocess
import sys

import pytest
from impact_rig_msgs.msg import HammerState
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.hammer_client import HammerClient

TIMEOUT = 60.0


@pytest.fixture
def client(ros_domain, harness, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    harness.add(HammerNode)
    with HammerClient("", TIMEOUT) as client:
        yield client


def test_every_word_does_what_it_says(client, harness):
    states = harness.listen(interfaces.HAMMER_STATE)
    for action, armed, disarmed_by in (
        ("arm", True, HammerState.OPERATOR),
        ("disarm", False, HammerState.OPERATOR),
        ("stop", False, HammerState.EMERGENCY_STOP),
        ("reset", False, HammerState.OPERATOR),
    ):
        states.messages.clear()
        assert client.ask(action)
        wanted = (armed, disarmed_by)
        states.wait(
            lambda messages, wanted=wanted: any(
                (item.armed, item.disarmed_by) == wanted for item in messages
            )
        )
    assert client.ask("confirm") == "held"


def test_the_state_is_told_in_words(client, harness):
    assert harness.call(Trigger, interfaces.ARM_HAMMER).success
    report = client.read()
    assert (report.place, report.is_armed, report.holder) == ("held", True, "virtual rig")


def test_a_refusal_is_an_error_with_the_reason(client):
    client.ask("stop")
    with pytest.raises(DeviceError, match="refused: an emergency stop lasts"):
        client.ask("arm")


def test_a_rig_that_is_not_there_is_said(ros_domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    with (
        HammerClient("nobody", 0.1) as client,
        pytest.raises(DeviceError, match="no hammer says what it does within"),
    ):
        client.read()


def test_the_command_prints_an_answer(ros_domain, harness):
    harness.add(HammerNode)
    outcome = subprocess.run(
        [sys.executable, "-m", "impact_rig.cli.main", "hammer"],
        env={**os.environ, "ROS_DOMAIN_ID": str(ros_domain)},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=True,
    )
    assert outcome.stdout == "held, not armed; holder: virtual rig\n"
