"""A rig that is up, and campaigns run on it from another process."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from impact_rig.cli.rig_group import EXIT_INTERRUPTED
from impact_rig.cli.up import describe_ready
from impact_rig.configuration.processes import ACTIVE
from impact_rig.configuration.rig_file import RigFile, read_template
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.run import Run
from impact_rig.testing import use_own_domain

from .conftest import PATIENCE, start_command

RECORDING = Path("run", "session.mcap")


@pytest.fixture(scope="module")
def own_domain():
    with use_own_domain():
        yield


@pytest.fixture(scope="module")
def start(own_domain, tmp_path_factory):
    """Return a function that starts a rig command in a folder; all are stopped at the end."""
    processes = []
    folder = tmp_path_factory.mktemp("rig")

    def run(*arguments):
        pipes = {"stderr": subprocess.STDOUT}
        processes.append(start_command(*arguments, cwd=folder, **pipes))
        return processes[-1]

    run.folder = folder
    yield run
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, EXIT_INTERRUPTED)


@pytest.fixture(scope="module")
def rig(start):
    """Return a rig in a namespace, with a rig file."""
    text = read_template() + '\n[source]\ndriver = "virtual"\nseed = 99\n'
    (start.folder / "rig.toml").write_text(text)
    process = start(
        "up", "--rig-file", "rig.toml", "--output", "run", "--no-visualizer",
        "--namespace", "rig7", "--set", "hammer.swing_time=0.2",
    )  # fmt: skip
    started = []
    for line in process.stdout:
        started.append(line)
        if "ready: " in line:
            break
    assert len([line for line in started if ACTIVE in line]) == 5
    ready = describe_ready(RigFile(PAPER_SETUP), RECORDING, namespace="rig7")
    assert started[-1].endswith(f"| {ready}\n")
    return process


CAMPAIGN = ("campaign", "--namespace", "rig7")


def test_a_campaign_on_a_rig_that_is_up_writes_its_results_beside_the_recording(
    rig, start, run, monkeypatch
):
    # A closed terminal leaves no swinging hammer, and the rig runs on.
    left = start(*CAMPAIGN, "--impacts", "1000")
    assert any("sample 1 of 12" in line for line in left.stdout)
    left.send_signal(signal.SIGHUP)
    left.communicate(timeout=PATIENCE)
    assert left.returncode == EXIT_INTERRUPTED
    monkeypatch.chdir(start.folder)
    words = ("--sample", "aluminium large", "--impacts", "2", "--json", "--notes", "21 °C")
    done = run(*CAMPAIGN, *words)
    assert done.exit_code == 0, done.stderr
    results = json.loads(done.stdout)
    assert results["samples"][0]["impacts_accepted"] == 2
    assert json.loads((start.folder / "run" / "results.json").read_text("utf-8")) == results
    notes = inspect_run(Run(start.folder / RECORDING)).notes
    assert [note.text for note in notes] == ["21 °C"]
    assert (start.folder / "run" / "nodes.log").read_text("utf-8").count(ACTIVE) == 5


def test_a_setting_that_cannot_be_meant_is_refused_before_anything_starts(run, tmp_path):
    folder = tmp_path / "run"
    done = run("up", "--output", folder, "--set", "hammer.swing_time=abc")
    assert done.exit_code == 2
    assert "swing_time is 'abc': it must be a number from 0 to 60" in done.stderr
    assert not folder.exists()


def test_the_line_that_ends_the_start_says_which_rig_it_is_and_what_to_call():
    holder, source = (TomlTable({"driver": name}, "the table") for name in ("serial", "scpi"))
    rig = RigFile(PAPER_SETUP, holder=holder, source=source)
    assert describe_ready(rig, None, "rig7") == (
        "ready: hammer serial, accelerometers scpi, recording nothing here;"
        " in another terminal: impact-rig campaign --namespace rig7"
    )


def test_without_a_rig_one_sentence_says_what_to_start(run, own_domain):
    done = run("campaign", "--wait", "0.2 s")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: no rig answers in namespace '/' within 0.2 s: start one")


@pytest.mark.parametrize("command", ["up", "page", "demo"])
def test_without_ros_it_is_said_before_a_node_is_started(command, run, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "rclpy", None)
    outcome = run(command)
    assert outcome.exit_code == 2
    assert "error: rclpy is not installed: analyze, export" in outcome.stderr
    assert "started" not in outcome.stdout
    assert not list(tmp_path.iterdir())  # no folder of a run that never was
