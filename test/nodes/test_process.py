"""A node as a process: bad parameters in one sentence, signals end it cleanly."""

import itertools
import os
import signal
import subprocess
import sys
import time

import pytest
from terminal import run_program

from impact_rig.configuration.processes import ACTIVE, LAUNCHER

PATIENCE = 60.0
"""How long a process may take before the test fails [s]."""


@pytest.fixture
def run_script(ros_domain):
    """Return a function that runs a program as a process, to its end."""
    return lambda script: run_program([sys.executable, "-c", script])


PARAMETERS = {
    "stream_block_size:=0": ("stream_block_size", "0"),
    "trigger_timeout:=soon": ("trigger_timeout", "soon"),
    "mode:=always": ("mode", "always", "must be one of triggered, continuous"),
}


def test_an_impossible_parameter_ends_the_process_with_one_sentence(run_script):
    process = run_script(f"""
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.process import run_node

for parameter in {list(PARAMETERS)}:
    print(run_node(AccelerometerNode, ["--ros-args", "-p", parameter]))
""")
    assert process.stdout == "2\n2\n2\n"
    told = [line for line in process.stderr.splitlines() if line.startswith("error: ")]
    for line, words in zip(told, PARAMETERS.values(), strict=True):
        assert all(word in line for word in words)
    assert "Traceback" not in process.stderr


def test_a_node_without_the_rig_s_messages_says_how_to_build_them():
    paths = os.environ["PYTHONPATH"].split(os.pathsep)
    others = [path for path in paths if "impact_rig_msgs" not in path]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(others)}
    done = run_program([sys.executable, "-m", "impact_rig.nodes", "hammer"], env=environment)
    assert done.returncode == 1
    assert done.stderr.startswith("error: impact_rig_msgs is missing: build both packages")
    assert len(done.stderr.splitlines()) == 1


def test_a_node_that_cannot_be_configured_ends_and_says_why_once(ros_domain):
    words = ["--ros-args", "-p", "certificate:=missing.pem", "-p", "key:=missing.pem"]
    done = run_program([sys.executable, "-m", "impact_rig.nodes", "page", *words])
    assert done.returncode == 2
    assert done.stderr.count("missing.pem cannot be used") == 1
    assert "Traceback" not in done.stderr


def test_a_node_needs_no_standard_error():
    node = [sys.executable, "-m", "impact_rig.nodes", "hammer"]
    words = ["sh", "-c", 'exec "$@" 2>&-', "sh", *node, "--ros-args", "-p", "swing_time:=soon"]
    done = subprocess.run(words, timeout=PATIENCE, check=False)
    assert done.returncode == 2  # an impossible parameter; 1 were a traceback


def test_modules_in_the_working_folder_are_not_imported(tmp_path, ros_domain):
    (tmp_path / "numpy.py").write_text("raise SystemExit('a numpy of the folder')")
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "impact_rig.nodes", "hammer"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert any(ACTIVE in line for line in process.stderr)
    process.terminate()
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0


def test_a_node_ends_when_its_launcher_is_killed(start_process, tmp_path, monkeypatch):
    path = tmp_path / "session.mcap"
    launcher = subprocess.Popen(["sleep", "1000"])
    monkeypatch.setenv(LAUNCHER, str(launcher.pid))
    process = start_process("recorder", output=path)
    process.wait_for("recording to")
    launcher.kill()
    assert process.wait() == 0
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")
    launcher.wait()


def test_a_node_that_stands_shows_where_and_ends_if_that_is_for_good(run_script):
    """At last no thread of it runs Python, as when the middleware has locked itself up."""
    process = run_script("""
import ctypes, time
from impact_rig.nodes import process
from impact_rig.nodes.hammer import HammerNode

class Standing(HammerNode):
    longest_work = 2

    def autostart(self):
        self.create_timer(1.5, self.stand)

    def stand(self):
        time.sleep(5.0)
        ctypes.PyDLL(None).sleep(1000)  # holds Python's lock

process.STUCK_AFTER = 2.0
process.run_node(Standing)
""")
    assert process.returncode == 1
    assert process.stderr.count("no callback for 2 s, after 0 messages") == 1
    assert process.stderr.count("in stand") == 2


def test_a_recording_is_whole_although_the_middleware_is_locked_up_at_the_end(
    run_script, tmp_path
):
    path = tmp_path / "session.mcap"
    process = run_script(f"""
import ctypes, os, signal
import rclpy
from impact_rig.nodes import process
from impact_rig.nodes.recorder import RecorderNode
from rclpy.impl.implementation_singleton import rclpy_implementation

def wait_for_a_lock(*_):
    ctypes.PyDLL(None).sleep(1000)  # holds Python's own, too

class Locked(rclpy_implementation.EventsExecutor):
    shutdown = wait_for_a_lock

class Stopping(RecorderNode):
    def autostart(self):
        super().autostart()
        self.destroy_subscription = wait_for_a_lock
        os.kill(os.getpid(), signal.SIGTERM)

process.make_executor = lambda: Locked(rclpy.get_default_context())
process.LONGEST_LEAVE = 1
process.run_node(Stopping, ["--ros-args", "-p", "output:={path}"])
""")
    assert process.returncode == 0, process.stderr
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")


def test_a_node_that_does_not_close_ends_and_tells_where_it_stood(run_script):
    process = run_script("""
import ctypes
from impact_rig.nodes import process
from impact_rig.nodes.hammer import HammerNode

class Stopping(HammerNode):
    def autostart(self):
        self.request_stop()

    def close(self):
        ctypes.PyDLL(None).sleep(1000)

process.LONGEST_CLOSE = 1.0
process.run_node(Stopping)
""")
    assert process.returncode == 1
    assert "in close" in process.stderr


def test_signals_while_a_node_ends_change_nothing(start_process, tmp_path):
    path = tmp_path / "session.mcap"
    process = start_process("recorder", output=path)
    process.wait_for("recording to")
    # As an impatient operator does, from the first signal to one after its end.
    numbers = itertools.cycle([signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
    while process.process.poll() is None:
        process.process.send_signal(next(numbers))
        time.sleep(0.001)
    assert process.wait() == 0
    assert "Traceback" not in process.text
    assert "Exception" not in process.text
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")


def test_a_campaign_that_is_under_way_leaves_nothing_of_its_node(run_script):
    """Others would still list the node for a minute, and a rig of its name would have two.

    Only the thread that all nodes share is left of the middleware: others may block the end.
    """
    process = run_script("""
import os, signal
from pathlib import Path
from impact_rig_msgs.action import RunCampaign
from rclpy.action import ActionClient
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.process import run_node

class Interrupted(CampaignNode):
    def autostart(self):
        super().autostart()
        self.client = ActionClient(self, RunCampaign, "campaign/run")
        sent = self.client.send_goal_async(RunCampaign.Goal(samples=["steel small"], impacts=1))
        sent.add_done_callback(lambda _: self.create_timer(0.2, self.interrupt))

    def interrupt(self):
        self.client.destroy()
        del self.client
        os.kill(os.getpid(), signal.SIGINT)

code = run_node(Interrupted)
names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
print(*(name for name in names if name.startswith("dds")))
raise SystemExit(code)
""")
    assert process.returncode == 0, process.stderr
    assert "the campaign ends: the campaign node has been stopped" in process.stderr
    assert "Traceback" not in process.stderr
    assert process.stdout == "dds.shm.wdog\n"


def test_a_middleware_that_does_not_end_changes_no_exit_code(run_script):
    process = run_script("""
import ctypes, gc
from impact_rig.nodes import process
from impact_rig.nodes.hammer import HammerNode

gc.collect = lambda: ctypes.PyDLL(None).sleep(1000)
process.LONGEST_LEAVE = 1
process.run_node(HammerNode, ["--ros-args", "-p", "swing_time:=-1.0"])
""")
    assert process.returncode == 2
    assert process.stderr.startswith("error: ")


def test_a_signal_ends_a_node_quietly_that_still_imports(start_process, monkeypatch):
    monkeypatch.setenv("PYTHONPROFILEIMPORTTIME", "1")
    process = start_process("hammer")
    process.wait_for("rclpy.constants")
    process.process.send_signal(signal.SIGINT)
    assert process.wait() == 0
    assert "Traceback" not in process.text
