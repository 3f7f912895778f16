"""The rig's processes, started and stopped together."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from terminal import run_program

from impact_rig.cli.up import make_words
from impact_rig.configuration.processes import NodeProcess

from .conftest import PATIENCE, finish, start_command


@pytest.fixture
def start_up(ros_domain, tmp_path):
    """Return a function that starts `impact-rig up` in its own ROS domain."""
    return lambda *words, **pipes: start_command("up", *words, cwd=tmp_path, **pipes)


def test_the_words_of_a_node_have_its_parameters_as_yaml():
    process = NodeProcess("recorder", {"output": "a b's.mcap", "flush_period": 0.5, "on": True})
    words = make_words(process, namespace="/rig7")
    assert {"__ns:=/rig7", 'output:="a b\'s.mcap"', "flush_period:=0.5", "on:=true"} < {*words}


def test_a_stop_while_the_processes_start_ends_them_all(start_up):
    process = start_up("--no-visualizer", stderr=subprocess.STDOUT)
    lines = []
    for line in process.stdout:
        lines.append(line)
        if "hammer started" in line:
            process.send_signal(signal.SIGINT)
    process.wait(PATIENCE)
    assert "Traceback" not in "".join(lines)
    assert process.returncode == 0
    # The word of the signal may come in the middle of a line.
    started = [int(number) for number in re.findall(r"started \(pid=(\d+)\)", "".join(lines))]
    assert len(started) == 5
    for number in started:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


def test_nodes_are_forked_before_any_of_them_has_ros_or_a_thread():
    done = run_program([sys.executable, "-P", "-c", """
import os, sys
from importlib import import_module
from impact_rig.nodes.together import FOR_HITS, SHARED
for name in (*SHARED, FOR_HITS):
    import_module(name)
print("rclpy" in sys.modules, len(os.listdir("/proc/self/task")))
"""])  # fmt: skip
    assert done.stdout == "False 1\n"


def test_nodes_end_when_the_process_that_forked_them_is_killed(start_up):
    process = start_up("--no-visualizer", stderr=subprocess.STDOUT)
    lines = []
    for line in process.stdout:
        lines.append(line)
        if "ready: " in line:
            hammer = int(re.search(r"hammer started \(pid=(\d+)\)", "".join(lines))[1])
            os.kill(os.getpgid(hammer), signal.SIGKILL)
    process.wait(PATIENCE)
    told = "".join(lines)
    assert "rig has ended (-9): the rig ends" in told
    assert "session.mcap is closed" in told
    assert process.returncode == 2


def test_a_rig_goes_on_when_what_it_says_cannot_be_written(start_up):
    with Path("/dev/full").open("w") as full:
        process = start_up("--only", "hammer", stdout=full)
    told = process.stderr.readline()
    process.terminate()
    lost = "warning: the nodes' output is lost: No space left on device\n"
    assert (told, *finish(process)) == (lost, 0, None, "")


def test_a_rig_goes_on_without_its_display_and_ends_with_a_node_that_measures(start_up):
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    process = start_up("--only", "hammer", "--only", "visualizer", stderr=subprocess.STDOUT)

    def kill(name):
        number = re.search(rf"{name} started \(pid=(\d+)\)", "".join(lines))[1]
        os.kill(int(number), signal.SIGKILL)

    lines = []
    for line in process.stdout:
        lines.append(line)
        if "ready: " in line:
            kill("visualizer")
        if "the rig goes on without it" in line:
            kill("hammer")
    process.wait(PATIENCE)
    told = "".join(lines)
    assert "visualizer has ended (-9): the rig goes on without it" in told
    assert "a node has ended, so the rig has stopped" in told
