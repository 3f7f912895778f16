"""What the environment says of ROS 2, and two processes that cannot hear each other."""

import pytest

from impact_rig.cli.checks.findings import Status
from impact_rig.cli.checks.ros_checks import (
    check_conversation,
    check_discovery,
    check_distribution,
    check_domain,
)


def test_another_distribution_is_a_fault() -> None:
    finding = check_distribution({"ROS_DISTRO": "humble"})
    assert finding.status is Status.FAULT
    assert "humble" in finding.text
    assert "Jazzy" in finding.advice


@pytest.mark.parametrize(
    ("domain", "status"),
    [
        ("", Status.OK),
        ("0", Status.OK),
        ("101", Status.OK),
        ("102", Status.WARNING),
        ("232", Status.WARNING),
        ("233", Status.FAULT),
        ("-1", Status.FAULT),
        ("lab", Status.FAULT),
    ],
)
def test_domains_are_whole_numbers_that_leave_room_for_ports(domain: str, status: Status) -> None:
    finding = check_domain({"ROS_DOMAIN_ID": domain})
    assert finding.status is status
    assert bool(finding.advice) == (status is not Status.OK)


@pytest.mark.parametrize(
    ("environment", "status"),
    [
        ({}, Status.OK),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, Status.OK),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, Status.FAULT),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "EVERYWHERE"}, Status.FAULT),
        ({"ROS_LOCALHOST_ONLY": "1"}, Status.WARNING),
    ],
)
def test_discovery_must_reach_this_host(environment: dict[str, str], status: Status) -> None:
    finding = check_discovery(environment)
    assert finding.status is status
    assert bool(finding.advice) == (status is not Status.OK)


def test_processes_that_do_not_meet_are_given_up_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    (finding,) = check_conversation(timeout=2.0)
    assert finding.status is Status.FAULT
    assert "did not hear each other within 2 s" in finding.text
    assert finding.advice
