"""What a person means by a run, and what it is called."""

from pathlib import Path

import pytest

from impact_rig.analysis.report_sources import find_run
from impact_rig.core.errors import FileError


def make_files(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_a_run_is_its_recording_and_else_its_results(tmp_path):
    make_files(tmp_path, "a/session.mcap", "a/results.json", "b/results.json", "c/notes.txt")
    found = find_run(tmp_path / "a")
    assert (found.path, found.is_recording) == (tmp_path / "a" / "session.mcap", True)
    found = find_run(tmp_path / "b")
    assert (found.path, found.is_recording) == (tmp_path / "b" / "results.json", False)
    with pytest.raises(FileError, match="a folder without a recording"):
        find_run(tmp_path / "c")


def test_a_results_file_is_taken_at_its_word_though_a_recording_lies_beside_it(tmp_path):
    make_files(tmp_path, "a/session.mcap", "a/results.json")
    assert not find_run(tmp_path / "a" / "results.json").is_recording


def test_a_report_belongs_beside_what_it_is_of(tmp_path):
    make_files(tmp_path, "a/session.mcap")
    assert find_run(tmp_path / "a").folder == tmp_path / "a"


def test_a_run_is_called_by_its_folder_and_a_recording_by_itself(tmp_path):
    make_files(tmp_path, "monday/session.mcap", "tuesday/results.json", "steel.mcap")
    named = ("monday", "tuesday/results.json", "steel.mcap")
    titles = [find_run(tmp_path / name).title for name in named]
    assert titles == ["monday", "tuesday", "steel"]


def test_where_a_run_lies_on_this_machine_is_not_told(tmp_path, monkeypatch):
    make_files(tmp_path, "monday/session.mcap")
    monkeypatch.chdir(tmp_path / "monday")
    for path in (tmp_path / "monday", Path("session.mcap"), Path()):
        assert find_run(path).place == "monday/session.mcap"
