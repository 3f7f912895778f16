"""What has changed is noticed and made again; an interrupted set-up goes on."""

import fcntl
import os
import re
import shutil
import signal
import sys
import venv

import pytest
import workspace_setup
from workspace import SetupError, Workspace, find_stale, find_workspace, make_environment

ALL = ["python", "packages", "messages", "nodes"]
IN_VENV = ["python", "packages"]


def append(path):
    path.write_bytes(path.read_bytes() + b"\n# changed\n")


def look_again(workspace):
    return find_stale(Workspace(workspace.root, workspace.is_ros_installed))


def test_in_a_fresh_clone_everything_is_to_be_made(copy):
    assert find_stale(copy) == ALL


def test_what_is_made_is_not_made_again(fresh):
    assert look_again(fresh) == []


@pytest.mark.parametrize(
    ("name", "stale"),
    [
        ("launch_scripts/requirements/locked/test.txt", ["packages"]),
        ("launch_scripts/requirements/locked/ros.txt", ["packages", "messages", "nodes"]),
        ("launch_scripts/requirements/locked/installer.txt", ALL),
        ("msg_config/CMakeLists.txt", ["messages"]),
        ("setup.py", ["nodes"]),
        ("package.xml", ["nodes"]),
        ("launch_scripts/rig.launch.py", ["nodes"]),
    ],
)
def test_a_changed_file_makes_stale_what_is_made_from_it(fresh, name, stale):
    append(fresh.root / name)
    assert look_again(fresh) == stale


def test_an_interface_may_come_go_and_change_its_name(fresh):
    message = fresh.root / "msg_config" / "msg" / "Impact.msg"
    shutil.copy(message, message.with_name("Blow.msg"))
    assert look_again(fresh) == ["messages"]
    message.unlink()
    assert look_again(fresh) == ["messages"]


@pytest.mark.parametrize(
    ("folder", "stale"),
    [(".venv", IN_VENV), ("install", ["messages", "nodes"]), ("install/impact_rig", ["nodes"])],
)
def test_what_was_deleted_is_made_again(fresh, folder, stale):
    shutil.rmtree(fresh.root / folder)
    assert look_again(fresh) == stale


def test_a_workspace_that_was_moved_or_gets_another_ros_is_set_up_again(fresh, tmp_path_factory):
    moved = tmp_path_factory.mktemp("elsewhere") / "rig"
    shutil.copytree(fresh.root, moved)
    assert find_stale(Workspace(moved, is_ros_installed=False)) == ALL
    assert find_stale(Workspace(fresh.root, is_ros_installed=True)) == ALL


def test_the_environment_may_be_entered_twice(copy):
    without_bytecode = {"PYTHONDONTWRITEBYTECODE": "1"}
    once = make_environment(
        copy, {"PATH": "/usr/bin", "LD_LIBRARY_PATH": "/usr/lib", **without_bytecode}
    )
    assert make_environment(copy, once) == once
    assert not without_bytecode.keys() & once.keys()
    assert once["PATH"].split(os.pathsep) == [
        str(copy.root / "install/impact_rig/bin"),
        str(copy.root / ".venv/bin"),
        "/usr/bin",
    ]
    assert str(copy.root / "install/impact_rig_msgs/lib") in once["LD_LIBRARY_PATH"]


def test_an_installed_ros_keeps_its_paths(copy):
    installed = {"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "PYTHONPATH": "/opt/ros/jazzy/lib/python"}
    ours = make_environment(Workspace(copy.root, is_ros_installed=True), installed)
    assert ours["AMENT_PREFIX_PATH"].endswith(f"{os.pathsep}/opt/ros/jazzy")
    assert ours["PYTHONPATH"].endswith(f"{os.pathsep}/opt/ros/jazzy/lib/python")
    assert str(copy.venv / "lib") not in ours["LD_LIBRARY_PATH"].split(os.pathsep)


def test_a_sourced_jazzy_is_used_and_another_distribution_refused_by_its_name(monkeypatch):
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    assert find_workspace().is_ros_installed
    monkeypatch.setenv("ROS_DISTRO", "humble")
    with pytest.raises(SetupError, match=r"ROS 2 humble is sourced .* the rig needs Jazzy"):
        find_workspace()


STARTED = "setting up "


def test_a_missing_compiler_is_said_before_anything_is_made(copy, run_rig, tmp_path_factory):
    empty = tmp_path_factory.mktemp("bin")
    done = run_rig("exec", "true", PATH=str(empty), CC="", CXX="")
    assert done.code == 1
    assert "no C++ compiler is on PATH" in done.errors
    assert "build-essential" in done.errors
    assert len(done.errors.splitlines()) == 1
    assert not copy.venv.exists()


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


def test_a_long_step_says_every_now_and_then_what_its_tool_does(copy, capsys):
    log = copy.root / "setup.log"
    lock = os.open(os.devnull, os.O_RDONLY)
    runner = workspace_setup._Runner("messages", "3/4", log, lock, period=0.3)
    tool = "import time; print('[12/157] Building a file', flush=True); time.sleep(1.2)"
    runner.run([sys.executable, "-c", tool], dict(os.environ), copy.root)
    runner.finish()
    os.close(lock)

    *progress, last = capsys.readouterr().err.splitlines()
    assert any(
        re.fullmatch(r"  3/4 messages +\d\.\d s  \[12/157\] Building a file", line)
        for line in progress
    )
    assert re.fullmatch(r"  3/4 messages +\d\.\d s", last)
