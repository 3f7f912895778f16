"""`impact-rig analyze` on recordings."""

import json

import pytest

from impact_rig.core.setup import PUBLISHED_SAMPLES
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import format_json, results_to_json

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
    assert content["hammer"]["stiffness_n_per_m"] == pytest.approx(22.54e6, rel=0.015)
    assert content["hammer"]["damping_coefficient_n_s_per_m"] == pytest.approx(1909, rel=0.05)
    published = {cell.name: cell for cell in PUBLISHED_SAMPLES}
    assert [sample["name"] for sample in content["samples"]] == list(STRUCK)
    for sample in content["samples"]:
        assert sample["impacts_accepted"] == 3
        # Three hits of 0.3 % scatter: the mean stays within four standard errors.
        expected = published[sample["name"]].contact_time
        assert sample["contact_time_s"] == pytest.approx(expected, rel=0.007)
        assert sample["mse_hammer_percent"] < 0.25
        assert sample["mse_sample_percent"] < 5.0
    assert all(item["injected_faults"] for item in content["hits"] if not item["accepted"])


def test_the_tables_show_paper_beside_measured(run, campaign):
    outcome = run("analyze", campaign.path, "--full")
    assert outcome.exit_code == 0
    for title in ("Table 2", "Table 3", "Table 4", "Model against measurement", "Rejected hits"):
        assert title in outcome.stdout
    assert "288.10" in outcome.stdout
    assert max(map(len, outcome.stdout.splitlines())) <= 80


def test_two_campaigns_in_one_recording_are_kept_apart(run, record, tmp_path):
    settings = VirtualRigSettings(seed=3)
    recorded = record(tmp_path / "two.mcap", settings, SAMPLES[1:], 1, campaigns=2)
    first, second = json.loads(run("analyze", recorded.path, "--json").stdout)
    assert second == results_to_json(recorded.results)
    assert [sample["impacts_accepted"] for sample in first["samples"]] == [1]
    assert "campaign 2" in " ".join(run("analyze", recorded.path).stdout.split())


def test_an_exponent_that_is_given_is_not_found(run, record, channels, tmp_path):
    settings = VirtualRigSettings(Plant.CONTACT, seed=3)
    recorded = record(tmp_path / "contact.mcap", settings, SAMPLES, 2)
    words = channels("[analysis]\ncontact_exponent = 1.5")
    content = json.loads(run("analyze", recorded.path, "--json", *words).stdout)
    for sample in content["samples"]:
        law = sample["contact_law"]
        assert (law["exponent"], law["exponent_u"]) == (1.5, 0.0)
        assert "n was given, 1.5, not found" in law["notes"]


def test_settings_of_a_file_replace_the_recorded_ones(run, campaign, channels):
    words = channels("[analysis]\npulse_factor = 1.5\ncontact_exponent = 1.5")
    content = json.loads(run("analyze", campaign.path, "--json", *words).stdout)
    for sample, recorded in zip(content["samples"], campaign.results.samples, strict=True):
        assert sample["contact_time_s"] == pytest.approx(0.75 * recorded.contact_time.value)
    outcome = run("analyze", campaign.path, *channels("[analysis]\ncontact_exponent = 7"))
    assert outcome.exit_code == 2
    assert "contact_exponent is 7" in outcome.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [
        pytest.param(b"this is no MCAP at all, whatever its name says", "MCAP", id="other kind"),
        pytest.param(b"", "empty", id="empty"),
        pytest.param(None, "there is no file", id="missing"),
    ],
)
def test_what_is_no_recording_is_named_in_one_sentence(run, tmp_path, content, words):
    path = tmp_path / "session.mcap"
    if content is not None:
        path.write_bytes(content)
    outcome = run("analyze", path)
    assert outcome.exit_code == 2
    assert outcome.stdout == ""
    assert outcome.stderr.startswith("error: ")
    assert len(outcome.stderr.splitlines()) == 1
    assert str(path) in outcome.stderr
    assert words.lower() in outcome.stderr.lower()


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


def find_rejections(content):
    return {
        hit["record"]: [reason.split(":")[0] for reason in hit["reasons"]]
        for hit in content["hits"]
        if not hit["accepted"]
    }


def test_a_person_accepts_and_rejects_hits_by_number_or_place(run, campaign):
    before = campaign.results.rejections
    (double, *_) = [
        hit for hit in before if [item.split(":")[0] for item in hit.reasons] == ["double_hit"]
    ]
    content = json.loads(
        run(
            "analyze", campaign.path, "--json", "--accept", double.record,
            "--reject", f"{SAMPLES[0]}/1.1", "--reject", f"{SAMPLES[1]}/1.1",
        ).stdout
    )  # fmt: skip
    rejections = find_rejections(content)
    assert double.record not in rejections
    by_hand = [number for number, reasons in rejections.items() if "operator" in reasons]
    assert len(by_hand) == 2
    (struck,) = [item for item in content["samples"] if item["name"] == double.sample]
    (note,) = [text for text in struck["warnings"] if "by hand" in text]
    assert note.startswith(f"hit {double.record} ({double.sample}/")
    assert "although double_hit: a second pulse of" in note
    # What nobody spoke of stays as it was.
    others = {hit.record for hit in before} - {double.record}
    assert others <= rejections.keys()


def test_hits_are_named_in_one_recording_at_a_time(run, campaign):
    outcome = run("analyze", campaign.path, "other.mcap", "--reject", 1)
    assert outcome.exit_code == 2
    assert "analyze recordings one by one" in outcome.stderr
