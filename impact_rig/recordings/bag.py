"""A folder as rosbag2 writes it: its files in their order, and `metadata.yaml` beside them."""

import json
import os
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from impact_rig.core.errors import FileError
from impact_rig.recordings.new_file import sync_folder
from impact_rig.recordings.qos import (
    OfferedQos,
    describe_offered_qos,
    dump_yaml,
    parse_offered_qos,
)

SUFFIX = ".mcap"
"""What a recording's name ends with."""
METADATA_NAME = "metadata.yaml"
"""The file that lists the others."""
METADATA_LIMIT = 16 << 20
"""What is read of it at most [byte], our choice: enough for 50 000 files."""

ROOT_KEY = "rosbag2_bagfile_information"
"""What everything in that file stands under."""
VERSION = 9
"""Of the format; what rosbag2 of ROS 2 Jazzy writes."""
ROS_DISTRO = "jazzy"
"""Whose formats these are."""
NO_TIME = 2**63 - 1
"""Where a recording without messages begins, as rosbag2 writes it [ns]."""

_NUMBERED = re.compile(r"(?P<name>.+)_(?P<number>\d{1,9})\.mcap")
_LIST = re.compile(r"^[ ]*relative_file_paths:[ ]*\n(?P<items>(?:[ ]*-[ ].*\n?)+)", re.MULTILINE)
_ITEM = re.compile(r"^[ ]*-[ ]+(.*\S)", re.MULTILINE)
_MODE = re.compile(
    r"^[ ]*compression_mode:[ ]*['\"]?(?P<mode>file|message)\b", re.IGNORECASE | re.MULTILINE
)
_OTHER_FORMS = {".db3": "in SQLite (.db3)", ".zstd": "compressed as a whole (.zstd)"}
"""What rosbag2 writes beside MCAP, by the ends of the names."""


def is_bag_folder(path: Path) -> bool:
    """Return whether a path is a folder with a list of files, or with files numbered from 0."""
    return path.is_dir() and (
        (path / METADATA_NAME).is_file()
        or bool(_list_numbered(path))
        or any(map(is_other_form, path.iterdir()))
    )


def find_bag_files(folder: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Return the files of a recording in their order, and which are missing, in words.

    The list in `metadata.yaml` tells them, and after it the numbers in the names: a recorder
    that was killed has not listed its last files.

    Parameters
    ----------
    folder : Path
        As rosbag2 writes it.

    Raises
    ------
    FileError
        If none of its files is there, they belong to several recordings, or are none of MCAP.
    """
    numbered = _list_numbered(folder)
    refuse_other_forms(folder)
    listed = _read_list(folder)
    if not any((folder / name).is_file() for name in listed):
        listed = []
    stems = {_split_name(name)[0] for name in listed or numbered}
    if not listed and len(stems) > 1:
        raise FileError(
            f"{folder} holds several recordings, {', '.join(sorted(stems))}, and no"
            f" {METADATA_NAME}: name one of their files"
        )
    names = dict.fromkeys([*listed, *(it for it in numbered if _split_name(it)[0] in stems)])
    present = tuple(folder / name for name in names if (folder / name).is_file())
    if not present:
        raise FileError(
            f"{folder} is a folder without a recording: there is no {SUFFIX} file in it"
        )
    return present, tuple(_describe_missing(listed, list(names), {path.name for path in present}))


def refuse_other_forms(path: Path) -> None:
    """Refuse what `ros2 bag convert` has to make readable first, and say how to call it.

    Parameters
    ----------
    path : Path
        A folder as rosbag2 writes it, or one of its files.

    Raises
    ------
    FileError
        If it is in SQLite, or rosbag2 compressed its files or each of its messages.
    """
    is_folder = path.is_dir()
    folder = path if is_folder else path.parent
    mode = _MODE.search(_read_metadata(folder))
    if mode and (is_folder or path.name in _read_list(folder)):
        form = f"compressed by rosbag2 ({METADATA_NAME}: compression_mode {mode['mode'].upper()})"
    else:
        suffixes = {item.suffix for item in folder.iterdir()} if is_folder else {path.suffix}
        form = next((form for end, form in _OTHER_FORMS.items() if end in suffixes), "")
        if not form or (is_folder and SUFFIX in suffixes):
            return
    source = folder if (folder / METADATA_NAME).is_file() else path
    target = {"uri": f"{source.name}.converted", "storage_id": "mcap", "all_topics": True}
    options = shlex.quote(json.dumps({"output_bags": [target]}))
    raise FileError(
        f"{path} is {form}: MCAP is read, plain or with compressed chunks. ROS 2 makes that of"
        f" it: echo {options} > convert.yaml && ros2 bag convert -i {shlex.quote(str(source))}"
        " -o convert.yaml"
    )


def is_other_form(path: Path) -> bool:
    """Return whether a file's name is that of a recording which rosbag2 has to convert."""
    return path.suffix == ".db3" or path.name.endswith(f"{SUFFIX}.zstd")


def _read_metadata(folder: Path) -> str:
    """Return the text of `metadata.yaml`; empty: it is not there."""
    try:
        with (folder / METADATA_NAME).open("rb") as file:
            return file.read(METADATA_LIMIT).decode("utf-8", "replace")
    except OSError:
        return ""


def _read_list(folder: Path) -> list[str]:
    """Return the names in `metadata.yaml`; none where it is not there or makes no sense.

    Only its list of files is looked at, as rosbag2 writes it: a name in each line. A YAML reader
    takes minutes for a file that nests deep.
    """
    match = _LIST.search(_read_metadata(folder))
    items = _ITEM.findall(match["items"]) if match else []
    # The folder stands before the name in the lists of old versions.
    names = [Path(item.strip("\"'")).name for item in items]
    return list(dict.fromkeys(name for name in names if name.endswith(SUFFIX)))


def _list_numbered(folder: Path) -> list[str]:
    """Return the names that are numbered from 0 on, in the order of their numbers."""
    names = [path.name for path in folder.glob(f"*{SUFFIX}") if _NUMBERED.fullmatch(path.name)]
    begun = {_split_name(name)[0] for name in names if _split_name(name)[1] == 0}
    return sorted((name for name in names if _split_name(name)[0] in begun), key=_split_name)


def _split_name(name: str) -> tuple[str, int]:
    match = _NUMBERED.fullmatch(name)
    return (match["name"], int(match["number"])) if match else (name, 0)


def _describe_missing(listed: list[str], names: list[str], present: set[str]) -> Iterator[str]:
    """Yield the names, or from which to which, that are listed or left out in the numbers."""
    groups: dict[str, list[str]] = {}
    for name in names:
        if _NUMBERED.fullmatch(name):
            groups.setdefault(_split_name(name)[0], []).append(name)
        elif name not in present:
            yield name
    is_listed = frozenset(listed)
    for stem, group in groups.items():
        # The oldest files may have been dropped on purpose: then they are not listed.
        first = min((_split_name(name)[1] for name in group if name in is_listed), default=0)
        there = sorted(_split_name(name)[1] for name in group if name in present)
        last = max(_split_name(name)[1] for name in group)
        for before, after in pairwise((first - 1, *there, last + 1)):
            if after - before > 1:
                ends = dict.fromkeys((before + 1, after - 1))
                yield " to ".join(f"{stem}_{number}{SUFFIX}" for number in ends)


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


def summarize_topic(
    name: str, type_name: str, metadata: Mapping[str, str], messages: int
) -> TopicSummary:
    """Return what is said of a topic by the metadata of its channel."""
    offers = parse_offered_qos(metadata.get("offered_qos_profiles", ""))
    return TopicSummary(name, type_name, metadata.get("topic_type_hash", ""), offers, messages)


def format_bag_metadata(files: Sequence[FileSummary], topics: Sequence[TopicSummary]) -> str:
    """Return the description of a recording as rosbag2 keeps it in an MCAP file of its own."""
    return dump_yaml(_describe(files, topics))


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
            file.write(dump_yaml({ROOT_KEY: _describe(files, topics)}))
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise FileError(f"{path} cannot be written: {error.strerror}") from None
    sync_folder(folder)


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
            "offered_qos_profiles": describe_offered_qos(topic.offers),
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.messages,
    }
