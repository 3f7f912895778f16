"""Takes the sound part of a recording into a new one, and its attachments into a folder."""

import json
from pathlib import Path

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents, inspect_recording
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.records import Attachment, Channel, RawMessage
from impact_rig.recordings.scan import Report, Scan
from impact_rig.recordings.writer import RecordingWriter

UNNAMED = "attachment"
"""Name of a file that has none that could be used."""
DESCRIPTION_RECORD = "rosbag2"
"""Metadata record of rosbag2 with the counts of the file, which may no longer be true."""
LIBRARY = f"impact_rig-recover {__version__}"
"""What the new file says wrote it: its messages may not be numbered without gaps."""


def recover_recording(path: Path, output: Path, *, report: Report = lambda _: None) -> Contents:
    """Write everything that is sound in a recording to a new one, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are; what no checksum vouches for is left out.

    Parameters
    ----------
    path : Path
        Of the recording; it is only read.
    output : Path
        Of the new file.
    report : callable, optional
        Called now and then with how much of the recording was read [byte]; it is read twice.

    Returns
    -------
    Contents
        What was found in the recording; its problems are what is left out.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_recording(path, report=report)
    if not contents.messages:
        raise FileError(f"nothing of {path} can be recovered: {'; '.join(contents.problems)}")
    scan = contents.scan
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        _copy(scan, writer, lambda place: report(scan.size + place))
        if not contents.is_sound:
            problems = json.dumps(contents.problems, ensure_ascii=False)
            fields = {"recovered_from": path.name, "problems": problems}
            writer.add_metadata(RECOVERY_RECORD, fields)
    return contents


def _copy(scan: Scan, writer: RecordingWriter, report: Report) -> None:
    numbers: dict[int, int] = {}

    def announce(channel: Channel) -> int:
        if channel.id not in numbers:
            numbers[channel.id] = writer.announce(channel)
        return numbers[channel.id]

    for item in scan.read(report=report):
        if isinstance(item, RawMessage):
            times = (item.log_time, item.publish_time)
            writer.add_message(announce(item.channel), item.data, *times, item.sequence)
        elif isinstance(item, Attachment):
            writer.add_attachment(item.name, item.media_type, item.data, item.log_time)
        elif item.name != DESCRIPTION_RECORD:
            writer.add_metadata(item.name, item.fields)
    for channel in scan.channels.values():
        announce(channel)


def extract_attachments(path: Path, folder: Path) -> tuple[Path, ...]:
    """Write every attachment of a recording to a folder, under the last part of its name.

    Folders in a name are left out. The same file is written once; others of the same name are
    numbered.

    Parameters
    ----------
    path : Path
        Of the recording.
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
    for found in Scan(path, is_strict=False).read(kinds=frozenset({Attachment})):
        if not isinstance(found, Attachment):
            continue
        name = _make_safe(found.name)
        if (name, found.data) not in contents:
            taken = {item.name for item in contents.values()}
            target = folder / _number(name, taken)
            with write_new_file(target) as part:
                part.write_bytes(found.data)
            contents[name, found.data] = target
    return tuple(contents.values())


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
