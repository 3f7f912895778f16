"""What a person names is found: a file, the folder of a run, a folder with one recording."""

import shlex
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from impact_rig.core.errors import FileError
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import find_recording, is_recording


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
    assert len(list(read_recording(path).events())) == 2


def test_of_several_in_a_folder_one_must_be_named_and_a_split_one_converted(make_run, tmp_path):
    (tmp_path / "run").mkdir()
    make_run("run/hall_1.mcap")
    make_run("run/hall_2.mcap")
    with pytest.raises(FileError, match="run is a folder with 2 recordings: name one") as error:
        find_recording(tmp_path / "run")
    assert not is_recording(tmp_path / "run")
    assert list_conversion(error) == [str(tmp_path / "run"), f"{tmp_path / 'run'}.converted"]


def list_conversion(error) -> list[str]:
    """Return from where to where the command converts that an error names."""
    words = shlex.split(str(error.value).partition("rosbags-convert ")[2])
    assert words[::2] == ["--src", "--dst", "--dst-storage"]
    assert words[5] == "mcap"
    return words[1:5:2]


@pytest.mark.parametrize("name", ["old_0.db3", "old_0.mcap.zstd"])
def test_what_has_to_be_converted_is_refused_with_the_command(tmp_path, name):
    folder = tmp_path / "an old one"
    folder.mkdir()
    (folder / name).write_bytes(b"SQLite format 3")
    for path in (folder, folder / name):
        with pytest.raises(FileError, match="cannot be read: rosbags makes one") as error:
            find_recording(path)
        assert list_conversion(error) == [str(folder), f"{folder}.converted"]


def test_a_folder_by_another_recorder_is_read(tmp_path):
    folder, data = tmp_path / "bag", b"\0\1\0\0\2\0\0\0a\0"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        types = get_typestore(Stores.ROS2_JAZZY)
        text = writer.add_connection("/text", "std_msgs/msg/String", typestore=types)
        for time in (5, 7):
            writer.write(text, time, data)
    assert sorted(path.name for path in folder.iterdir()) == ["bag.mcap", "metadata.yaml"]
    messages = list(Scan(find_recording(folder)).read_messages())
    assert [(item.channel.topic, item.log_time, item.data) for item in messages] == [
        ("/text", 5, data),
        ("/text", 7, data),
    ]


def test_where_there_is_no_recording_it_is_said(tmp_path):
    with pytest.raises(FileError, match=r"there is no file .*lost\.mcap"):
        find_recording(tmp_path / "lost.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="empty is a folder without a recording"):
        find_recording(tmp_path / "empty")


def test_traces_are_no_recording_and_a_recording_is_one_under_any_name(make_run, tmp_path):
    (tmp_path / "hit.csv").write_text("time,hammer\n0,1\n")
    assert not is_recording(tmp_path / "hit.csv")
    assert not is_recording(tmp_path / "lost.csv")
    assert is_recording(tmp_path / "lost.mcap")  # opening it tells that it is not there
    make_run("run.mcap").rename(tmp_path / "run.bak")
    assert is_recording(tmp_path / "run.bak")


def test_what_git_lfs_leaves_in_place_of_a_recording_is_called_so(tmp_path):
    path = tmp_path / "session.mcap"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(FileError, match=r"session\.mcap is what git-lfs leaves.*git lfs pull"):
        read_recording(path)
