"""`impact-rig analyze` on recordings and on results files."""

import json

import pytest

import impact_rig as ir
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import results_to_json, write_results
from impact_rig.results.wire import format_json

from .conftest import STRUCK, finish, start_python

SAMPLES = ("steel small", "aluminium large")


def test_the_json_of_a_run_s_folder_is_that_of_the_live_run_also_without_ros(campaign):
    # -S -E would hide everything else too: forbid just rclpy, as if it were not installed.
    code = (
        "import sys; sys.modules['rclpy'] = None; sys.modules['impact_rig_msgs'] = None;"
        "from impact_rig.cli.main import main; main()"
    )
    words = ("-c", code, "analyze", campaign.path.parent, "--json")
    exit_code, output, errors = finish(start_python(*words, env={"AMENT_PREFIX_PATH": None}))
    assert (exit_code, errors) == (0, "")
    assert output == format_json(results_to_json(campaign.results))
    content = json.loads(output)
    assert (content["origin"], content["origin_source"]) == (
        "simulated", "virtual rig, plant published",
    )  # fmt: skip
    assert {"format", "setup", "hammer", "samples", "hits"} <= set(content)
    assert [sample["name"] for sample in content["samples"]] == list(STRUCK)
    assert all(item["injected_faults"] for item in content["hits"] if not item["accepted"])


def test_two_campaigns_in_one_recording_are_kept_apart(run, record, tmp_path):
    settings = VirtualRigSettings(seed=3)
    recorded = record(tmp_path / "two.mcap", settings, SAMPLES[1:], 1, campaigns=2)
    first, second = json.loads(run("analyze", recorded.path, "--json").stdout)
    assert second == results_to_json(recorded.results)
    assert [sample["impacts_accepted"] for sample in first["samples"]] == [1]
    opened = ir.open_run(recorded.path, campaign=2)
    found = opened.analyze()[SAMPLES[1]].contact_time.value
    assert found == recorded.results.samples[0].paper.contact_time.value
    assert [hit.record for hit in opened.hits[SAMPLES[1]]] == [2]
    with pytest.raises(ir.RigError, match="holds 2 campaigns: choose one with campaign=1"):
        ir.open_run(recorded.path).analyze()
    assert "campaign 2" in " ".join(run("analyze", recorded.path).stdout.split())


def test_settings_of_a_file_replace_the_recorded_ones(run, campaign, channels):
    words = channels("[analysis]\npulse_factor = 1.5\ncontact_exponent = 1.5")
    content = json.loads(run("analyze", campaign.path, "--json", *words).stdout)
    for sample, recorded in zip(content["samples"], campaign.results.samples, strict=True):
        assert sample["contact_time_s"] == pytest.approx(0.75 * recorded.paper.contact_time.value)
    outcome = run("analyze", campaign.path, *channels("[analysis]\ncontact_exponent = 7"))
    assert outcome.exit_code == 2
    assert "contact_exponent is 7" in outcome.stderr


def test_what_describes_plain_traces_is_refused_for_recordings(run, campaign, channels):
    outcome = run("analyze", campaign.path, "--hammer-mass", "100g")
    assert outcome.exit_code == 2
    assert "--hammer-mass is for plain traces" in outcome.stderr
    outcome = run("analyze", campaign.path, *channels('[hammer]\nmass = "100 g"'))
    assert outcome.exit_code == 2
    assert "a recording takes only [analysis] from it" in outcome.stderr


def test_recordings_and_traces_are_not_mixed(run, campaign):
    outcome = run("analyze", campaign.path, "hit.npy")
    assert outcome.exit_code == 2
    assert "analyze them apart" in outcome.stderr


@pytest.fixture
def path(tmp_path, results):
    """Return a results file of the paper's campaign."""
    path = tmp_path / "results.json"
    write_results(path, results)
    return path


def test_the_tables_of_a_results_file_are_shown(run, path, results):
    outcome = run("analyze", path, "--full")
    assert outcome.exit_code == 0
    value = results.samples[0].paper.contact_time.value * 1e6
    for words in ("Table 2", "Table 4", results.samples[0].name, f"{value:.1f}"):
        assert words in outcome.stdout
    assert "below 0.05 %" not in outcome.stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--accept", "3"), "--accept does not change "),
        (("--hammer-mass", "1kg"), "--hammer-mass does not change "),
        (("hit.npy",), "it must be the only file"),
    ],
)
def test_what_a_results_file_has_no_use_for_is_refused(run, path, words, sentence):
    outcome = run("analyze", path, *words)
    assert outcome.exit_code == 2
    assert sentence in outcome.stderr
    assert outcome.stdout == ""
