"""Units over processes: the numbers do not depend on how many, nor on being stopped."""

import json
import shutil
import signal
import subprocess
import time

import psutil
import pytest

from impact_rig.core.errors import FileError
from impact_rig.study.cases import Configuration, Part
from impact_rig.study.run import (
    CONFIGURATION_NAME,
    UNITS_NAME,
    StudyFolder,
    plan_units,
    run_unit,
    run_units,
)

SELECTION_ONLY = Configuration(parts=(Part.SELECTION,), campaigns=3)


def keep_two(path):
    with StudyFolder(path, SELECTION_ONLY) as folder:
        folder.keep("a", {"found": 1})
        folder.keep("b", {"found": [None, 0.1]})


def test_finished_units_are_there_again(tmp_path):
    keep_two(tmp_path / "new")
    with StudyFolder(tmp_path / "new", SELECTION_ONLY) as folder:
        assert folder.finished == {"a": {"found": 1}, "b": {"found": [None, 0.1]}}


def test_a_line_that_a_kill_cut_short_is_done_again(tmp_path):
    keep_two(tmp_path)
    units = tmp_path / UNITS_NAME
    units.write_bytes(units.read_bytes()[:-9])
    with StudyFolder(tmp_path, SELECTION_ONLY) as folder:
        assert folder.finished == {"a": {"found": 1}}
        folder.keep("b", {"found": 2})
    with StudyFolder(tmp_path, SELECTION_ONLY) as folder:
        assert folder.finished == {"a": {"found": 1}, "b": {"found": 2}}


def test_a_spoilt_line_is_an_error_that_names_it(tmp_path):
    keep_two(tmp_path)
    units = tmp_path / UNITS_NAME
    units.write_text("{}\n" + units.read_text())
    with pytest.raises(FileError, match=r"units\.jsonl: line 1 is no finished unit"):
        StudyFolder(tmp_path, SELECTION_ONLY)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (Configuration((Part.SELECTION,), 4), "its campaigns is 3, here it is 4"),
        (Configuration((Part.SELECTION,), 3, seed=2), "its seed is 1, here it is 2"),
        (Configuration(campaigns=3), "its parts is selection, here it is coverage efficiency"),
    ],
)
def test_another_study_is_refused(tmp_path, other, words):
    keep_two(tmp_path)
    before = (tmp_path / UNITS_NAME).read_bytes()
    with pytest.raises(FileError, match=words):
        StudyFolder(tmp_path, other)
    assert (tmp_path / UNITS_NAME).read_bytes() == before


def test_the_study_of_another_version_is_refused(tmp_path):
    keep_two(tmp_path)
    path = tmp_path / CONFIGURATION_NAME
    path.write_text(json.dumps({**json.loads(path.read_text()), "program_version": "0.0.1"}))
    with pytest.raises(FileError, match=r"its program version is 0\.0\.1"):
        StudyFolder(tmp_path, SELECTION_ONLY)


@pytest.mark.parametrize("text", ["no json", "[]", '{"format": "results"}'])
def test_what_is_no_study_is_refused(tmp_path, text):
    (tmp_path / CONFIGURATION_NAME).write_text(text)
    with pytest.raises(FileError, match=r"configuration\.json: is not"):
        StudyFolder(tmp_path, SELECTION_ONLY)


def test_a_folder_is_one_studys_at_a_time(tmp_path):
    with StudyFolder(tmp_path, SELECTION_ONLY), pytest.raises(FileError, match="is in use"):
        StudyFolder(tmp_path, SELECTION_ONLY)
    with StudyFolder(tmp_path, SELECTION_ONLY) as folder:
        assert folder.finished == {}


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    with StudyFolder(tmp_path, SELECTION_ONLY) as folder:
        folder.write_bytes("study.json", b"old")
        (tmp_path / ".study.json.part").mkdir()
        with pytest.raises(FileError, match=r"study\.json: cannot be written"):
            folder.write_bytes("study.json", b"new")
    assert (tmp_path / "study.json").read_bytes() == b"old"


STOPPED = Configuration(parts=(Part.EFFICIENCY,), campaigns=12)
"""Ten units: one finished before the kill, one before Ctrl-C, one running then and one on its way
leave some to be done, unless this process is kept waiting longer than they take."""
COMMAND = (
    str(shutil.which("impact-rig")), "study", "efficiency", "--campaigns", "12", "--jobs", "1",
)  # fmt: skip
"""By the script that is on the path: the processes that a study starts import the file that
started their parent, which must not start the command once more."""
PATIENCE = 100.0
"""For what takes a second or two on a machine at rest [s]."""


def count_units(path):
    units = path / UNITS_NAME
    return units.read_bytes().count(b"\n") if units.exists() else 0


def start_and_wait_for_a_unit(path):
    before = count_units(path)
    process = subprocess.Popen(
        [*COMMAND, "--output", str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + PATIENCE
    while count_units(path) == before:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "no unit was finished"
        time.sleep(0.01)
    return process


def test_a_study_that_is_killed_then_stopped_goes_on_in_two_processes_to_the_same_end(tmp_path):
    process = start_and_wait_for_a_unit(tmp_path)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert workers
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(workers, timeout=PATIENCE)
    assert not alive

    process = start_and_wait_for_a_unit(tmp_path)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output) == (130, "")
    assert errors == (
        f"stopped; what is done is kept: the same command with --output {tmp_path} goes on\n"
    )
    assert count_units(tmp_path) >= 2

    steps = []
    with StudyFolder(tmp_path, STOPPED) as folder:
        kept = dict(folder.finished)
        run_units(STOPPED, folder, 2, lambda *step: steps.append(step))
        found = dict(folder.finished)
    units = plan_units(STOPPED)
    size = units[0].count
    assert steps == [(done * size, len(units) * size) for done in range(len(kept), len(units) + 1)]
    assert found.keys() == {unit.name for unit in units}
    assert found.items() >= kept.items()
    for unit in units[::3]:
        assert found[unit.name] == run_unit(unit, STOPPED.seed)
