"""`impact-rig doctor` on this very installation."""

import json
from types import SimpleNamespace

import pytest

from impact_rig.cli import doctor
from impact_rig.cli.doctor import (
    Status,
    check_conversation,
    check_discovery,
    check_distribution,
    check_domain,
    check_libraries,
)
from impact_rig.cli.libraries import Library

from .conftest import finish, start_command, start_python


@pytest.fixture
def shelf(tmp_path, monkeypatch):
    """Return a folder whose modules Python finds."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path


def test_what_loads_is_shown_with_its_version():
    (finding,) = check_libraries([Library("numpy", "numpy", "all", (1, 26))])
    assert finding.status is Status.OK
    assert finding.text[0].isdigit()


@pytest.mark.parametrize(("is_needed", "status"), [(True, "fault"), (False, "warning")])
def test_what_is_missing_matters_as_much_as_it_is_needed(is_needed, status):
    library = Library("absent_here", "absent-here", "the view", is_needed=is_needed)
    (finding,) = check_libraries([library])
    assert finding.status.value == status
    assert finding.text == "missing; the view needs it"
    assert finding.advice


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("raise OSError('no such library: libx.so')", "libx.so"),
        ("import its_own_dependency", "its_own_dependency"),
        ("import os; os._exit(102)", "102"),
    ],
)
def test_what_does_not_load_is_a_fault_with_the_reason(shelf, code, reason):
    (shelf / "broken_here.py").write_text(code)
    (finding,) = check_libraries([Library("broken_here", "broken-here", "all")])
    assert finding.status is Status.FAULT
    assert finding.text.startswith("does not load: ")
    assert reason in finding.text


def test_another_distribution_is_a_fault():
    finding = check_distribution({"ROS_DISTRO": "humble"})
    assert finding.status is Status.FAULT
    assert "humble" in finding.text
    assert "Jazzy" in finding.advice


@pytest.mark.parametrize(
    ("domain", "status"),
    [
        ("", Status.OK),
        ("101", Status.OK),
        ("102", Status.WARNING),
        ("233", Status.FAULT),
        ("lab", Status.FAULT),
    ],
)
def test_domains_are_whole_numbers_that_leave_room_for_ports(domain, status):
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
def test_discovery_must_reach_this_host(environment, status):
    finding = check_discovery(environment)
    assert finding.status is status
    assert bool(finding.advice) == (status is not Status.OK)


@pytest.mark.parametrize(
    ("free", "status"), [(5e9, Status.OK), (1e9, Status.WARNING), (5e7, Status.FAULT)]
)
def test_a_campaign_needs_room(tmp_path, monkeypatch, free, status):
    usage = SimpleNamespace(free=free, total=1e10)
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda _: usage)
    finding = doctor.check_disk(tmp_path)
    assert finding.status is status
    assert bool(finding.advice) == (status is not Status.OK)


def test_shared_memory_may_be_absent_or_small(tmp_path, monkeypatch):
    assert doctor.check_shared_memory(tmp_path / "absent").status is Status.WARNING
    assert doctor.check_shared_memory(tmp_path).status is Status.OK
    usage = SimpleNamespace(free=1e6, total=6.4e7)
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda _: usage)
    finding = doctor.check_shared_memory(tmp_path)
    assert finding.status is Status.WARNING
    assert "1 MB of 64 MB" in finding.text


@pytest.fixture(scope="module")
def report():
    """Return what it says here."""
    code, output, _ = finish(start_command("doctor", "--json"))
    return code, json.loads(output)


def test_this_installation_is_healthy(report):
    code, content = report
    faults = [item for item in content["findings"] if item["status"] == "fault"]
    assert faults == []
    assert content["healthy"]
    assert code == 0


def test_two_processes_really_talk(report):
    found = {item["name"]: item for item in report[1]["findings"]}
    assert found["two processes"]["text"].startswith("hear each other")
    assert found["middleware"]["text"].startswith("rmw_")


def test_a_middleware_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_of_nobody")
    (finding,) = check_conversation()
    assert finding.status is Status.FAULT
    assert "rmw_of_nobody" in finding.text
    assert "RMW_IMPLEMENTATION must name an installed one" in finding.advice


def test_without_ros_it_says_so_and_still_reports_the_rest(monkeypatch):
    monkeypatch.setattr(doctor.util, "find_spec", lambda _: None)
    for finding in (check_distribution({}), *check_conversation()):
        assert finding.status is Status.FAULT
        assert "there is no rclpy" in finding.text
    code = "import sys; import impact_rig.cli.doctor; print('rclpy' in sys.modules)"
    assert finish(start_python("-c", code)) == (0, "False\n", "")
