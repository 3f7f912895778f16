"""A rig that is up, and campaigns run on it from another process."""

import json
import os
import signal
import subprocess
import sys

import pytest
from rosbags.highlevel import AnyReader

from impact_rig.nodes.domain import reserve_domain

PATIENCE = 120.0
"""How long anything may take before a test fails [s]."""


@pytest.fixture
def environment(monkeypatch):
    """Return an environment with a ROS domain of its own."""
    with reserve_domain() as number:
        yield {**os.environ, "ROS_DOMAIN_ID": str(number)}


@pytest.fixture
def start(environment, tmp_path):
    """Return a function that starts a rig command; all are stopped at the end."""
    processes = []

    def run(*arguments, module="impact_rig.cli.main"):
        process = subprocess.Popen(
            [sys.executable, "-m", module, *map(str, arguments)],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        process.communicate(timeout=PATIENCE)


def run_campaign(environment, folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "impact_rig.cli.main", "campaign", *arguments],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def test_a_campaign_on_a_rig_that_is_up_writes_its_results_beside_the_recording(
    start, environment, tmp_path
):
    rig = start("up", "--output", "run", "--set", "hammer.swing_time=0.01", "--no-visualizer")
    done = run_campaign(
        environment, tmp_path, "--samples", "aluminium large", "--impacts", "2", "--json",
        "--notes", "new tip, 21 °C",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout)
    assert results["samples"][0]["impacts_accepted"] == 2
    assert json.loads((tmp_path / "run" / "results.json").read_text("utf-8")) == results
    rig.send_signal(signal.SIGINT)
    rig.wait(PATIENCE)
    with AnyReader([tmp_path / "run" / "session.mcap"]) as reader:
        notes = [
            reader.deserialize(data, connection.msgtype).data
            for connection, _, data in reader.messages()
            if connection.topic == "/note"
        ]
    assert notes == ["new tip, 21 °C"]


def test_nodes_started_by_hand_in_a_namespace_make_the_same_rig(start, environment, tmp_path):
    for node, parameters in (
        ("hammer", ["-p", "swing_time:=0.01"]),
        ("accelerometer", []),
        ("estimator", []),
        ("recorder", ["-p", "output:=hand.mcap"]),
        ("campaign", []),
    ):
        start("--ros-args", "-r", "__ns:=/rig7", *parameters, module=f"impact_rig.nodes.{node}")
    done = run_campaign(
        environment, tmp_path, "--namespace", "rig7", "--samples", "aluminium large",
        "--impacts", "2", "--output", "by_hand", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    # The virtual rig's seed is the same, so every number is that of any other first two hits.
    assert json.loads(done.stdout)["samples"][0]["contact_time_s"] == pytest.approx(
        212e-6, rel=0.01
    )
    assert (tmp_path / "hand.mcap").stat().st_size > 0


def test_without_a_rig_one_sentence_says_what_to_start(environment, tmp_path):
    done = run_campaign(environment, tmp_path)
    assert done.returncode == 2
    assert "impact-rig up" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_template_of_a_rig_file_is_one(start, environment, tmp_path):
    template = subprocess.run(
        [sys.executable, "-m", "impact_rig.cli.main", "up", "--template"],
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    ).stdout
    (tmp_path / "rig.toml").write_text(template.replace("seed = 1", "seed = 99"), "utf-8")
    start("up", "--rig-file", "rig.toml", "--no-record", "--no-visualizer", "--output", "run",
          "--set", "hammer.swing_time=0.01")  # fmt: skip
    done = run_campaign(
        environment, tmp_path, "--samples", "aluminium large", "--impacts", "1", "--json"
    )
    assert done.returncode == 0, done.stderr
