"""Finds the recording that a person names, and reads it: one file, or a folder of them."""

from collections.abc import Callable, Iterator
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recordings.bag import (
    SUFFIX,
    find_bag_files,
    is_bag_folder,
    is_other_form,
    refuse_other_forms,
)
from impact_rig.recordings.qos import parse_offered_qos
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import MAGIC, Scan, Wanted

RUN_NAME = "session"
"""What a run's folder calls its recording: a file of this name and `.mcap`, or a folder."""


class RecordingSource:
    """The file of a recording, or the files of a folder as one recording.

    What the recorder repeats at the beginning of each file, so that it can be read alone, comes
    only once here.

    Parameters
    ----------
    path : Path
        Of the file, or of the folder as rosbag2 writes it.

    Attributes
    ----------
    path : Path
        As given.
    files : tuple of Path
        In their order.
    size : int
        Of all files together [byte].
    warnings : tuple of str
        What the reader should know, in words; empty: nothing.

    Raises
    ------
    FileError
        If there is no such file, or one is no recording of ROS 2. So does every method, with one
        sentence, if a file is damaged other than cut off at its end, or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        files, missing = find_bag_files(path) if path.is_dir() else ((path,), ())
        warnings = [f"{path / name} is missing: what it held is lost" for name in missing]
        unclosed: list[str] = []
        scans: list[Scan] = []
        for file in files:
            try:
                scan = Scan(file, kinds=frozenset())
                scan.check_start()
            except FileError as error:
                # The last of several may have been cut off before it held anything.
                if file != files[-1] or not scans:
                    raise
                warnings.append(str(error))
                continue
            scans.append(scan)
            if not scan.is_closed:
                unclosed.append(
                    f"{file} was never closed: it is read up to the last message that is whole"
                )
        self.files = tuple(scan.path for scan in scans)
        self._scans = scans
        self._sizes = [scan.size for scan in scans]
        self.size = sum(self._sizes)
        self.warnings = (*warnings, *unclosed)
        self._channels: dict[tuple[str, str, str], Channel] = {}

    def read_channels(self) -> tuple[Channel, ...]:
        """Return all topics; one with the same schema has the same number in all files."""
        found = (
            channel
            for scan in self._scans
            for channel in Scan(scan.path, before=scan).read_channels()
        )
        return tuple({channel.id: channel for channel in map(self._unify, found)}.values())

    def read_messages(
        self,
        wanted: Wanted = lambda _: True,
        *,
        start_time: int | None = None,
        end_time: int | None = None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages in file order, one chunk in memory at a time.

        The checksum of each chunk that is read is checked. A chunk is not read where the index
        of its file, if its checksum vouches for it, tells that nothing wanted is in it. A topic's
        first message in a file is left out where it is the last one of the files before: it was
        repeated there.

        Parameters
        ----------
        wanted : callable
            Tells whether a channel's messages are to be yielded.
        start_time, end_time : int, optional
            Only messages logged from the one to before the other, nanoseconds since the epoch.
        report : callable, optional
            Is told now and then how far the recording was read [byte].

        Raises
        ------
        FileError
            Also if a wanted channel is not in `cdr`.
        """
        last: dict[int, RawMessage] = {}
        if start_time is not None and len(self.files) > 1:
            # What is repeated later on may have been told before.
            for _ in self._join(lambda it: _is_state(it) and wanted(it), last, None, start_time):
                pass
        yield from self._join(wanted, last, start_time, end_time, report)

    def read_time_range(self) -> tuple[int, int]:
        """Return the log times of the first and last message, nanoseconds since the epoch.

        They stand in the index of a file that was closed; else all of it is read.

        Raises
        ------
        FileError
            Also if it holds no message.
        """
        times: list[int] = []
        for scan in self._scans:
            statistics = scan.summary.statistics if scan.summary is not None else None
            if statistics is None:
                times += [message.log_time for message in Scan(scan.path).read_messages()]
            elif statistics.message_count:
                times += [statistics.message_start_time, statistics.message_end_time]
        if not times:
            raise FileError(f"{self.path} holds no message")
        return min(times), max(times)

    def _join(
        self,
        wanted: Wanted,
        last: dict[int, RawMessage],
        start_time: int | None,
        end_time: int | None,
        report: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the messages of the files; keep the last one of each channel in `last`."""
        is_alone = len(self.files) == 1
        for place, known in enumerate(self._scans):
            unified: dict[int, Channel] = {}
            before = sum(self._sizes[:place])

            def report_part(done: int, before: int = before) -> None:
                if report is not None:
                    report(before + done)

            def is_wanted(channel: Channel, unified: dict[int, Channel] = unified) -> bool:
                unified[channel.id] = channel if is_alone else self._unify(channel)
                return wanted(unified[channel.id])

            scan = Scan(
                known.path,
                before=known,
                wanted=is_wanted,
                start_time=start_time,
                end_time=end_time,
                report=report_part,
            )
            if is_alone:
                yield from scan.read_messages()
                return
            met: set[int] = set()
            for message in scan.read_messages():
                raw = message._replace(channel=unified[message.channel.id])
                number = raw.channel.id
                is_repeated = number not in met and _is_same(last.get(number), raw)
                met.add(number)
                last[number] = raw
                if not is_repeated:
                    yield raw

    def _unify(self, channel: Channel) -> Channel:
        """Return the first channel of this topic and schema, under its number in the folder."""
        if len(self.files) == 1:
            return channel
        key = (channel.topic, channel.type_name, channel.schema)
        numbered = channel._replace(id=len(self._channels) + 1)
        return self._channels.setdefault(key, numbered)


def find_recording(path: Path) -> Path:
    """Return the recording that a path means.

    Parameters
    ----------
    path : Path
        An `.mcap` file, a folder as rosbag2 writes it, a run's folder with `session.mcap` or a
        folder `session` in it, or any folder with one `.mcap` file.

    Returns
    -------
    Path
        The file, or the folder as rosbag2 writes it.

    Raises
    ------
    FileError
        If there is nothing of that name, it is a folder without a recording, or with several, or
        one that rosbag2 has to convert first.
    """
    try:
        if not path.is_dir():
            if not path.exists():
                raise FileError(f"there is no file {path}")
            refuse_other_forms(path)
            return path
        for candidate in (path / f"{RUN_NAME}{SUFFIX}", path, path / RUN_NAME):
            if candidate.is_file() or is_bag_folder(candidate):
                return candidate
        files = sorted(path.glob(f"*{SUFFIX}"))
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None
    if len(files) == 1:
        return files[0]
    if files:
        raise FileError(f"{path} is a folder with {len(files)} recordings: name one of them")
    raise FileError(f"{path} is a folder without a recording: there is no {SUFFIX} file in it")


def is_recording(path: Path) -> bool:
    """Return whether a path means a recording, and not a file of traces.

    A name that ends with `.mcap` does, whatever is in the file: opening it tells what is wrong.
    """
    if path.suffix == SUFFIX or is_other_form(path):
        return True
    try:
        if path.is_dir():
            find_recording(path)
            return True
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except (FileError, OSError):
        return False


def open_source(path: Path) -> RecordingSource:
    """Open the recording that a path means; raises as `find_recording` and `RecordingSource`."""
    return RecordingSource(find_recording(path))


def _is_state(channel: Channel) -> bool:
    offers = parse_offered_qos(channel.metadata.get("offered_qos_profiles", ""))
    return any(offer.durability == "transient_local" for offer in offers)


def _is_same(last: RawMessage | None, raw: RawMessage) -> bool:
    """Tell whether a message is the one before; only the time of its recording may differ."""
    return last is not None and last._replace(log_time=raw.log_time) == raw
