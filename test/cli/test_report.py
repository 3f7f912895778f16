"""`impact-rig report`: a file to hand over, whatever it is made of."""

import json
import re
import shutil
from pathlib import Path

import pytest

from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.present.figures.markup import make_missing_figure
from impact_rig.present.report.pdf import BROWSERS
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


@pytest.fixture
def undrawn(monkeypatch):
    """Leave the figures out: drawing them takes its time, and they have tests of their own."""

    def miss(*values):
        return tuple(make_missing_figure(str(n), "A figure", "Not here.") for n in range(4))

    report = "impact_rig.present.report"
    monkeypatch.setattr(f"{report}.run.draw_campaign_figures", miss)
    monkeypatch.setattr(f"{report}.run.draw_sample_figure", lambda *a: miss()[0])
    monkeypatch.setattr(f"{report}.comparison.draw_comparison_figure", miss)


def make_newer(folder):
    """Make results.json one of a later version, and take the recording away."""
    (folder / "session.mcap").unlink()
    path = folder / "results.json"
    content = json.loads(path.read_text())
    content["format"]["version"] = 99
    path.write_text(json.dumps(content))
    return path


def read_text(path):
    return path.read_text(encoding="utf-8")


def test_the_report_of_a_run_lies_in_its_folder_and_is_never_overwritten(run, folder):
    outcome = run("report", folder)
    assert (outcome.exit_code, outcome.stdout) == (0, "")
    path = folder / "report.html"
    assert outcome.stderr == f"report: {path}\n"
    text = read_text(path)
    assert "monday/session.mcap" in text
    assert str(folder) not in text  # where it lies here is nobody's business
    for words in ("Paper", "[µs]", "brass medium *", "Fig. 3", "<svg", "2500"):
        assert words in text

    again = run("report", folder)
    assert again.exit_code == 2
    assert f"error: {path} exists already: name another file with -o" in again.stderr
    assert read_text(path) == text

    # The same input gives the same bytes, also under another name of the recording.
    other = folder / "new" / "other.html"
    assert run("report", folder / "session.mcap", "-o", other).exit_code == 0
    assert other.read_bytes() == path.read_bytes()


def test_simulators_have_a_chapter_when_asked_for(run, undrawn, folder):
    (folder / "session.mcap").unlink()
    assert run("report", folder, "--simulators").exit_code == 0
    text = read_text(folder / "report.html")
    assert "In simulators" in text
    assert "Contacts for PyBullet" in text


def test_a_run_that_cannot_be_read_does_not_keep_others_from_being_reported(
    run, undrawn, folder, tmp_path
):
    newer = make_newer(Path(shutil.copytree(folder, tmp_path / "newer")))
    out = tmp_path / "both.html"
    outcome = run("report", newer.parent, folder, tmp_path / "nothing", "-o", out)
    assert outcome.exit_code == 2
    errors = [line for line in outcome.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 2
    assert f"{newer}: has format version 99; this program reads version" in outcome.stderr
    text = read_text(out)
    assert "has format version 99" in text
    assert "Table 2." in text
    assert "Comparison" not in text


def test_results_that_contradict_themselves_are_refused_in_one_sentence(run, folder):
    (folder / "session.mcap").unlink()
    path = folder / "results.json"
    path.write_text(path.read_text().replace('"name": "brass medium"', '"name": "other"', 1))
    outcome = run("report", folder)
    assert outcome.exit_code == 2
    assert outcome.stderr.startswith(f"error: results {path}: ")
    assert "brass medium" in outcome.stderr


def test_nothing_is_written_if_no_run_can_be_read(run, folder, tmp_path):
    newer = make_newer(folder)
    out = tmp_path / "none.html"
    outcome = run("report", newer, "-o", out)
    assert outcome.exit_code == 2
    assert not out.exists()
    missing = run("report", tmp_path / "nothing")
    assert (missing.exit_code, missing.stderr) == (
        2,
        f"error: there is no file {tmp_path / 'nothing'}\n",
    )


def test_a_recording_that_is_lost_is_told_of_by_the_results_beside_it(run, undrawn, folder):
    (folder / "session.mcap").write_bytes(b"\x89MCAP0\r\nlost")
    outcome = run("report", folder)
    assert outcome.exit_code == 0
    text = read_text(folder / "report.html")
    assert "this is the results.json beside it" in text
    assert "Table 2." in text


def test_several_runs_are_compared_here(run, undrawn, folder, tmp_path, monkeypatch):
    later = Path(shutil.copytree(folder, tmp_path / "tuesday"))
    (later / "session.mcap").unlink()
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert run("report", folder, later).exit_code == 0
    text = read_text(here / "report.html")
    assert "tuesday against monday" in text
    assert re.search(r"none of [78] values changed beyond its uncertainty", text)
    assert "Run 1: monday" in text
    assert "Run 2: tuesday" in text


def test_every_campaign_of_a_recording_has_its_part(run, undrawn, record, tmp_path):
    path = tmp_path / "two.mcap"
    record(path, VirtualRigSettings(), ("aluminium large",), 2, campaigns=2)
    assert run("report", path).exit_code == 0
    text = read_text(tmp_path / "report.html")
    assert "two, campaign 2 against two, campaign 1" in text
    assert text.count("0.9765625") == 2  # each has its calibration


def test_without_a_browser_the_html_is_written_all_the_same(run, undrawn, folder, monkeypatch):
    monkeypatch.setenv("PATH", str(folder))
    outcome = run("report", folder, "--pdf")
    assert outcome.exit_code == 2
    assert "error: the PDF needs a browser that prints: install chromium" in outcome.stderr
    assert (folder / "report.html").exists()
    assert not (folder / "report.pdf").exists()


def test_the_pdf_lies_beside_the_html(run, undrawn, folder):
    if not any(map(shutil.which, BROWSERS)):
        pytest.skip("no browser prints the PDF: on Debian, apt-get install chromium")
    outcome = run("report", folder, "--pdf", "-o", folder / "for you.html")
    assert (outcome.exit_code, outcome.stdout) == (0, "")
    content = (folder / "for you.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    pages = len(re.findall(rb"/Type\s*/Page\b", content))
    assert 2 <= pages == len(re.findall(rb"/MediaBox \[0 0 59[45]", content))  # A4
    assert sorted(path.name for path in folder.iterdir()) == [
        "for you.html",
        "for you.pdf",
        "results.json",
        "session.mcap",
    ]


def test_what_cannot_be_written_is_refused_before_anything_is_read(run, folder):
    (folder / "report.pdf").write_text("precious")
    outcome = run("report", folder, "--pdf")
    assert outcome.exit_code == 2
    assert "report.pdf exists already" in outcome.stderr
    assert not (folder / "report.html").exists()
    named_as_pdf = folder / "x.pdf"
    named = run("report", folder, "-o", named_as_pdf)
    assert named.exit_code == 2
    assert named.stderr.startswith(f"error: {named_as_pdf} is named as a PDF: name the HTML file")
