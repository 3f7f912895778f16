"""`impact-rig doctor` on this very installation."""

import pytest

from impact_rig.cli import doctor
from impact_rig.cli.doctor import DOUBT, FAULT, OK, check_conversation, check_library, check_ros
from impact_rig.cli.libraries import LIBRARIES, Library, describe_missing, explain_missing
from impact_rig.core.given.errors import RigError

from .conftest import finish, start_command, start_python


@pytest.mark.parametrize(("is_needed", "status"), [(True, "fault"), (False, "warning")])
def test_what_is_missing_matters_as_much_as_it_is_needed(is_needed, status):
    finding = check_library(Library("absent_here", "absent-here", is_needed))
    assert (finding.status, finding.text) == (status, "missing")
    assert finding.advice


def test_a_module_belongs_to_the_library_that_brings_it():
    assert 'pip install "distributed"' in describe_missing("distributed.client")
    assert describe_missing("antigravity") is None
    for module in ("rclpy.node", "lifecycle_msgs.msg", "std_srvs", "rcl_interfaces"):
        assert describe_missing(module).startswith("rclpy is not installed: analyze, export")
    with pytest.raises(RigError, match="rclpy is not installed"), explain_missing():
        raise ModuleNotFoundError(name="action_msgs")


def test_another_distribution_is_a_fault(monkeypatch):
    monkeypatch.setenv("ROS_DISTRO", "humble")
    finding = check_ros()[0]
    assert (finding.status, finding.text) == (FAULT, "humble")
    assert "jazzy" in finding.advice


def test_a_folder_that_cannot_be_written_is_a_fault(tmp_path):
    assert doctor.check_disk(tmp_path).status == OK
    assert doctor.check_disk(tmp_path / "absent").status == FAULT


def test_this_installation_is_healthy():
    code, output, _ = finish(start_command("doctor"))
    assert (code, output.splitlines()[-1]) == (0, "The rig can work.")
    assert "a node answers a command" in output


def test_a_middleware_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_unknown")
    finding = check_conversation()
    assert finding.status == FAULT
    assert "rmw_unknown" in finding.text


def test_without_ros_it_says_so(monkeypatch):
    monkeypatch.setattr(doctor.util, "find_spec", lambda _: None)
    finding = check_conversation()
    assert (finding.status, finding.text) == (DOUBT, "not tried: there is no rclpy")
    (rclpy,) = (item for item in LIBRARIES if item.module == "rclpy")
    assert check_library(rclpy).status == DOUBT
    monkeypatch.setenv("ROS_DISTRO", "jazzy")  # which is sourced, and should have it
    assert check_conversation().status == check_library(rclpy).status == FAULT
    code = "import sys; import impact_rig.cli.doctor; print('rclpy' in sys.modules)"
    assert finish(start_python("-c", code)) == (0, "False\n", "")
