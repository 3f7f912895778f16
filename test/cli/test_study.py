"""`impact-rig study`."""

import csv
import json
import shutil
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from impact_rig.cli.study import PARTS, command
from impact_rig.study import cases
from impact_rig.study.cases import Part

from .pseudo_terminal import find_widest


def test_the_parts_of_the_help_are_those_of_the_study():
    assert tuple(part.value for part in Part) == PARTS


@pytest.fixture(scope="module")
def small():
    """Leave little of what is varied, so that a study is small."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("NOISES", "BITS", "SAMPLING_RATES", "DAMPING_RATIOS"):
            patch.setattr(cases, name, ())
        for name in ("PULSE_SHAPES", "LAWS", "NOISE_LEVELS"):
            patch.setattr(cases, name, getattr(cases, name)[1:2])
        yield


@pytest.fixture(scope="module")
def study(small, tmp_path_factory):
    """Run a small study; return its folder and what it told."""
    folder = tmp_path_factory.mktemp("studies") / "small"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "80")
        done = CliRunner().invoke(
            command, ["--campaigns", "1", "--jobs", "1", "--output", str(folder)]
        )
    return folder, done


def test_tables_and_goals_fit_a_terminal(study):
    folder, done = study
    assert done.exit_code == 0, done.stderr  # though one campaign reaches no coverage goal
    text = " ".join(done.stdout.split())
    for words in (
        "Coverage of the 95 % intervals",
        "RMSE /",
        "paper's method",
        "identification",
        "93 to 97 %",
        "at most 1.15 bounds",
        "Faults by their size",
        "found and rightly named",
        "MISSED",
    ):
        assert words in text
    assert done.stderr.startswith(f"in {folder}: study.json")
    assert find_widest(done.stdout) <= 80


def test_a_study_that_goes_on_has_all_in_json_and_files_and_without_matplotlib_no_figure(
    run, study, tmp_path, monkeypatch
):
    drawn = {path.name for path in study[0].iterdir()}
    folder = Path(shutil.copytree(study[0], tmp_path / "copy"))
    for path in folder.glob("study.*"):
        path.unlink()
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    outcome = run("study", "--campaigns", 1, "--json", "--output", folder)
    assert outcome.exit_code == 0
    assert "no figure was drawn: Python finds no module 'matplotlib" in outcome.stderr
    content = json.loads(outcome.stdout, parse_constant=pytest.fail)
    assert content == json.loads((folder / "study.json").read_text("utf-8"))
    assert content["parts"] == list(PARTS)
    assert {row["part"] for row in content["rows"]} == {"coverage", "efficiency", "bias"}
    found = {
        (row["part"], row["value"], row["estimator"], row["quantity"]): row
        for row in content["rows"]
    }
    paper = found["coverage", "published", "paper", "contact_time"]
    assert (paper["campaigns"], paper["determined"]) == (1, 1)
    # One campaign's tau_p scatters by 0.1 %.
    assert abs(paper["bias_percent"]) < 0.5
    # A half-sine read with F = 2: a third too long.
    shape = found["bias", "half-sine", "paper", "contact_time"]
    assert shape["bias_percent"] == pytest.approx(100 / 3, abs=0.5)
    assert content["selection"]["good_rejected"] == 0
    assert all(isinstance(goal["is_reached"], bool) for goal in content["goals"])
    files = {"configuration.json", "selection.csv", "study.csv", "study.json", "units.jsonl"}
    assert {path.name for path in folder.iterdir()} == files
    assert drawn == {*files, "study.png", "study.svg"}
    with (folder / "study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(content["rows"])
    assert float(rows[0]["bias_percent"]) == content["rows"][0]["bias_percent"]


def test_the_folder_of_another_study_is_refused(run, study):
    folder, _ = study
    outcome = run("study", "--output", folder, "--campaigns", 3)
    assert outcome.exit_code == 2
    assert outcome.stderr == (
        f"error: the folder {folder} holds another study: its campaigns is 1, here it is 3;"
        " choose another --output\n"
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("colour",), "'colour' is not one of 'coverage', 'efficiency', 'bias'"),
        (("--campaigns", 0), "0 is not in the range x>=1"),
        (("--jobs", 0), "0 is not in the range x>=1"),
        (("--quick", "--campaigns", 3), "--quick and --campaigns exclude each other"),
    ],
)
def test_what_cannot_be_meant_is_refused(run, tmp_path, words, message):
    outcome = run("study", *words, "--output", tmp_path / "new")
    assert outcome.exit_code == 2
    assert message in outcome.stderr
    assert not (tmp_path / "new").exists()
