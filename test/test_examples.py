"""The examples of the README run as they are, and print what they promise."""

import re
import sys
from contextlib import closing
from pathlib import Path

import pytest
from terminal import run_program

from impact_rig.nodes.interfaces import DIAGNOSTICS
from impact_rig.testing import run_rig
from impact_rig.testing.harness import wait_until

EXAMPLES = Path(__file__).resolve().parent.parent / "launch_scripts" / "examples"
REPORT = (sys.executable, "-m", "impact_rig.cli.main", "report")
README = EXAMPLES.parent.parent / "README.md"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    with run_rig(folder=folder) as rig:
        rig.campaign(["steel small", "aluminium large"], impacts=2)
    return folder / "session.mcap"


PRINTED = {
    "drive_a_rig": r"2 hits: k = \d+",
    "many_recordings": r"aluminium large +1 +2",
    "own_estimator": r"steel small +1\d\d\.\d ± 3\.4\n",
    "own_source": r"rubber +(799|800)\d ± ",
    "replay_into_own_node": r"steel small 1 True",
    "score_an_estimator": r"steel small +5 +0 +-?0\.\d+ .* 100\.0",
}


def test_each_example_is_run_here_and_named_in_the_readme():
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert names == PRINTED.keys()
    assert set(re.findall(r"examples/(\w+)\.py", README.read_text("utf-8"))) == names


def test_the_results_of_an_estimator_of_ones_own_are_named_as_its(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    from own_estimator import NAME, OTHERS, Estimator

    told, heard = f"verdicts and numbers are by {NAME}, not by the rig", []
    with run_rig(folder=tmp_path, only=OTHERS) as rig, closing(Estimator(rig.domain)) as mine:
        mine.listen(DIAGNOSTICS, lambda message: heard.append(str(message)))
        rig.campaign("steel small", impacts=2)
        wait_until(lambda: any(told in text for text in heard))  # from there the page has it
    done = run_program([*REPORT, tmp_path / "results.json", "-o", tmp_path / "report.html"])
    assert told in (tmp_path / "report.html").read_text("utf-8"), done


@pytest.mark.parametrize("name", PRINTED)
def test_an_example_prints_what_it_promises(name, recording):
    words = {"many_recordings": [recording] * 2, "replay_into_own_node": [recording]}
    done = run_program([sys.executable, EXAMPLES / f"{name}.py", *words.get(name, [])])
    assert not done.returncode, done.stderr
    assert re.search(PRINTED[name], done.stdout), done.stdout
