"""A sound copy of a run."""

import json
from functools import partial
from pathlib import Path
from typing import Any

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.contents import Contents, choose_topics, inspect_run
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.records import RECOVERY_RECORD, Attachment, Channel, RawMessage
from impact_rig.recordings.run import Run, report_from
from impact_rig.recordings.scan import Report
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.version import __version__

LIBRARY = f"impact_rig-recover {__version__}"
"""Writer in the new file: its messages may not be numbered without gaps."""


def recover_run(run: Run, output: Path, *, report: Report = lambda _: None) -> Contents:
    """Write everything that is sound in a run to one new recording, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are; what no checksum vouches for is left out.

    Parameters
    ----------
    run : Run
        Its files are only read. Where a rig was chosen, it alone is copied.
    output : Path
        Of the new file.
    report : callable, optional
        Called now and then with how much was read [byte]; the files are read twice.

    Returns
    -------
    Contents
        What was found in the run; its problems are what is left out.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_run(run, report=report)
    if not contents.messages:
        raise FileError(f"nothing of {run.path} can be recovered: {'; '.join(contents.problems)}")
    with write_new_file(output) as part, RecordingWriter(part, library=LIBRARY) as writer:
        _copy(contents, writer, report)
        if not contents.is_sound:
            problems = json.dumps(contents.problems, ensure_ascii=False)
            fields = {"recovered_from": run.path.name, "problems": problems}
            writer.add_metadata(RECOVERY_RECORD, fields)
    return contents


def _copy(contents: Contents, writer: RecordingWriter, report: Report) -> None:
    wanted, before = choose_topics(contents), contents.size
    numbers: dict[Any, int] = {}

    def announce(channel: Channel) -> int:
        """Return the number of a topic, which all files share that describe it alike."""
        described = (*channel[1:4], *sorted(channel.metadata.items()), channel.encoding)
        if described not in numbers:
            numbers[described] = writer.announce(channel)
        return numbers[described]

    for scan in contents.scans:
        reading = scan.read(wanted, partial(report_from, report, before))
        for item in reading:
            if isinstance(item, RawMessage):
                times = (item.log_time, item.publish_time)
                writer.add_message(announce(item.channel), item.data, *times, item.sequence)
            elif isinstance(item, Attachment):
                writer.add_attachment(item.name, item.media_type, item.data, item.log_time)
            elif item.name != "rosbag2":  # has the counts of the file, which may no longer be true
                writer.add_metadata(item.name, item.fields)
        for channel in filter(wanted, reading.channels.values()):
            announce(channel)
        before += scan.size
