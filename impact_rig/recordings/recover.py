"""Makes a good recording of one that was cut off, never closed or damaged."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.recordings.bag import (
    SUFFIX,
    FileSummary,
    find_bag_files,
    format_bag_metadata,
    summarize_topic,
    write_bag_metadata,
)
from impact_rig.recordings.contents import (
    RECOVERY_RECORD,
    Contents,
    FileContents,
    inspect_recording,
)
from impact_rig.recordings.hits import HitState
from impact_rig.recordings.new_file import PART_SUFFIX, write_new_file
from impact_rig.recordings.records import Attachment, Channel, RawMessage
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.writer import COMPRESSIONS, McapWriter

PASSES = 3
"""How often the bytes of a recording are looked at [-]."""
RECOVERED = ".recovered"
"""What is added to the name of a recording that was recovered."""
LIBRARY = f"impact_rig-recover {__version__}"
"""What the new files say wrote them: in these, numbers of messages may be left out."""
BAG_RECORD = "rosbag2"
"""Metadata record of rosbag2 with the counts of the file: it is made anew."""
UNNAMED = "attachment"
"""Name of a file that has none that could be used."""


@dataclass(frozen=True)
class Recovery:
    """What became of a recording.

    Attributes
    ----------
    contents : Contents
        What was found in it.
    output : Path, optional
        The good recording; None: nothing was wrong with it.
    written : int
        Messages in the good recording [-].
    """

    contents: Contents
    output: Path | None = None
    written: int = 0

    @property
    def is_complete(self) -> bool:
        """Whether everything that is known to have been written is in the good recording."""
        contents = self.contents
        has_gaps = any(damage.has_data for file in contents.files for damage in file.damages)
        return not (has_gaps or contents.lost or contents.missing_files)


def name_output(path: Path) -> Path:
    """Return where a recovered recording goes: beside the damaged one."""
    if path.is_dir():
        return path.absolute().with_name(path.absolute().name + RECOVERED)
    return path.with_name(f"{path.stem}{RECOVERED}{SUFFIX}")


def recover_recording(
    path: Path, output: Path, *, report: Callable[[int], None] = lambda _: None
) -> Recovery:
    """Write everything that is sound in a recording to a new one, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are; what no checksum vouches for is left out. The original
    is only read.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it.
    output : Path
        Of the new file, or folder.
    report : callable, optional
        Told how many bytes were looked at, now and then; in the end three times those of the
        recording: to see what is there, to write it, and to hold the result against it.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_recording(path, report=report)
    if contents.is_sound:
        return Recovery(contents)
    kept = contents.messages
    if kept == 0:
        raise FileError(f"nothing of {path} can be recovered: {'; '.join(contents.problems)}")
    size = sum(file.size for file in contents.files)
    fields = _describe(contents)

    def write(part: Path, name: str, source: FileContents) -> None:
        _write_file(part, name, source, fields, lambda place: report(size + place))

    if not path.is_dir():
        with write_new_file(output) as part:
            write(part, output.name, contents.files[0])
            _verify(part, output, kept)
    else:
        useful = [file for file in contents.files if file.messages]
        with _write_new_folder(output) as part:
            for number, file in enumerate(useful):
                name = f"{output.name}_{number}{SUFFIX}"
                write(part / name, name, file)
            _write_list(part, _verify(part, output, kept))
    report(PASSES * size)
    return Recovery(contents, output, kept)


def _verify(part: Path, output: Path, kept: int) -> Contents:
    """Read the new recording back before it gets its name."""
    found = inspect_recording(part)
    if not found.is_sound or found.messages != kept:
        reason = "; ".join(found.problems) or f"{found.messages} of {kept} messages are in it"
        raise FileError(f"{output} was not written: reading it back showed that {reason}")
    return found


def _describe(contents: Contents) -> dict[str, str]:
    """Return what the new recording says of the old one."""
    return {
        "recovered_from": contents.path.name,
        "problems": json.dumps(contents.problems, ensure_ascii=False),
        "unread_bytes": str(sum(file.unread for file in contents.files)),
        "messages_lost": str(contents.lost),
        **{
            f"hits_{state.value}": str(contents.count_hits(state))
            for state in (HitState.SAVED, HitState.DAMAGED, HitState.LOST)
        },
    }


def _write_file(
    path: Path,
    name: str,
    source: FileContents,
    fields: dict[str, str],
    report: Callable[[int], None],
) -> None:
    """Write everything that is sound in a file to a new one, which will get a name."""
    compression = next((name for name in source.compression if name in COMPRESSIONS), "zstd")
    channels: dict[int, tuple[Channel, int]] = {}
    scan = Scan(source.path, is_strict=False, report=report)
    with McapWriter(path, compression=compression, library=LIBRARY) as writer:

        def announce(channel: Channel) -> int:
            if channel.id not in channels:
                channels[channel.id] = channel, writer.announce(channel)
            return channels[channel.id][1]

        for item in scan.read():
            if isinstance(item, RawMessage):
                number, times = announce(item.channel), (item.log_time, item.publish_time)
                writer.add_message(number, item.data, *times, item.sequence)
            elif isinstance(item, Attachment):
                writer.add_attachment(item.name, item.media_type, item.data, item.log_time)
            elif item.name != BAG_RECORD:
                writer.add_metadata(item.name, item.fields)
        for channel in scan.channels.values():
            announce(channel)
        writer.flush()
        writer.add_metadata(RECOVERY_RECORD, {**fields, "library": source.library})
        topics = [
            summarize_topic(
                channel.topic, channel.type_name, channel.metadata, writer.count_of(number)
            )
            for channel, number in channels.values()
        ]
        file = FileSummary(name, writer.messages, writer.start_time, writer.end_time)
        text = format_bag_metadata([file], topics)
        writer.add_metadata(BAG_RECORD, {"serialized_metadata": text})


def _write_list(folder: Path, contents: Contents) -> None:
    write_bag_metadata(
        folder,
        [
            FileSummary(file.path.name, file.messages, file.start_time, file.end_time)
            for file in contents.files
        ],
        [
            summarize_topic(topic.name, topic.type_name, topic.metadata, topic.messages)
            for topic in contents.topics
        ],
    )


@contextmanager
def _write_new_folder(path: Path) -> Iterator[Path]:
    """Lend a folder to write to; it gets its name at the end of the block, or is removed."""
    part = path.with_name(f".{path.name}.{os.getpid()}{PART_SUFFIX}")
    if path.exists():
        raise FileError(f"{path} exists already: name another folder, none is overwritten")
    try:
        part.mkdir(parents=True)
        yield part
        if path.exists():
            raise FileError(f"{path} exists already: name another folder, none is overwritten")
        part.rename(path)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def extract_attachments(path: Path, folder: Path) -> tuple[Path, ...]:
    """Write every attachment of a recording to a folder, under the last part of its name.

    A name tells nobody where to write: folders in it are left out. The same file in several
    parts of a recording is written once; others of the same name are numbered.

    Parameters
    ----------
    path : Path
        Of the recording: a file, or a folder as rosbag2 writes it.
    folder : Path
        Where to; it is made.

    Returns
    -------
    tuple of Path
        What was written.

    Raises
    ------
    FileError
        If a file of that name exists already or cannot be written, or the recording not be read.
    """
    contents: dict[tuple[str, bytes], Path] = {}
    for file in find_bag_files(path)[0] if path.is_dir() else (path,):
        for found in Scan(file, is_strict=False, kinds=frozenset({Attachment})).read():
            if not isinstance(found, Attachment):
                continue
            name = _make_safe(found.name)
            if (name, found.data) not in contents:
                taken = {item.name for item in contents.values()}
                target = folder / _number(name, taken)
                _write(target, found.data)
                contents[name, found.data] = target
    return tuple(contents.values())


def _write(path: Path, data: bytes) -> None:
    try:
        with write_new_file(path) as part:
            part.write_bytes(data)
    except ValueError as error:
        raise FileError(f"{path} cannot be written: {error}") from None


def _make_safe(name: str) -> str:
    last = name.replace("\\", "/").rpartition("/")[2]
    safe = "".join(letter if letter.isprintable() else "_" for letter in last).strip()
    return safe.lstrip(".") or UNNAMED


def _number(name: str, taken: set[str]) -> str:
    stem, suffix, number = Path(name).stem, Path(name).suffix, 1
    while name in taken:
        number += 1
        name = f"{stem}.{number}{suffix}"
    return name
