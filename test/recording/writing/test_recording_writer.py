"""A recording, one file or a folder: read by other libraries, split between hits, never lost."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import mcap.reader
import mcap.stream_reader
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.recording_writer import RecordingWriter
from impact_rig.recording.writing.split_contents import HEALTH_RECORD

TEXT = MessageDefinition("std_msgs/msg/String", "string data\n")
STATE = (OfferedQos("reliable", "transient_local", "keep_last", 1),)
STREAM = (OfferedQos("reliable", "volatile", "keep_last", 200),)
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
HIT = b"x" * 3000


def encode(text: bytes) -> bytes:
    """Return a std_msgs/String in CDR."""
    return b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little") + text + b"\0"


class Writer:
    """A recording with a set-up and a stream of hits, ten in a second."""

    def __init__(self, output: Path, **options) -> None:
        self.writer = RecordingWriter(output, compression="none", **options)
        self.setup = self.writer.add_channel("/setup", TEXT, STATE)
        self.stream = self.writer.add_channel("/acceleration", TEXT, STREAM)
        self.time = START

    def add(self, channel: int, text: bytes) -> None:
        self.time += SECOND // 10
        self.writer.add_message(channel, encode(text), self.time, self.time - 1000)

    def add_hits(self, *numbers: int) -> None:
        for number in numbers:
            self.add(self.stream, b"%d " % number + HIT)


@pytest.fixture
def make(tmp_path):
    """Return a function that begins a recording; what is still open at the end is closed."""
    made = []

    def begin(name: str = "session", **options) -> Writer:
        made.append(Writer(tmp_path / name, **options))
        return made[-1]

    yield begin
    for item in made:
        item.writer.close()


def read_by_mcap(path: Path) -> list:
    """Return topic, sequence and text of each message, by the index of one file."""
    with path.open("rb") as file:
        reader = mcap.reader.make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        )
        found = list(reader.iter_decoded_messages())
    return [
        (item.channel.topic, item.message.sequence, item.decoded_message.data) for item in found
    ]


def read_by_stream(path: Path) -> list[bytes]:
    """Return the messages of a file that may have no end, by a reader that needs none."""
    messages = []
    with path.open("rb") as file, contextlib.suppress(mcap.exceptions.EndOfFile):
        messages.extend(
            record.data
            for record in mcap.stream_reader.StreamReader(file, validate_crcs=True).records
            if type(record).__name__ == "Message"
        )
    return messages


def list_hits(path: Path) -> list[int]:
    return [
        int(text.split()[0]) for topic, _, text in read_by_mcap(path) if topic == "/acceleration"
    ]


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


def test_the_next_file_begins_when_a_hit_is_complete(make):
    recording = make(split_size=8000)
    for number in range(1, 8):
        recording.add_hits(number)
        recording.writer.flush() if number == 1 else recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1, 2, 3], [4, 5, 6], [7]]


def test_in_continuous_streaming_the_next_file_begins_with_a_chunk(make):
    recording = make(split_size=8000)
    for number in range(1, 8):
        recording.add_hits(number)
        recording.writer.flush()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1, 2, 3], [4, 5, 6], [7]]


def test_a_stream_that_is_never_flushed_is_split_too(make):
    recording = make(split_size=8000, chunk_size=4000)
    recording.add_hits(*range(1, 12))
    recording.writer.close()
    hits = [list_hits(path) for path in recording.writer.files]
    assert [number for part in hits for number in part] == list(range(1, 12))
    assert {len(part) for part in hits[:-1]} == {4}


def test_a_flush_does_not_cut_a_hit_in_two(make):
    recording = make(split_size=10_000)
    recording.add_hits(1)
    recording.writer.sync()
    for number in (2, 3, 4):
        recording.add_hits(number)
        recording.writer.flush()
    assert len(recording.writer.files) == 1
    recording.writer.sync()
    assert len(recording.writer.files) == 2


def test_files_are_split_by_time_as_well(make):
    recording = make(split_duration=0.3)
    for number in range(8):
        recording.add_hits(number)
        recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[0, 1, 2, 3], [4, 5, 6, 7], []]


def test_nothing_new_begins_no_file(make):
    recording = make(split_size=1)
    recording.add(recording.setup, b"set-up")
    for _ in range(3):
        recording.writer.sync()
        recording.writer.flush()
    assert len(recording.writer.files) == 2


def test_each_file_can_be_read_alone(make):
    recording = make(split_size=1)
    recording.writer.add_metadata("impact_rig", {"notes": "old"})
    recording.writer.add_metadata("impact_rig", {"notes": "new"})
    recording.writer.add_attachment("rig.toml", "application/toml", b"[hammer]")
    recording.add(recording.setup, b"first")
    recording.add(recording.setup, b"second")
    recording.add_hits(1)
    recording.writer.sync()
    recording.add_hits(2)
    recording.writer.close()

    first, second = recording.writer.files
    assert [(topic, number) for topic, number, _ in read_by_mcap(first)] == [
        ("/setup", 0),
        ("/setup", 1),
        ("/acceleration", 0),
    ]
    # The number of the repeated message tells that it is no new one.
    assert [(topic, number, text[:6]) for topic, number, text in read_by_mcap(second)] == [
        ("/setup", 1, "second"),
        ("/acceleration", 1, "2 xxxx"),
    ]
    with second.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = [
            (item.name, item.media_type, item.data) for item in reader.iter_attachments()
        ]
        messages = [message for _, _, message in reader.iter_messages()]
    assert records["impact_rig"] == {"notes": "new"}
    assert attachments == [("rig.toml", "application/toml", b"[hammer]")]
    assert [message.log_time - START for message in messages] == [
        3 * SECOND // 10,
        4 * SECOND // 10,
    ]
    assert messages[0].publish_time == START + 2 * SECOND // 10 - 1000
    assert (recording.writer.messages, recording.writer.count_messages("/setup")) == (4, 2)


def test_a_stream_is_not_repeated(make):
    recording = make(split_size=1)
    recording.add_hits(1)
    recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1], []]


def test_the_health_of_a_file_stays_in_it(make):
    def tell_health() -> None:
        recording.writer.add_metadata(HEALTH_RECORD, {"end": "split"})

    recording = make(split_size=1, before_split=tell_health)
    recording.add_hits(1)
    recording.writer.sync()
    recording.add_hits(2)
    recording.writer.add_metadata(HEALTH_RECORD, {"end": "closed"})
    recording.writer.close()
    ends = []
    for path in recording.writer.files:
        with path.open("rb") as file:
            records = mcap.reader.make_reader(file).iter_metadata()
            ends.append([item.metadata["end"] for item in records if item.name == HEALTH_RECORD])
    assert ends == [["split"], ["closed"]]


def test_rosbags_reads_all_files_of_a_folder_as_one(make, tmp_path):
    recording = make(split_size=1)
    recording.add(recording.setup, b"set-up")
    for number in (1, 2, 3):
        recording.add_hits(number)
        recording.writer.sync()
    recording.writer.close()
    with AnyReader([tmp_path / "session"]) as reader:
        found = [(item.topic, time, data) for item, time, data in reader.messages()]
        counts = {item.topic: item.msgcount for item in reader.connections}
        assert reader.message_count == len(found)
    assert [data[:10] for topic, _, data in found if topic == "/acceleration"] == [
        encode(b"%d " % number + HIT)[:10] for number in (1, 2, 3)
    ]
    assert counts == {"/setup": 4, "/acceleration": 3}
    times = [time for _, time, _ in found]
    assert times == sorted(times)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from(["setup", "hit", "flush", "sync"]), max_size=20))
def test_whatever_the_order_nothing_is_lost_or_counted_twice(tmp_path_factory, steps):
    recording = Writer(tmp_path_factory.mktemp("law") / "session", split_size=5000)
    added = []
    for number, step in enumerate(steps):
        if step == "hit":
            recording.add_hits(number)
            added.append(("/acceleration", str(number)))
        elif step == "setup":
            recording.add(recording.setup, b"%d" % number)
            added.append(("/setup", str(number)))
        else:
            getattr(recording.writer, step)()
    recording.writer.close()
    seen = set()
    found = []
    for path in recording.writer.files:
        for topic, sequence, text in read_by_mcap(path):
            if (topic, sequence) not in seen:
                seen.add((topic, sequence))
                found.append((topic, text.split()[0]))
    assert found == added
    assert recording.writer.messages == len(added)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_recording_writer import Writer
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


def test_each_chunk_is_sent_to_the_disk_when_it_is_finished(make, monkeypatch):
    """Else a sync, or the end of a file in a stream, waits for seconds of data."""
    sent = []
    monkeypatch.setattr(
        os, "posix_fadvise", lambda file, start, length, advice: sent.append((start, length))
    )
    recording = make("session.mcap", chunk_size=4000)
    recording.add_hits(1, 2, 3, 4, 5)
    assert len(sent) == 2
    assert sum(length for _, length in sent) == recording.writer.size
    assert [start for start, _ in sent] == [0, sent[0][1]]


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
