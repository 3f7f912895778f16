"""Recordings of every version are read for ever, and give what was printed when they were made."""

import re
from pathlib import Path

import pytest

import impact_rig as ir

RECORDINGS = Path(__file__).parents[1] / "data" / "recordings"
NAMES = sorted(path.stem for path in RECORDINGS.glob("*.mcap"))


@pytest.fixture(params=NAMES)
def name(request):
    return request.param


@pytest.fixture
def recording(name, tmp_path):
    """Return a recording in a folder that a test may write into."""
    path = tmp_path / f"{name}.mcap"
    path.write_bytes((RECORDINGS / path.name).read_bytes())
    return path


@pytest.fixture
def printed(name):
    """Return the lines that it gave when it was made, words parted by one space."""
    return (RECORDINGS / f"{name}.txt").read_text("utf-8").splitlines()


def collapse(text):
    return re.sub(r"\s+", " ", text)


def test_its_results_are_those_that_were_printed(run, recording, printed):
    outcome = run("analyze", recording)
    assert outcome.exit_code == 0
    found = collapse(outcome.stdout)
    assert [line for line in printed if line not in found] == []
    name, value, uncertainty = re.match(r"(steel small) (\S+) ± (\S+)", printed[1]).groups()
    contact_time = ir.open_run(recording).analyze()[name].contact_time
    assert f"{1e6 * contact_time.value:.2f}" == value
    assert f"{1e6 * contact_time.expanded:.2f}" == uncertainty


def test_it_can_be_reported_viewed_exported_and_copied(run, recording, printed, tmp_path):
    for words in (
        ("report", recording, "-o", tmp_path / "report.html"),
        ("view", recording, "-o", tmp_path / "view.rrd"),
        ("export", recording, "-o", tmp_path / "copy.mcap"),
        ("export", recording, "-o", tmp_path / "hits.mat"),
    ):
        outcome = run(*words)
        assert (outcome.exit_code, outcome.stderr.count("error")) == (0, 0), words
    assert "170.10" in (tmp_path / "report.html").read_text("utf-8")
    copied = collapse(run("analyze", tmp_path / "copy.mcap").stdout)
    assert [line for line in printed if line not in copied] == []


def test_info_says_which_version_wrote_it(run, recording):
    outcome = run("info", recording)
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("sound: ")
    assert "versions   impact_rig" in outcome.stdout
