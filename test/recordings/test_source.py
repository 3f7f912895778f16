"""What a person names is found: a file, the folder of a run, a folder with one recording."""

import os
import shlex
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.arrays import is_list
from impact_rig.files.formats.registry import read_measurement
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import find_recordings, is_recording
from impact_rig.results.results_file import read_results


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
    ],
)
def test_what_is_named_is_found_and_read(make_run, tmp_path, recorded, named, found):
    (tmp_path / "run").mkdir()
    make_run(recorded)
    path = tmp_path / named
    assert find_recordings(path) == (tmp_path / found,)
    assert is_recording(path)
    assert len(list(Run(path).events())) == 2


@pytest.mark.parametrize("named", ["", "session.mcap", "session-2.mcap", "session-3.mcap"])
def test_a_file_of_a_run_that_was_resumed_stands_for_all_of_it(make_run, tmp_path, named):
    (tmp_path / "run").mkdir()
    names = ["session.mcap", "session-2.mcap", "session-3.mcap"]
    files = tuple(make_run(f"run/{name}") for name in names)
    run = Run(tmp_path / "run" / named)
    assert run.files == files
    assert (run.title, run.folder) == ("run", tmp_path / "run")
    told = [f"part of a run that was resumed: all of it is read, {', '.join(names)}"]
    assert [warning.partition(" is ")[2] for warning in run.warnings] == told * bool(named)


def test_what_the_recorder_did_not_write_is_no_part_of_a_run(make_recording, make_run, tmp_path):
    first, third = make_run("session.mcap"), make_run("session-3.mcap")
    maker = make_recording("session-2.mcap", library="impact_rig-recover 1.0")
    maker.add_setup()
    copy = maker.close()
    assert Run(first).files == Run(third).files == (first, third)
    assert Run(copy).files == (copy,)
    alone = make_run("other-2.mcap")
    assert Run(alone).files == (alone,)


def test_of_a_recorder_that_was_killed_at_once_nothing_is_read(make_run, tmp_path):
    second = make_run("session-2.mcap")
    (tmp_path / "session.mcap").touch()
    (tmp_path / "session-3.mcap").touch()
    assert Run(tmp_path).files == Run(second).files == (second,)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "session.mcap").touch()
    with pytest.raises(FileError, match=r"session\.mcap is empty"):
        _ = Run(tmp_path / "empty").setup


def test_of_several_in_a_folder_one_must_be_named_and_a_split_one_converted(make_run, tmp_path):
    (tmp_path / "run").mkdir()
    make_run("run/hall_1.mcap")
    make_run("run/hall_2.mcap")
    with pytest.raises(FileError, match="run is a folder with 2 recordings: name one") as error:
        find_recordings(tmp_path / "run")
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
            find_recordings(path)
        assert list_conversion(error) == [str(folder), f"{folder}.converted"]


def test_a_folder_by_another_recorder_is_read(tmp_path):
    folder, data = tmp_path / "bag", b"\0\1\0\0\2\0\0\0a\0"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        types = get_typestore(Stores.ROS2_JAZZY)
        text = writer.add_connection("/text", "std_msgs/msg/String", typestore=types)
        for time in (5, 7):
            writer.write(text, time, data)
    assert sorted(path.name for path in folder.iterdir()) == ["bag.mcap", "metadata.yaml"]
    messages = list(Scan(*find_recordings(folder)).read_messages())
    assert [(item.channel.topic, item.log_time, item.data) for item in messages] == [
        ("/text", 5, data),
        ("/text", 7, data),
    ]


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
        Run(path)


@pytest.mark.parametrize(
    "read", [find_recordings, Scan, read_results, read_rig_file, read_measurement]
)
def test_a_pipe_which_may_never_end_is_refused_by_every_door(tmp_path, read):
    path = tmp_path / "session.mcap"
    os.mkfifo(path)
    assert is_recording(path)  # whose reader says what it is
    with pytest.raises(FileError, match=r"session\.mcap.*cannot be read.*it is no regular file"):
        read(path)


def test_a_pipe_is_no_list_of_channels_and_nobody_waits_for_it(tmp_path):
    os.mkfifo(path := tmp_path / "results.json")
    assert not is_list(path)
