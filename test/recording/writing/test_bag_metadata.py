"""`metadata.yaml` holds what rosbag2 writes; rosbags, which writes it too, is the judge."""

import errno
import os
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
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import INFINITE, OfferedQos
from impact_rig.recording.writing.bag_metadata import NO_TIME, FileSummary, write_bag_metadata
from impact_rig.recording.writing.recording_writer import RecordingWriter

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


def test_beside_the_files_stands_what_rosbags_writes(ours, theirs):
    assert read_metadata(ours) == read_metadata(theirs)


def test_in_the_file_stands_what_rosbags_writes(ours, theirs):
    assert read_record(ours / "bag_0.mcap") == read_record(theirs / "bag.mcap")


def test_a_bare_file_describes_itself_too(tmp_path):
    with RecordingWriter(tmp_path / "bag_0.mcap") as writer:
        channel = writer.add_channel("/text", MessageDefinition(TYPE, "string data\n"), ())
        writer.add_message(channel, DATA, 5, 5)
    record = read_record(tmp_path / "bag_0.mcap")
    assert record["message_count"] == 1
    assert record["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"] == []


def test_each_file_has_its_times_and_counts(tmp_path):
    files = [
        FileSummary("bag_0.mcap", 10, 100, 250),
        FileSummary("bag_1.mcap", 5, 250, 400),
        FileSummary("bag_2.mcap", 0, 0, 0),
    ]
    write_bag_metadata(tmp_path, files, [])
    content = yaml.safe_load((tmp_path / "metadata.yaml").read_text())
    information = content["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]
    assert information["starting_time"] == {"nanoseconds_since_epoch": 100}
    assert information["duration"] == {"nanoseconds": 300}
    assert information["message_count"] == 15
    assert [
        (
            item["path"],
            item["starting_time"]["nanoseconds_since_epoch"],
            item["duration"]["nanoseconds"],
            item["message_count"],
        )
        for item in information["files"]
    ] == [
        ("bag_0.mcap", 100, 150, 10),
        ("bag_1.mcap", 250, 150, 5),
        ("bag_2.mcap", NO_TIME, 0, 0),
    ]


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
