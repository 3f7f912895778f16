"""The examples of the README run as they are, and print what they promise."""

import re
import sys
from pathlib import Path

import pytest
from terminal import run_program

from impact_rig.testing import run_rig

EXAMPLES = Path(__file__).resolve().parent.parent / "launch_scripts" / "examples"
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
    "own_source": r"rubber +\d",
    "replay_into_own_node": r"steel small 1 True",
    "score_an_estimator": r"steel small +5 +0 +-?0\.\d+ .* 100\.0",
}


def test_each_example_is_run_here_and_named_in_the_readme():
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert names == PRINTED.keys()
    assert set(re.findall(r"examples/(\w+)\.py", README.read_text("utf-8"))) == names


@pytest.mark.parametrize("name", PRINTED)
def test_an_example_prints_what_it_promises(name, recording):
    words = {"many_recordings": [recording] * 2, "replay_into_own_node": [recording]}
    done = run_program([sys.executable, EXAMPLES / f"{name}.py", *words.get(name, [])])
    assert not done.returncode, done.stderr
    assert re.search(PRINTED[name], done.stdout), done.stdout
