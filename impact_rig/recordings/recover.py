"""Makes a sound recording of one that was cut off, never closed or damaged."""

import json
from pathlib import Path

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents, inspect_recording
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.records import Attachment, Channel, RawMessage
from impact_rig.recordings.scan import Report, Scan
from impact_rig.recordings.writer import RecordingWriter

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
    size = contents.size
    scan = Scan(path, is_strict=False)
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        _copy(scan, writer, lambda place: report(size + place))
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
