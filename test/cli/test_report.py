"""`impact-rig report`: a file to hand over, whatever it is made of."""

import shutil
from pathlib import Path

import pytest

from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import write_results

SAMPLES = ("aluminium large", "brass medium")


@pytest.fixture(scope="module")
def recorded(record, tmp_path_factory):
    """Return the folder of a run of two samples, two hits each."""
    folder = tmp_path_factory.mktemp("runs") / "monday"
    folder.mkdir()
    settings = VirtualRigSettings(seed=3, plant=Plant.DYNAMICS)
    campaign = record(folder / "session.mcap", settings, SAMPLES, 2)
    write_results(folder / "results.json", campaign.results)
    return folder


@pytest.fixture
def folder(recorded, tmp_path):
    """Return a copy of it that a test may write into."""
    return Path(shutil.copytree(recorded, tmp_path / "monday"))


def read_text(path):
    return path.read_text(encoding="utf-8")


def test_the_report_of_a_run_lies_in_its_folder_and_is_never_overwritten(run, folder):
    outcome = run("report", folder)
    assert (outcome.exit_code, outcome.stdout) == (0, "")
    path = folder / "report.html"
    assert outcome.stderr == f"report: {path}\n"
    text = read_text(path)
    assert "monday/session.mcap" in text
    assert str(folder) not in text  # the folder's path here is private
    for words in ("Paper", "[µs]", "brass medium *", "Fig. 3", "data:image/svg+xml", "2500"):
        assert words in text

    again = run("report", folder)
    assert again.exit_code == 2
    assert f"error: {path} exists already: name another file with -o" in again.stderr
    assert read_text(path) == text

    # The same input gives the same bytes, also under another name of the recording.
    other = folder / "new" / "other.html"
    assert run("report", folder / "session.mcap", "-o", other).exit_code == 0
    assert other.read_bytes() == path.read_bytes()


def test_results_that_contradict_themselves_are_refused_in_one_sentence(run, folder):
    (folder / "session.mcap").unlink()
    path = folder / "results.json"
    path.write_text(path.read_text().replace('"name": "brass medium"', '"name": "other"', 1))
    outcome = run("report", folder)
    assert outcome.exit_code == 2
    assert outcome.stderr.startswith(f"error: results {path}: ")
    assert "brass medium" in outcome.stderr


def test_a_recording_that_is_lost_is_told_of_by_the_results_beside_it(run, folder):
    (folder / "session.mcap").write_bytes(b"\x89MCAP0\r\nlost")
    outcome = run("report", folder)
    assert outcome.exit_code == 0
    text = read_text(folder / "report.html")
    assert "this is the results.json beside it" in text
    assert "Table 2." in text


def test_every_campaign_of_a_recording_has_its_part(run, record, tmp_path):
    path = tmp_path / "two.mcap"
    record(path, VirtualRigSettings(), ("aluminium large",), 2, campaigns=2)
    assert run("report", path).exit_code == 0
    text = read_text(tmp_path / "report.html")
    assert text.index("two, campaign 1") < text.index("two, campaign 2")
    assert text.count("0.9765625") == 2  # each has its calibration
