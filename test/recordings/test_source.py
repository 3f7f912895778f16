"""What a person names is found: a file, a folder as rosbag2 writes it, a run's folder."""

from pathlib import Path

import pytest

from impact_rig.core.errors import FileError
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.source import find_recording, is_recording, open_source


@pytest.fixture
def make_run(make_recording):
    """Return a function that records one hit under a name."""

    def make(name: str) -> Path:
        maker = make_recording(name)
        maker.add_setup()
        maker.add_block(1)
        return maker.close()

    return make


@pytest.mark.parametrize(
    ("recorded", "named", "found"),
    [
        ("run.mcap", "run.mcap", "run.mcap"),
        ("run/session.mcap", "run", "run/session.mcap"),
        ("run/session", "run/session", "run/session"),
        ("run/session", "run", "run/session"),
        ("run/session", "run/session/session_0.mcap", "run/session/session_0.mcap"),
        ("run/other.mcap", "run", "run/other.mcap"),
        ("run/hall_3.mcap", "run", "run/hall_3.mcap"),
    ],
)
def test_what_is_named_is_found_and_read(make_run, tmp_path, recorded, named, found):
    (tmp_path / "run").mkdir()
    make_run(recorded)
    path = tmp_path / named
    assert find_recording(path) == tmp_path / found
    assert is_recording(path)
    assert open_source(path).path == tmp_path / found
    assert len(list(read_recording(path).events())) == 2


def test_files_that_happen_to_be_numbered_are_not_joined(make_run, tmp_path):
    (tmp_path / "run").mkdir()
    make_run("run/hall_1.mcap")
    make_run("run/hall_2.mcap")
    with pytest.raises(FileError, match="run is a folder with 2 recordings: name one"):
        find_recording(tmp_path / "run")
    assert not is_recording(tmp_path / "run")


def test_where_there_is_no_recording_it_is_said(tmp_path):
    with pytest.raises(FileError, match=r"there is no file .*lost\.mcap"):
        find_recording(tmp_path / "lost.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="empty is a folder without a recording"):
        find_recording(tmp_path / "empty")
    (tmp_path / "empty" / "metadata.yaml").write_text("relative_file_paths: [x_0.mcap]")
    with pytest.raises(FileError, match="empty is a folder without a recording"):
        open_source(tmp_path / "empty")


def test_a_folder_without_permission_is_named(tmp_path, monkeypatch):
    def refuse(_: Path):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(FileError, match="cannot be read: Permission denied"):
        find_recording(tmp_path)
    assert not is_recording(tmp_path)


def test_traces_are_no_recording_and_a_recording_is_one_under_any_name(make_run, tmp_path):
    (tmp_path / "hit.csv").write_text("time,hammer\n0,1\n")
    assert not is_recording(tmp_path / "hit.csv")
    assert not is_recording(tmp_path / "lost.csv")
    assert is_recording(tmp_path / "lost.mcap")  # opening it tells that it is not there
    make_run("run.mcap").rename(tmp_path / "run.bak")
    assert is_recording(tmp_path / "run.bak")
