"""A node as a process: bad parameters in one sentence, signals end it cleanly."""

import os
import signal
import subprocess
import sys

import pytest

PATIENCE = 60.0
"""How long a process may take before the test fails [s]."""


@pytest.fixture
def start(ros_domain):
    """Return a function that starts a node as a person would."""

    def run(node, *parameters):
        words = [word for parameter in parameters for word in ("-p", parameter)]
        return subprocess.Popen(
            [sys.executable, "-m", f"impact_rig.nodes.{node}", "--ros-args", *words],
            env={**os.environ, "ROS_DOMAIN_ID": str(ros_domain)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return run


@pytest.mark.parametrize(
    ("parameter", "words"),
    [("seed:=-3", ("seed", "-3")), ("noise:=loud", ("noise", "loud"))],
)
def test_an_impossible_parameter_ends_the_process_with_one_sentence(start, parameter, words):
    process = start("accelerometer", parameter)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert errors.startswith("error: ")
    assert all(word in errors for word in words)
    assert "Traceback" not in output + errors


def test_a_missing_rig_file_leaves_the_node_up_to_be_configured_again(start):
    process = start("campaign", "rig_file:=absent.toml")
    for line in process.stderr:
        if "there is no rig file absent.toml" in line:
            break
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_with_its_files_closed(start, tmp_path, number):
    path = tmp_path / "session.mcap"
    process = start("recorder", f"output:={path}")
    for line in process.stderr:
        if "recording to" in line:
            break
    process.send_signal(number)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert path.read_bytes().endswith(b"\x89MCAP0\r\n")
