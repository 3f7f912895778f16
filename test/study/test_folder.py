"""The folder of a study: what was done is kept, what is another's is refused."""

import json

import pytest

from impact_rig.core.errors import FileError
from impact_rig.study.cases import Configuration, Part
from impact_rig.study.folder import CONFIGURATION_NAME, UNITS_NAME, StudyFolder

SMALL = Configuration(parts=(Part.SELECTION,), campaigns=3)


def keep_two(path):
    with StudyFolder(path, SMALL) as folder:
        folder.keep("a", {"found": 1})
        folder.keep("b", {"found": [None, 0.1]})


def test_finished_units_are_there_again(tmp_path):
    keep_two(tmp_path / "new")
    with StudyFolder(tmp_path / "new", SMALL) as folder:
        assert folder.finished == {"a": {"found": 1}, "b": {"found": [None, 0.1]}}


def test_a_line_that_a_kill_cut_short_is_done_again(tmp_path):
    keep_two(tmp_path)
    units = tmp_path / UNITS_NAME
    units.write_bytes(units.read_bytes()[:-9])
    with StudyFolder(tmp_path, SMALL) as folder:
        assert folder.finished == {"a": {"found": 1}}
        folder.keep("b", {"found": 2})
    with StudyFolder(tmp_path, SMALL) as folder:
        assert folder.finished == {"a": {"found": 1}, "b": {"found": 2}}


def test_a_spoilt_line_is_an_error_that_names_it(tmp_path):
    keep_two(tmp_path)
    units = tmp_path / UNITS_NAME
    units.write_text("{}\n" + units.read_text())
    with pytest.raises(FileError, match=r"units\.jsonl: line 1 is no finished unit"):
        StudyFolder(tmp_path, SMALL)


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
        StudyFolder(tmp_path, SMALL)


@pytest.mark.parametrize("text", ["no json", "[]", '{"format": "results"}'])
def test_what_is_no_study_is_refused(tmp_path, text):
    (tmp_path / CONFIGURATION_NAME).write_text(text)
    with pytest.raises(FileError, match=r"configuration\.json: is not"):
        StudyFolder(tmp_path, SMALL)


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "session.mcap").write_text("precious")
    with pytest.raises(FileError, match="holds other files and no study"):
        StudyFolder(tmp_path, SMALL)
    assert [path.name for path in tmp_path.iterdir()] == ["session.mcap"]


def test_a_folder_is_one_studys_at_a_time(tmp_path):
    with StudyFolder(tmp_path, SMALL), pytest.raises(FileError, match="is in use"):
        StudyFolder(tmp_path, SMALL)
    with StudyFolder(tmp_path, SMALL) as folder:
        assert folder.finished == {}


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"cannot be used: .*; choose another --output"):
        StudyFolder(tmp_path / "file" / "below", SMALL)


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    with StudyFolder(tmp_path, SMALL) as folder:
        folder.write_bytes("study.json", b"old")
        (tmp_path / ".study.json.part").mkdir()
        with pytest.raises(FileError, match=r"study\.json: cannot be written"):
            folder.write_bytes("study.json", b"new")
    assert (tmp_path / "study.json").read_bytes() == b"old"
