"""Setting up: what is missing is said first, and what was interrupted goes on."""

import fcntl
import signal
import venv

import pytest
import workspace_setup

STARTED = "setting up "
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture
def nothing_to_install(copy):
    """Return a copy that needs no package: no download, and no colcon."""
    for path in copy.get_requirements("ros", "colcon", "scientific", "rig", "formats", "test"):
        path.write_text("# nothing\n")
    return copy


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


def test_the_next_call_goes_on_at_the_step_that_failed(nothing_to_install, run_rig):
    first = run_rig("exec", "true")
    assert first.code == 1
    assert "1/5 Python environment" in first.errors
    assert "error: messages (impact_rig_msgs): failed" in first.errors
    assert str(nothing_to_install.root / "log" / "setup.log") in first.errors
    second = run_rig("exec", "true")
    assert second.code == 1
    assert "Python environment" not in second.errors
    assert "error: messages (impact_rig_msgs): failed" in second.errors


@pytest.mark.parametrize("number", SIGNALS)
def test_an_interruption_ends_it_without_a_traceback(nothing_to_install, start_rig, number):
    process = start_rig("exec", "true")
    assert process.stderr.readline().startswith(STARTED)
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGINT
    assert errors.strip() == "interrupted: the next call goes on with the set-up"
    assert not nothing_to_install.steps["python"].is_fresh()


def test_two_set_ups_of_one_workspace_wait_for_each_other(nothing_to_install, start_rig):
    with (nothing_to_install.root / "setup.py").open() as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        process = start_rig("exec", "true")
        assert process.stderr.readline().startswith("waiting: ")
        fcntl.flock(other, fcntl.LOCK_UN)
    assert process.stderr.readline().startswith(STARTED)
    process.terminate()
    process.communicate(timeout=60)
