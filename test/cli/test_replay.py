"""`impact-rig replay`: as a player, and through a fresh estimator."""

import json
import subprocess

import pytest

from impact_rig.core.given.setup import CONTROL_SAMPLE
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRigSettings
from impact_rig.results.results_file import results_to_json
from impact_rig.results.wire import format_json

from .conftest import PATIENCE, record_campaigns, start_command

SAMPLES = [CONTROL_SAMPLE, "steel small"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return a recording of two campaigns with faults, and what the second live run found."""
    settings = VirtualRigSettings(seed=7, faults=FaultPlan(0.2))
    path = tmp_path_factory.mktemp("recording") / "session.mcap"
    return record_campaigns(path, settings, SAMPLES, 2, campaigns=2)


@pytest.fixture
def quiet_ros(monkeypatch):
    """Keep ROS on this host."""
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


@pytest.fixture
def start(ros_domain):
    """Return a function that starts a replay in its own ROS domain."""
    processes = []

    def begin(*arguments):
        processes.append(start_command("replay", *arguments, stdin=subprocess.PIPE))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.communicate(timeout=PATIENCE)


def test_a_fresh_estimator_gives_the_results_of_each_campaign_byte_for_byte(
    run, quiet_ros, recorded
):
    replayed = run("replay", recorded.path, "--estimate", "--json")
    assert replayed.exit_code == 0, replayed.stderr
    assert replayed.stdout == run("analyze", recorded.path, "--json").stdout
    campaigns = json.loads(replayed.stdout)
    live = json.loads(format_json(results_to_json(recorded.results)))
    assert (len(campaigns), campaigns[-1]) == (2, live)
    assert not all(hit["accepted"] for hit in campaigns[-1]["hits"]), "some hits should be bad"


def test_a_player_without_subscribers_ends_with_the_recording(start, recorded):
    process = start(recorded.path, "--rate", 100, "--loop", 2)
    output, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output) == (0, ""), errors
    assert "[replayer]: done: " in errors


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--rate", "0"], "0.0 is not in the range 0.001<=x<=1000.0"),
        (["--json"], "--json prints results: it needs --estimate"),
        (["--estimate", "--loop", "0"], "--loop is not for --estimate"),
    ],
)
def test_bad_options_get_one_sentence(run, quiet_ros, recorded, arguments, told):
    done = run("replay", recorded.path, *arguments)
    assert done.exit_code == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_bad_files_get_one_sentence(run, quiet_ros, tmp_path):
    text = tmp_path / "trace.csv"
    text.write_text("time,hammer\n")
    for path, told in ((tmp_path / "absent.mcap", "there is no file"), (text, "is no MCAP")):
        for option in ([], ["--estimate"]):
            done = run("replay", path, *option)
            assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
            assert told in done.stderr
