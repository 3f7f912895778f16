"""Recordings to measure with: campaigns of the virtual rig, with all that a recorder writes."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from impact_rig.core.errors import RigError
from impact_rig.recording.reading.source import RUN_NAME, SUFFIX

COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}
"""Those of MCAP, by the names that the recorder has for them."""
CHUNK_SIZE = 1 << 20
"""Of the recordings that are compared [byte], our choice: the default of MCAP's own writer."""


def record_campaign(folder: Path, samples: Sequence[str], impacts: int) -> Path:
    """Run `impact-rig demo` and return its recording.

    Parameters
    ----------
    folder : Path
        Of the run; it must not exist.
    samples : sequence of str
        Of the paper's; empty: all of them.
    impacts : int
        For each.

    Raises
    ------
    RigError
        If the campaign fails, for example for want of ROS 2.
    """
    words = ["demo", "--output", str(folder), "--impacts", str(impacts)]
    for sample in samples:
        words += ["--samples", sample]
    # In a ROS domain of its own, whatever the environment says: a bench strikes nobody's samples.
    environment = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    with subprocess.Popen(
        [sys.executable, "-m", "impact_rig.cli.main", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            _, errors = process.communicate()
        except KeyboardInterrupt:
            # It ends its nodes first: nobody writes into the folder any more.
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise
    if process.returncode:
        reason = errors.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        raise RigError(f"no recording to measure with could be made: {reason[0]}")
    return folder / f"{RUN_NAME}{SUFFIX}"


def compress_anew(source: Path, target: Path, compression: str) -> Path:
    """Write what a recording holds into another file with another compression, by `mcap` alone."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new, chunk_size=CHUNK_SIZE, compression=COMPRESSIONS[compression])
        writer.start("ros2", "impact_rig bench")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        reader = make_reader(old)
        for schema, channel, message in reader.iter_messages():
            if schema is not None and schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(
                    schema.name, schema.encoding, schema.data
                )
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic,
                    channel.message_encoding,
                    schemas[channel.schema_id],
                    dict(channel.metadata),
                )
            writer.add_message(
                channels[channel.id],
                message.log_time,
                message.data,
                message.publish_time,
                message.sequence,
            )
        for note in reader.iter_metadata():
            writer.add_metadata(note.name, note.metadata)
        for file in reader.iter_attachments():
            writer.add_attachment(
                file.create_time, file.log_time, file.name, file.media_type, file.data
            )
        writer.finish()
    return target
