"""`impact-rig` brings its Python along, wherever and in whatever environment it is called."""

import os
import shutil
import sys
from pathlib import Path

import pytest
import workspace
from terminal import Terminal, run_program

from impact_rig import __version__

PATIENCE = 60.0
"""How long a command may take before the test fails [s]."""
PROMPT = "a prompt of one's own> "
VERSION = (0, f"impact-rig, version {__version__}\n", "")
FOREIGN_PYTHON = "this Python lacks the rig's packages"


@pytest.fixture(scope="module")
def here():
    """Return this workspace, as rig.py has set it up."""
    place = workspace.find_workspace()
    if workspace.find_stale(place):
        pytest.skip("this workspace was not set up by rig.py")
    return place


@pytest.fixture
def command(here):
    """Return the installed command."""
    return here.get_prefix(workspace.NODES) / "bin" / "impact-rig"


@pytest.fixture
def home(tmp_path):
    """Return a home whose start-up file puts a Python without the rig's packages first."""
    folder = tmp_path / "shims"
    folder.mkdir()
    for name in ("python", "python3"):
        (folder / name).write_text(f'#!/bin/sh\necho "{FOREIGN_PYTHON}" >&2\nexit 1\n')
        (folder / name).chmod(0o755)
    (tmp_path / ".bashrc").write_text(f'export PATH="{folder}:$PATH"\nPS1="{PROMPT}"\n')
    return tmp_path


def run(command, folder, *arguments, **environment):
    words = [command, *(arguments or ("--version",))]
    done = run_program(words, cwd=folder, env=environment)
    return done.returncode, done.stdout, done.stderr


def test_it_runs_with_no_environment_at_all(command):
    assert run(command, "/") == VERSION


def test_it_finds_ros_and_the_messages_as_cron_starts_it(command, ros_domain, tmp_path):
    (tmp_path / "session.mcap").touch()
    code, _, errors = run(
        command, tmp_path, "replay", "session.mcap",
        PATH="/usr/bin:/bin", ROS_DOMAIN_ID=str(ros_domain),
    )  # fmt: skip
    # ROS and the messages are imported before the file is opened.
    assert (code, errors) == (
        2, "error: session.mcap is empty: it should be an MCAP recording\n"
    )  # fmt: skip


def test_it_runs_through_links_from_another_folder(command, tmp_path):
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "rig").symlink_to(command)
    (tmp_path / "linked").symlink_to("bin/rig")
    assert run("./linked", tmp_path, PATH="/usr/bin:/bin") == VERSION


def test_a_foreign_python_that_comes_first_does_not_matter(command, home):
    path = os.pathsep.join([str(home / "shims"), str(command.parent), "/usr/bin", "/bin"])
    found = shutil.which("impact-rig", path=path)
    assert run(found, "/", PATH=path) == VERSION


def test_a_copy_that_lies_in_no_installation_says_so(tmp_path):
    copy = shutil.copy(Path(workspace.__file__).with_name("impact-rig"), tmp_path)
    code, _, errors = run(copy, "/", PATH="/usr/bin:/bin")
    assert code == 127
    assert errors.startswith(f"error: {copy} lies in no installation of impact_rig")
    assert len(errors.splitlines()) == 1


@pytest.mark.skipif(
    shutil.which("bash") is None, reason="no bash: on Debian, apt-get install bash"
)
def test_in_the_rig_s_shell_the_rig_s_commands_come_first(here, home, ros_domain):
    rig = here.root / "launch_scripts" / "rig.py"
    variables = {"SHELL": shutil.which("bash"), "HOME": str(home)}
    with Terminal([sys.executable, rig, "shell"], {**os.environ, **variables}) as terminal:
        terminal.wait_for(PROMPT)
        terminal.write("cd; impact-rig --version\n")
        terminal.write("python3 -c 'import rclpy, impact_rig_msgs.msg'\n")
        terminal.write("echo python3 ended with $?; exit\n")
        terminal.wait()
    assert FOREIGN_PYTHON not in terminal.text
    assert "Traceback" not in terminal.text
    assert VERSION[1] in terminal.text
    assert "python3 ended with 0\n" in terminal.text
