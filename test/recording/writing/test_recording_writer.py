"""A recording, one file or a folder: read by other libraries, and safe once it is synced."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from rosbags.highlevel import AnyReader

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.writing import disk_file
from impact_rig.recording.writing.recording_writer import RecordingWriter

from .text_recordings import HIT, SECOND, START, encode, list_hits, read_by_mcap, read_by_stream


@pytest.mark.parametrize("name", ["session.mcap", "runs/today/session"])
def test_either_form_is_read_by_three_libraries(make, tmp_path, name):
    recording = make(name)
    recording.add(recording.setup, b"set-up")
    recording.add_hits(1, 2)
    recording.writer.close()

    assert [(topic, data[:2]) for topic, _, data in read_by_mcap(recording.writer.files[0])] == [
        ("/setup", "se"),
        ("/acceleration", "1 "),
        ("/acceleration", "2 "),
    ]
    with AnyReader([tmp_path / name]) as reader:
        assert next(data for _, _, data in reader.messages()) == encode(b"set-up")
        assert {item.topic: item.msgcount for item in reader.connections} == {
            "/setup": 1,
            "/acceleration": 2,
        }
        assert (reader.start_time, reader.end_time) == (
            START + SECOND // 10,
            START + 3 * SECOND // 10 + 1,
        )


@pytest.mark.skipif(shutil.which("rerun") is None, reason="the Rerun viewer is not installed")
def test_rerun_finds_nothing_wrong_with_it(make):
    recording = make("session.mcap")
    recording.add_hits(1, 2, 3)
    recording.writer.close()
    command = ["rerun", "mcap", "check", str(recording.writer.path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    findings = [line.split() for line in done.stdout.splitlines() if "/acceleration" in line]
    assert findings
    assert all((words[0], words[-1]) == ("ok", "—") for words in findings), done.stdout


def test_a_folder_is_laid_out_as_rosbag2_does(make, tmp_path):
    recording = make("bag")
    recording.writer.close()
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == [
        "bag_0.mcap",
        "metadata.yaml",
    ]
    assert recording.writer.path == tmp_path / "bag"
    assert recording.writer.files == (tmp_path / "bag" / "bag_0.mcap",)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from text_recordings import Writer
recording = Writer(Path({output!r}), split_size={split_size})
recording.add(recording.setup, b"set-up")
for number in (1, 2, 3):
    recording.add_hits(number)
    recording.writer.sync()
recording.add_hits(4)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(("name", "split_size"), [("one.mcap", 0), ("bag", 0), ("bag", 5000)])
def test_after_kill_9_everything_synced_is_in_the_files(tmp_path, name, split_size):
    script = KILLED.format(
        tests=str(Path(__file__).parent), output=str(tmp_path / name), split_size=split_size
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    files = sorted((tmp_path / name).glob("*.mcap")) or [tmp_path / name]
    hits = [data for path in files for data in read_by_stream(path) if HIT in data]
    assert hits == [encode(b"%d " % number + HIT) for number in (1, 2, 3)]
    if name == "bag":
        text = (tmp_path / name / "metadata.yaml").read_text()
        content = yaml.safe_load(text)["rosbag2_bagfile_information"]
        assert content["relative_file_paths"] == [path.name for path in files]
        names = [item["topic_metadata"]["name"] for item in content["topics_with_message_count"]]
        assert names == ["/setup", "/acceleration"]


def test_a_sync_returns_when_the_disk_has_the_hit(make, monkeypatch):
    recording = make("session.mcap")
    sizes = []
    monkeypatch.setattr(os, "fdatasync", lambda file: sizes.append(os.fstat(file).st_size))
    recording.add_hits(1)
    recording.writer.flush()
    assert sizes == []
    recording.add_hits(2)
    recording.writer.sync()
    assert sizes == [recording.writer.size]
    assert len(HIT) * 2 < sizes[0] == recording.writer.files[0].stat().st_size


def test_a_stream_is_sent_to_the_disk_while_it_is_written(make, monkeypatch):
    """Else a sync, or the end of a file in a stream, waits for seconds of data."""
    sent = []
    monkeypatch.setattr(
        os, "posix_fadvise", lambda file, start, length, advice: sent.append((start, length))
    )
    monkeypatch.setattr(disk_file, "SENT_AT_ONCE", 10_000)
    recording = make("session.mcap", chunk_size=4000)
    recording.add_hits(*range(10))
    assert [start for start, _ in sent] == [0, sent[0][1]]
    assert all(10_000 <= length < 20_000 for _, length in sent)
    assert recording.writer.size - sum(length for _, length in sent) < 10_000


@pytest.mark.parametrize(
    ("name", "options", "told"),
    [
        ("session.mcap", {"split_size": 1000}, "cannot be split: name a folder, without .mcap"),
        ("session.mcap", {"split_duration": 1.0}, "cannot be split"),
        ("session", {"split_size": -1}, "split_size is -1 byte: it must not be negative"),
        ("session", {"split_duration": -1.0}, "split_duration is -1.0 s: it must be from 0"),
        ("session", {"split_duration": float("nan")}, "split_duration is nan s"),
        ("session", {"keep_free": -1}, "keep_free is -1 byte: it must not be negative"),
        ("session", {"compression": "gzip"}, "zstd, lz4, none"),
    ],
)
def test_impossible_options_leave_nothing_behind(tmp_path, name, options, told):
    with pytest.raises(ParameterError, match=told):
        RecordingWriter(tmp_path / "runs" / name, **options)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("name", ["session_0.mcap", "metadata.yaml", "other.db3"])
def test_a_folder_with_a_recording_is_never_written_to(tmp_path, name):
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / name).write_bytes(b"precious")
    with pytest.raises(FileError, match=rf"session holds a recording already \({name}\)"):
        RecordingWriter(tmp_path / "session")
    assert [path.name for path in (tmp_path / "session").iterdir()] == [name]
    assert (tmp_path / "session" / name).read_bytes() == b"precious"


def test_an_existing_file_is_never_overwritten(tmp_path):
    (tmp_path / "session.mcap").write_bytes(b"precious")
    with pytest.raises(FileError, match=r"session\.mcap exists already"):
        RecordingWriter(tmp_path / "session.mcap")
    assert (tmp_path / "session.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["file", "file/session", "file/session.mcap"])
def test_a_file_in_the_way_of_a_folder_is_named(tmp_path, name):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"file.* cannot be made: a file is in its way"):
        RecordingWriter(tmp_path / name)


@pytest.fixture
def locked_folder(tmp_path):
    """Return a folder in which this process may write nothing, root or not."""
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    yield folder
    if is_root:
        os.seteuid(0)


@pytest.mark.parametrize("name", ["session", "session.mcap", "runs/session"])
def test_a_folder_without_permission_is_one_sentence(locked_folder, name):
    with pytest.raises(FileError, match=r"^[^\n]*locked.* cannot be .*: Permission denied$"):
        RecordingWriter(locked_folder / name)


def test_a_file_in_the_way_of_the_next_one_ends_the_recording_well(make, tmp_path):
    recording = make(split_size=1)
    recording.add_hits(1)
    (tmp_path / "session" / "session_1.mcap").write_bytes(b"precious")
    with pytest.raises(FileError, match=r"session_1\.mcap exists already"):
        recording.writer.sync()
    recording.add_hits(2)
    recording.writer.close()
    assert list_hits(recording.writer.files[0]) == [1, 2]
    assert (tmp_path / "session" / "session_1.mcap").read_bytes() == b"precious"


def test_a_finished_recording_takes_no_more(make):
    recording = make()
    recording.add_hits(1)
    recording.writer.close()
    recording.writer.close()
    assert (recording.writer.closed, recording.writer.free_space) == (True, 0)
    with pytest.raises(FileError, match="is closed already"):
        recording.add_hits(2)
    with pytest.raises(FileError, match="is closed already"):
        recording.writer.sync()
