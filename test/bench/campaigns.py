"""Recordings to measure with: campaigns that are run once, and what is made of them."""

import itertools
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from impact_rig.core.errors import RigError
from impact_rig.recordings.bag import SUFFIX
from impact_rig.recordings.source import RUN_NAME

GIGA = 1e9


def check_room(folder: Path, needed: float, what: str, remedy: str) -> None:
    """Require free disk space [byte] in a folder.

    Raises
    ------
    RigError
        If there is less.
    """
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise RigError(
            f"{what} may take {needed / GIGA:.1f} GB, and {folder} has {free / GIGA:.1f} GB:"
            f" set TMPDIR to another disk, or {remedy}"
        )


COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}
"""Those of MCAP, by the names that the recorder has for them."""
VERDICT_TOPIC = "/impact"
CHUNK_SIZE = 1 << 20
"""Of the recordings that are compared [byte], our choice: the default of MCAP's own writer."""


@dataclass(frozen=True)
class Campaign:
    """A campaign of the virtual rig, run as a user runs it.

    Attributes
    ----------
    recording : Path
        With all that the rig's recorder writes.
    seconds : float
        From the command to its end, the printed tables [s].
    """

    recording: Path
    seconds: float


class Campaigns:
    """Campaigns that are run when a part needs them, and kept for all parts.

    Parameters
    ----------
    folder : Path
        Where to; it need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._campaigns: list[Campaign] = []
        self._runs = itertools.count()

    def take(
        self, count: int, report: Callable[[int, int], None] = lambda *_: None
    ) -> tuple[Campaign, ...]:
        """Return the first `count` campaigns; run those that there are not yet.

        Raises
        ------
        RigError
            If a campaign fails, for example for want of ROS 2.
        """
        while (done := len(self._campaigns)) < count:
            report(done, count)
            self._campaigns.append(run_campaign(self._folder / str(next(self._runs)), ()))
        return tuple(self._campaigns[:count])


def run_campaign(folder: Path, options: Sequence[str]) -> Campaign:
    """Run `impact-rig demo`.

    Parameters
    ----------
    folder : Path
        Of the run; it must not exist.
    options : sequence of str
        Of the command; none: the paper's whole campaign.

    Raises
    ------
    RigError
        If the campaign fails, for example for want of ROS 2.
    """
    # In a ROS domain of its own, whatever the environment says: a bench strikes nobody's samples.
    environment = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    started = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-m", "impact_rig.cli.main", "demo", "--output", str(folder), *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            _, errors = process.communicate()
        except (KeyboardInterrupt, SystemExit):
            # It ends its nodes first: nobody writes into the folder any more.
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise
    seconds = time.perf_counter() - started
    if process.returncode:
        reason = errors.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        raise RigError(f"no campaign to measure with could be run: {reason[0]}")
    return Campaign(folder / f"{RUN_NAME}{SUFFIX}", seconds)


def compress_anew(
    source: Path, target: Path, compression: str, verdicts: float = math.inf
) -> Path:
    """Write what a recording holds into another file with another compression, by `mcap` alone.

    Parameters
    ----------
    source, target : Path
        The recording and the other file.
    compression : str
        Of `COMPRESSIONS`.
    verdicts : float
        On how many hits the other file ends; the recording may have fewer.
    """
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
            verdicts -= channel.topic == VERDICT_TOPIC
            if verdicts <= 0:
                break
        for note in reader.iter_metadata():
            writer.add_metadata(note.name, note.metadata)
        for file in reader.iter_attachments():
            writer.add_attachment(
                file.create_time, file.log_time, file.name, file.media_type, file.data
            )
        writer.finish()
    return target
