"""A folder as rosbag2 writes it is one recording, in order, told once, whatever became of it."""

import errno
import json
import os
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import mcap.reader
import pytest
import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from impact_rig.core.errors import FileError
from impact_rig.recordings.bag import FileSummary, write_bag_metadata
from impact_rig.recordings.contents import inspect_recording
from impact_rig.recordings.qos import INFINITE, OfferedQos
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.source import RecordingSource, find_recording, open_source
from impact_rig.recordings.writer import RecordingWriter

HITS = 11
FILES = [f"made_{number}.mcap" for number in range(HITS + 1)]


@pytest.fixture
def campaign(make_recording, tmp_path, tmp_path_factory) -> Path:
    """Return a recording that was split after each hit; it is made once, and copied."""
    made = tmp_path_factory.getbasetemp() / "campaign"
    if not made.exists():
        maker = make_recording("made", split_size=1)
        maker.writer.add_metadata("impact_rig", {"notes": "cold"})
        maker.writer.add_attachment("rig.toml", "application/toml", b"[rig]")
        maker.add_setup()
        for record in range(1, HITS + 1):
            maker.add_block(record)
            maker.writer.sync()
        maker.add_virtual_impact(HITS + 1)
        maker.close().rename(made)
    path = tmp_path / "session"
    shutil.copytree(made, path)
    assert sorted(path.glob("*.mcap")) == sorted(path / name for name in FILES)
    return path


def list_events(path: Path) -> list[int | str]:
    """Return the names of the set-ups and the record numbers of the blocks."""
    return [
        event.label.record if hasattr(event, "label") else event.name
        for event in read_recording(path).events()
    ]


def test_the_files_are_read_in_the_order_of_their_numbers(campaign):
    source = open_source(campaign)
    assert [path.name for path in source.files] == FILES
    assert source.warnings == ()
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_every_message_is_there_that_rosbags_reads_but_what_is_repeated(campaign):
    with Reader(campaign) as reader:
        expected = [(item.topic, time, data) for item, time, data in reader.messages()]
    found = [(item.channel.topic, item.log_time, item.data) for item in _read(campaign)]
    assert len(expected) == len(found) + HITS  # the set-up, in each file but the first
    assert [item for item in expected if item[0] != "/setup"] == [
        item for item in found if item[0] != "/setup"
    ]
    assert found[0] == expected[0]


def _read(path: Path, **times: int) -> list:
    return list(open_source(path).read_messages(**times))


def test_a_setup_is_told_once_wherever_the_reading_starts(campaign):
    times = [item.log_time for item in _read(campaign)]
    for first in (0, 1, 5):
        found = _read(campaign, start_time=times[first])
        assert [item.log_time for item in found] == times[first:]
    assert [item.log_time for item in _read(campaign, start_time=times[3], end_time=times[6])] == (
        times[3:6]
    )


def test_another_setup_and_the_same_one_sent_again_are_new_campaigns(make_recording):
    maker = make_recording("session", split_size=1)
    for name in ("first", "second", "second"):
        maker.add_setup(name=name)
        maker.add_block(1)
        maker.writer.sync()
    assert list_events(maker.close()) == ["first", 1, "second", 1, "second", 1]


def test_a_topic_has_one_number_in_all_files(make_recording, tmp_path):
    (tmp_path / "session").mkdir()
    first = make_recording("session/session_0.mcap")
    first.add_setup()
    first.add_block(1)
    second = make_recording("session/session_1.mcap")
    second.add_virtual_impact(2)
    second.add_block(2)
    first.close()
    source = open_source(second.close().parent)
    numbers = {channel.topic: channel.id for channel in source.read_channels()}
    assert sorted(numbers) == ["/acceleration", "/setup", "/virtual_impact"]
    assert len(set(numbers.values())) == 3
    assert [item.channel.id for item in source.read_messages()] == [
        numbers[topic] for topic in ("/setup", "/acceleration", "/virtual_impact", "/acceleration")
    ]


def change_list(folder: Path, change: Callable[[dict], None]) -> None:
    path = folder / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(content))


def test_the_list_tells_the_order_whatever_the_names(campaign):
    for old, new in ((0, "z"), (1, "a")):
        (campaign / FILES[old]).rename(campaign / f"{new}.mcap")
    change_list(campaign, lambda info: info.update(relative_file_paths=["z.mcap", "a.mcap"]))
    assert list_events(campaign) == ["bench", 1, 2]


def test_names_in_lists_of_old_versions_and_of_malice_stay_in_the_folder(campaign):
    names = [f"session/{FILES[0]}", f"../../etc/{FILES[1]}", f"/{FILES[2]}"]
    change_list(campaign, lambda info: info.update(relative_file_paths=names))
    assert list_events(campaign)[:4] == ["bench", 1, 2, 3]


def test_files_that_a_killed_recorder_did_not_list_are_read(campaign):
    change_list(campaign, lambda info: info.update(relative_file_paths=FILES[:2]))
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "relative_file_paths: [lost.mcap, gone.mcap]",
        "a: [unclosed",
        "[" * 100_000,
        "a: &a [x, x]\nb: &b [*a, *a]\nrelative_file_paths: *b",
        "\x00",
        "# " + "x" * (17 << 20),
        "relative_file_paths:\n" + "  - x" * 1_000_000,
    ],
    ids=range(8),
)
def test_a_list_that_makes_no_sense_is_not_needed(campaign, text):
    (campaign / "metadata.yaml").write_text(text)
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_missing_files_are_named(campaign):
    for number in (2, 4, 5, 6, HITS):
        (campaign / FILES[number]).unlink()
    source = open_source(campaign)
    assert [text.removeprefix(f"{campaign}/") for text in source.warnings] == [
        "made_2.mcap is missing: what it held is lost",
        "made_4.mcap to made_6.mcap is missing: what it held is lost",
        "made_11.mcap is missing: what it held is lost",
    ]
    assert list_events(campaign) == ["bench", 1, 2, 4, 8, 9, 10, 11]
    assert read_recording(campaign).warnings == source.warnings


def test_old_files_that_were_dropped_on_purpose_are_not_missed(campaign):
    for name in FILES[:3]:
        (campaign / name).unlink()
    change_list(campaign, lambda info: info.update(relative_file_paths=FILES[3:]))
    assert open_source(campaign).warnings == ()
    assert list_events(campaign)[:2] == ["bench", 4]


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x20\0"])
def test_a_last_file_that_was_only_begun_is_left_out_with_a_word(campaign, content):
    (campaign / FILES[-1]).write_bytes(content)
    source = open_source(campaign)
    assert FILES[-1] in source.warnings[0]
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_a_file_in_the_middle_that_is_none_is_an_error(campaign):
    (campaign / FILES[3]).write_bytes(b"")
    with pytest.raises(FileError, match=f"{FILES[3]} is empty"):
        open_source(campaign)


def test_a_killed_recording_is_read_to_the_end_of_its_last_file(campaign):
    (campaign / "metadata.yaml").unlink()
    last = campaign / FILES[-2]
    (campaign / FILES[-1]).unlink()
    last.write_bytes(last.read_bytes()[:-100])
    assert RecordingSource(last).warnings
    source = open_source(campaign)
    assert "never closed" in source.warnings[0]
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def assert_refused(path: Path, form: str, source: Path) -> None:
    for read in (open_source, inspect_found):
        with pytest.raises(FileError) as error:
            read(path)
        assert f"{path} is {form}" in str(error.value)
        words = shlex.split(str(error.value).partition("of it: ")[2])
        (target,) = json.loads(words[1])["output_bags"]
        assert target == {
            "uri": f"{source.name}.converted",
            "storage_id": "mcap",
            "all_topics": True,
        }
        assert words[:1] + words[2:5] == ["echo", ">", "convert.yaml", "&&"]
        assert words[5:] == ["ros2", "bag", "convert", "-i", str(source), "-o", "convert.yaml"]


def inspect_found(path: Path) -> None:
    inspect_recording(find_recording(path))


def test_a_recording_in_sqlite_is_refused_with_the_call_that_converts_it(tmp_path, campaign):
    folder = tmp_path / "old"
    folder.mkdir()
    (folder / "old_0.db3").write_bytes(b"SQLite format 3")
    assert_refused(folder, "in SQLite", folder)
    assert_refused(folder / "old_0.db3", "in SQLite", folder / "old_0.db3")
    shutil.copy(campaign / "metadata.yaml", folder)
    change_list(folder, lambda info: info.update(relative_file_paths=["old_0.db3"]))
    assert_refused(folder, "in SQLite", folder)
    assert_refused(folder / "old_0.db3", "in SQLite", folder)


@pytest.mark.parametrize("mode", ["FILE", "message"])
def test_what_rosbag2_compressed_is_refused_with_the_call_that_converts_it(campaign, mode):
    change_list(campaign, lambda info: info.update(compression_mode=mode))
    if mode.lower() == "file":
        for path in campaign.glob("*.mcap"):
            path.rename(path.with_name(path.name + ".zstd"))
        assert_refused(campaign / f"{FILES[0]}.zstd", "compressed", campaign)
    else:
        assert_refused(campaign / FILES[0], "compressed", campaign)
    assert_refused(
        campaign,
        f"compressed by rosbag2 (metadata.yaml: compression_mode {mode.upper()}",
        campaign,
    )


def test_several_recordings_in_one_folder_must_be_named(campaign):
    shutil.copy(campaign / FILES[0], campaign / "other_0.mcap")
    assert list_events(campaign)[-1] == HITS  # the list tells which one is meant
    (campaign / "metadata.yaml").unlink()
    with pytest.raises(FileError, match="several recordings, made, other, and no metadata"):
        open_source(campaign)


TYPE = "std_msgs/msg/String"
TYPES = get_typestore(Stores.ROS2_JAZZY)
DATA = b"\0\1\0\0\2\0\0\0a\0"
TIMES = (1_700_000_000_000_000_000, 1_700_000_001_500_000_000)
FOREVER = QosTime(*divmod(INFINITE, 1_000_000_000))
THEIR_QOS = Qos(
    QosHistory.KEEP_LAST,
    16,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    FOREVER,
    FOREVER,
    QosLiveliness.AUTOMATIC,
    FOREVER,
    False,
)
OUR_QOS = OfferedQos("reliable", "transient_local", "keep_last", 16)


@pytest.fixture
def theirs(tmp_path) -> Path:
    """Return a recording by rosbags, of two messages."""
    folder = tmp_path / "theirs" / "bag"
    folder.parent.mkdir()
    with RosbagsWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            "/text", TYPE, typestore=TYPES, offered_qos_profiles=[THEIR_QOS]
        )
        for time in TIMES:
            writer.write(connection, time, DATA)
    return folder


@pytest.fixture
def ours(tmp_path) -> Path:
    """Return a recording by us, of the same messages."""
    folder = tmp_path / "ours" / "bag"
    text, _ = TYPES.generate_msgdef(TYPE, ros_version=2)
    definition = MessageDefinition(TYPE, text, TYPES.hash_rihs01(TYPE))
    with RecordingWriter(folder) as writer:
        channel = writer.add_channel("/text", definition, (OUR_QOS,))
        for time in TIMES:
            writer.add_message(channel, DATA, time, time)
    return folder


def normalise(information: dict) -> dict:
    """Leave out what the two name differently: the files and the distribution."""
    assert information.pop("relative_file_paths") in (["bag.mcap"], ["bag_0.mcap"])
    assert information["files"][0].pop("path") in ("bag.mcap", "bag_0.mcap")
    assert information.pop("ros_distro") in ("rosbags", "jazzy")
    return information


def read_metadata(folder: Path) -> dict:
    content = yaml.safe_load((folder / "metadata.yaml").read_text())
    assert list(content) == ["rosbag2_bagfile_information"]
    return normalise(content["rosbag2_bagfile_information"])


def read_record(path: Path) -> dict:
    """Return what stands in the metadata record that rosbag2 looks for in a file."""
    with path.open("rb") as file:
        records = list(mcap.reader.make_reader(file, validate_crcs=True).iter_metadata())
    texts = [item.metadata["serialized_metadata"] for item in records if item.name == "rosbag2"]
    assert len(texts) == 1
    return normalise(yaml.safe_load(texts[0]))


def test_beside_and_in_the_files_stands_what_rosbags_writes(ours, theirs):
    assert read_metadata(ours) == read_metadata(theirs)
    assert read_record(ours / "bag_0.mcap") == read_record(theirs / "bag.mcap")


def test_a_disk_that_fails_leaves_the_description_before(tmp_path, monkeypatch):
    write_bag_metadata(tmp_path, [FileSummary("bag_0.mcap", 1, 5, 5)], [])
    before = (tmp_path / "metadata.yaml").read_text()

    def fail(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(FileError, match=r"metadata\.yaml cannot be written: No space left"):
        write_bag_metadata(tmp_path, [FileSummary("bag_0.mcap", 2, 5, 6)], [])
    assert (tmp_path / "metadata.yaml").read_text() == before
    assert [path.name for path in tmp_path.glob("*metadata*")] == ["metadata.yaml"]
    assert not list(tmp_path.glob(".metadata*"))
