"""What rosbag2 keeps beside the files of a recording, and in each of them: `metadata.yaml`."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.qos_profiles import OfferedQos, format_offered_qos
from impact_rig.recording.writing.disk_file import sync_folder

METADATA_NAME = "metadata.yaml"
"""Name of the file in the folder."""
ROOT_KEY = "rosbag2_bagfile_information"
"""What everything in that file stands under."""
VERSION = 9
"""Of the format; what rosbag2 of ROS 2 Jazzy writes."""
ROS_DISTRO = "jazzy"
"""Whose formats these are."""
NO_TIME = 2**63 - 1
"""Where a recording without messages begins, as rosbag2 writes it [ns]."""


@dataclass(frozen=True)
class FileSummary:
    """One file of a recording.

    Attributes
    ----------
    name : str
        Without its folder.
    messages : int
        How many are in it.
    start_time, end_time : int
        Earliest and latest time of reception [ns]; of no meaning without messages.
    """

    name: str
    messages: int
    start_time: int
    end_time: int

    @property
    def times(self) -> dict[str, dict[str, int]]:
        """Start and duration as rosbag2 writes them."""
        start, duration = (
            (self.start_time, self.end_time - self.start_time) if self.messages else (NO_TIME, 0)
        )
        return {
            "duration": {"nanoseconds": duration},
            "starting_time": {"nanoseconds_since_epoch": start},
        }


@dataclass(frozen=True)
class TopicSummary:
    """One topic of a recording.

    Attributes
    ----------
    name : str
        In full.
    type_name, type_hash : str
        Of its messages.
    offers : tuple of OfferedQos
        What its publishers offered.
    messages : int
        How many are in the files.
    """

    name: str
    type_name: str
    type_hash: str
    offers: tuple[OfferedQos, ...]
    messages: int


def format_bag_metadata(files: Sequence[FileSummary], topics: Sequence[TopicSummary]) -> str:
    """Return the description of a recording as rosbag2 keeps it in an MCAP file of its own."""
    return _dump(_describe(files, topics))


def write_bag_metadata(
    folder: Path, files: Sequence[FileSummary], topics: Sequence[TopicSummary]
) -> None:
    """Write `metadata.yaml`, or replace it as a whole.

    Parameters
    ----------
    folder : Path
        Of the recording.
    files : sequence of FileSummary
        In the order of recording.
    topics : sequence of TopicSummary
        Of all files together.

    Raises
    ------
    FileError
        If it cannot be written: the one before is kept.
    """
    path = folder / METADATA_NAME
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(_dump({ROOT_KEY: _describe(files, topics)}))
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise FileError(f"{path} cannot be written: {error.strerror}") from None
    sync_folder(folder)


def _dump(item: dict[str, Any]) -> str:
    return str(yaml.safe_dump(item, sort_keys=False, allow_unicode=True))


def _describe(files: Sequence[FileSummary], topics: Sequence[TopicSummary]) -> dict[str, Any]:
    filled = [file for file in files if file.messages]
    whole = FileSummary(
        name="",
        messages=sum(file.messages for file in files),
        start_time=min((file.start_time for file in filled), default=0),
        end_time=max((file.end_time for file in filled), default=0),
    )
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **whole.times,
        "message_count": whole.messages,
        "topics_with_message_count": [_describe_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {"path": file.name, **file.times, "message_count": file.messages} for file in files
        ],
        "custom_data": None,
        "ros_distro": ROS_DISTRO,
    }


def _describe_topic(topic: TopicSummary) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": yaml.safe_load(format_offered_qos(topic.offers)) or [],
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.messages,
    }
