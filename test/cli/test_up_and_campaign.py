"""A rig that is up, and campaigns run on it from another process."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from rosbags.highlevel import AnyReader

from impact_rig.cli.main import EXIT_INTERRUPTED
from impact_rig.cli.up import describe_ready
from impact_rig.configuration.processes import ACTIVE
from impact_rig.configuration.rig_file import RigFile
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.nodes.discovery import reserve_domain

PATIENCE = 120.0
"""How long anything may take before a test fails [s]."""
RECORDING = Path("run", "session.mcap")


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
    run, start, environment, tmp_path
):
    template = run("up", "--template").stdout
    source = '\n[source]\ndriver = "virtual"\nseed = 99\n'
    (tmp_path / "rig.toml").write_text(template + source, "utf-8")
    rig = start(
        "up", "--rig-file", "rig.toml", "--output", "run", "--set", "hammer.swing_time=0.01",
        "--no-visualizer",
    )  # fmt: skip
    started = []
    for line in iter(rig.stdout.readline, ""):
        started.append(line)
        if "ready: " in line:
            break
    assert len([line for line in started if ACTIVE in line]) == 5
    assert started[-1].endswith("| " + describe_ready(RigFile(PAPER_SETUP), RECORDING) + "\n")
    # Whoever closes the terminal leaves no hammer swinging behind, and the rig to others.
    left = start("campaign", "--impacts", "1000")
    assert any("sample 1 of 12" in line for line in left.stdout)
    left.send_signal(signal.SIGHUP)
    left.communicate(timeout=PATIENCE)
    assert left.returncode == EXIT_INTERRUPTED
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


def find_node(rig, name):
    """Return the process of a node that `up` has started."""
    for process in psutil.Process(rig.pid).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            words = process.cmdline()
            if "impact_rig.nodes" in words and words[words.index("impact_rig.nodes") + 1] == name:
                return process.pid
    raise AssertionError(f"no {name} node is there")


def test_nodes_that_die_are_started_again_and_the_campaign_has_every_hit(
    start, environment, tmp_path
):
    rig = start(
        "up", "--respawn", "--output", "run", "--set", "hammer.swing_time=0.2", "--no-visualizer"
    )
    assert any("ready: " in line for line in rig.stdout)
    campaign = start(
        "campaign", "--samples", "steel small", "--impacts", "12", "--output", "results"
    )
    told = []

    def wait_for(*words):
        for line in campaign.stdout:
            told.append(line)
            if any(word in line for word in words):
                return
        raise AssertionError("".join(told))

    # What the recorder had written when it died is what the estimator takes up.
    for name in ("recorder", "estimator"):
        wait_for("sample 1 of", "it goes on")
        os.kill(find_node(rig, name), signal.SIGKILL)
        wait_for("paused: ")
    rest = campaign.communicate(timeout=PATIENCE)[0]
    assert campaign.returncode == 0, "".join([*told, rest])
    hits = json.loads((tmp_path / "results" / "results.json").read_text("utf-8"))["hits"]
    assert [hit["impact"] for hit in hits if hit["accepted"]] == list(range(1, 13))
    assert len({hit["record"] for hit in hits}) == len(hits)
    rig.send_signal(signal.SIGINT)
    rig.communicate(timeout=PATIENCE)
    assert rig.returncode == 0
    assert sorted(path.name for path in (tmp_path / "run").glob("*.mcap")) == [
        "session-2.mcap", "session.mcap",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("drivers", "arguments", "which", "option"),
    [
        (("", ""), {}, "the virtual rig, recording to run/session.mcap", ""),
        (
            ("", ""),
            {"recording": None, "namespace": "rig7"},
            "the virtual rig, recording nothing here",
            " --namespace rig7",
        ),
        (
            ("serial", "scpi"),
            {"recording": None, "only": ("hammer",)},
            "hammer of the rig (hammer: serial, accelerometers: scpi), recording nothing here",
            "",
        ),
    ],
)
def test_the_line_that_ends_the_start_says_which_rig_it_is_and_what_to_call(
    drivers, arguments, which, option
):
    holder, source = (
        TomlTable({"driver": driver} if driver else {}, "the table") for driver in drivers
    )
    rig = RigFile(PAPER_SETUP, holder=holder, source=source)
    line = describe_ready(rig, **{"recording": RECORDING, **arguments})
    assert line == f"ready: {which}; in another terminal: impact-rig campaign{option}"


def test_nodes_started_by_hand_in_a_namespace_make_the_same_rig(start, environment, tmp_path):
    for node, parameters in (
        ("hammer", ["-p", "swing_time:=0.01"]),
        ("accelerometer", []),
        ("estimator", []),
        ("recorder", ["-p", "output:=hand.mcap"]),
        ("campaign", []),
    ):
        start(node, "--ros-args", "-r", "__ns:=/rig7", *parameters, module="impact_rig.nodes")
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


def test_without_a_rig_one_sentence_says_what_to_start(run, environment, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", environment["ROS_DOMAIN_ID"])
    monkeypatch.setattr("impact_rig.cli.campaign.RIG_TIMEOUT", 0.2)
    done = run("campaign")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: no rig answers in namespace '/' within 0.2 s: start one")
