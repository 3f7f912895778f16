"""Setting up: what is missing is said first, and what was interrupted goes on."""

import fcntl
import signal
import venv

import workspace_setup
from workspace import find_stale

STARTED = "setting up "


def test_a_missing_compiler_is_said_before_anything_is_made(copy, run_rig, tmp_path_factory):
    empty = tmp_path_factory.mktemp("bin")
    done = run_rig("exec", "true", PATH=str(empty), CC="", CXX="")
    assert done.code == 1
    assert "no C++ compiler is on PATH" in done.errors
    assert "build-essential" in done.errors
    assert len(done.errors.splitlines()) == 1
    assert not copy.venv.exists()


def test_another_ros_distribution_ends_in_one_sentence(copy, run_rig):
    done = run_rig("exec", "true", ROS_DISTRO="rolling")
    assert done.code == 1
    assert done.errors.startswith("error: ROS 2 rolling is sourced")
    assert len(done.errors.splitlines()) == 1


def test_a_colcon_on_path_counts_only_if_the_environment_s_python_has_it(
    copy, tmp_path, monkeypatch
):
    command = tmp_path / "colcon"
    command.write_text("#!/bin/sh\n")
    command.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("PYTHONPATH", raising=False)
    venv.create(copy.venv)
    assert not workspace_setup.has_colcon(copy)
    (copy.site_packages / "colcon_core").mkdir()
    assert workspace_setup.has_colcon(copy)


def test_a_step_that_fails_is_named_with_its_log_and_begins_the_next_call(fresh, run_rig):
    venv.create(fresh.venv)
    fresh.steps["messages"].stamp.unlink()
    done = run_rig("exec", "true")
    assert done.code == 1
    # There is no colcon.
    assert "error: messages (impact_rig_msgs): failed" in done.errors
    assert str(fresh.root / "log" / "setup.log") in done.errors
    assert find_stale(fresh) == ["messages"]


def test_an_interruption_ends_it_without_a_traceback(copy, start_rig):
    process = start_rig("exec", "true")
    assert process.stderr.readline().startswith(STARTED)
    process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGINT
    assert errors.strip() == "interrupted: the next call goes on with the set-up"
    assert not copy.steps["python"].is_fresh()


def test_a_place_where_nothing_can_be_written_is_named(copy, run_rig):
    (copy.root / "log").write_text("in the way of the folder of this name")
    done = run_rig("exec", "true")
    assert done.code == 1
    assert done.errors.startswith(f"error: {copy.root / 'log'}: File exists: the set-up writes")


def test_two_set_ups_of_one_workspace_wait_for_each_other(copy, start_rig):
    with (copy.root / "setup.py").open() as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        process = start_rig("exec", "true")
        assert process.stderr.readline().startswith("waiting: ")
        fcntl.flock(other, fcntl.LOCK_UN)
    assert process.stderr.readline().startswith(STARTED)
    process.terminate()
    process.communicate(timeout=60)
