"""A results file on the command line: its tables once more, without its recording."""

import json

import pytest

from impact_rig.results.results_file import write_results


@pytest.fixture
def path(tmp_path, results):
    """Return a results file of the paper's campaign."""
    path = tmp_path / "results.json"
    write_results(path, results)
    return path


def test_the_tables_of_a_results_file_are_shown(run, path, results):
    outcome = run("analyze", path, "--full")
    assert outcome.exit_code == 0
    value = results.samples[0].contact_time.value * 1e6
    for words in ("Table 2", "Table 4", results.samples[0].name, f"{value:.1f}"):
        assert words in outcome.stdout
    assert "below 0.05 %" not in outcome.stdout


def test_json_is_there_as_well(run, path):
    assert json.loads(run("analyze", path, "--json").stdout) == json.loads(path.read_text("utf-8"))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--cutoff", "off"), "--cutoff does not change "),
        (("--accept", "3"), "--accept does not change "),
        (("--hammer-mass", "1kg"), "--hammer-mass does not change "),
        (("hit.npy",), "it is shown alone"),
    ],
)
def test_what_a_results_file_has_no_use_for_is_refused(run, path, words, sentence):
    outcome = run("analyze", path, *words)
    assert outcome.exit_code == 2
    assert sentence in outcome.stderr
    assert outcome.stdout == ""


def test_another_json_file_and_a_newer_one_are_one_sentence(run, path, tmp_path):
    other = tmp_path / "other.json"
    other.write_text("{}", "utf-8")
    assert "is not a results file" in run("analyze", other).stderr
    newer = json.loads(path.read_text("utf-8"))
    newer["format"]["version"] = 99
    path.write_text(json.dumps(newer), "utf-8")
    outcome = run("analyze", path)
    assert outcome.exit_code == 2
    assert "format version 99" in outcome.stderr
