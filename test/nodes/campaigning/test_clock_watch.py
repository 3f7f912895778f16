"""Computers whose clocks differ are named."""

import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.campaigning.clock_watch import SEVERAL
from impact_rig.nodes.messages import stamp_to_msg

NANO = 1e-9


@pytest.fixture
def campaign(harness):
    # In a rig's namespace: another rig's clocks are none of its business.
    return harness.add(CampaignNode, namespace="rig1")


def say(harness, publisher, name, seconds_ahead):
    message = DiagnosticArray(status=[DiagnosticStatus(name=name, level=b"\0")])
    message.header.stamp = stamp_to_msg(time.time_ns() + round(seconds_ahead / NANO))
    publisher.publish(message)
    assert publisher.wait_for_all_acked()


@pytest.fixture
def publisher(harness, campaign):
    made = harness.advertise(interfaces.DIAGNOSTICS)
    harness.wait_until(lambda: made.get_subscription_count() == 1)
    return made


def test_clocks_that_agree_are_not_mentioned(harness, campaign, publisher):
    for ahead in (0.0, -0.4, 0.4, 0.0, -30.0):
        # One that was on its way for long is no other clock.
        say(harness, publisher, "/rig1/hammer", ahead)
    harness.wait_until(
        lambda: (
            not campaign.find_warning()
            and len(campaign._clocks._delays.get("/rig1/hammer", ())) == SEVERAL
        )
    )
    assert not campaign.find_warning()


def test_clocks_that_differ_are_named_with_how_far(harness, campaign, publisher):
    for _ in range(SEVERAL):
        say(harness, publisher, "/rig1/hammer", 3.0)
        say(harness, publisher, "/rig1/accelerometer", -3.0)
        say(harness, publisher, "/rig2/hammer", 3.0)
    harness.wait_until(campaign.find_warning)
    warning = campaign.find_warning()
    assert warning.startswith(
        "clocks differ from that of campaign: accelerometer 3.0 s behind, hammer 3.0 s ahead;"
    )
    for _ in range(SEVERAL):
        say(harness, publisher, "/rig1/hammer", 0.0)
        say(harness, publisher, "/rig1/accelerometer", 0.0)
    harness.wait_until(lambda: not campaign.find_warning())
