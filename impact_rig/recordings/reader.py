"""Reads the rig's recordings back, without ROS: decoded by the schemas in the file itself."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from impact_rig.core.errors import FileError, RigError
from impact_rig.core.records import Block, HitLabel
from impact_rig.core.setup import RigSetup
from impact_rig.core.stream import StreamCutter
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    NO_ID,
    SETUP_TYPE,
    STREAM_TYPE,
    VIRTUAL_IMPACT_TYPE,
    block_from_msg,
    campaign_id_from_msg,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import Report, Scan
from impact_rig.recordings.schemas import decode_message
from impact_rig.recordings.source import find_recordings

_EVENT_TYPES = (SETUP_TYPE, BLOCK_TYPE, STREAM_TYPE, VIRTUAL_IMPACT_TYPE)

_T = TypeVar("_T")


class Recording:
    """The recording of one rig, in one file or in those of a run that was resumed.

    Each iteration reads the file again; nothing is held in memory. Made by `read_recording`.
    """

    hammer_unit: str | None = None  # the set-up says in what the hammer's channel is
    has_scale = True  # its numbers make accelerations

    def __init__(self, path: Path, files: Sequence[Scan], namespace: str) -> None:
        self._files = files
        # Injected by the virtual rig, as far as `events` was read; empty: a good hit.
        self.faults: dict[HitLabel, tuple[str, ...]] = {}
        self.path = path  # as a person named it
        self.namespace = namespace  # of the rig, "/" for none
        self.size = sum(file.size for file in files)  # [byte]
        self.warnings = tuple(warning for file in files for warning in file.warnings)
        self._campaign, self.setup = self._read_setup()  # the first set-up

    def events(self, report: Report = lambda _: None) -> Iterator[RigSetup | Block]:
        """Yield set-ups and blocks in file order, the first set-up before everything else.

        Impacts in a running stream are found now, if they were not found while it was recorded.

        Parameters
        ----------
        report : callable, optional
            Gets now and then how much was read [byte].

        Yields
        ------
        RigSetup or Block
            A set-up begins a campaign and holds for the blocks after it.

        Raises
        ------
        FileError
            If a file is damaged, or a message does not have the fields of this version.
        """
        setup, campaign = self.setup, self._campaign
        yield setup
        is_first, before = True, 0
        for file in self._files:
            cutter = None if holds_blocks(file) else StreamCutter(setup.analysis)
            wanted = partial(self._is_wanted, with_stream=cutter is not None)
            for raw in file.read_messages(wanted, partial(_report_from, report, before)):
                if raw.channel.type_name == VIRTUAL_IMPACT_TYPE:
                    label, faults = self.convert(raw, _faults_from_msg)
                    self.faults[label] = faults
                elif raw.channel.type_name == BLOCK_TYPE:
                    yield self.convert(raw, block_from_msg)
                elif cutter is not None and is_stream(raw.channel):
                    yield from cutter.feed(self.convert(raw, block_from_msg))
                elif is_first:
                    is_first = False
                else:
                    found, begun = self.convert(raw, _campaign_from_msg)
                    # A run that was resumed says again which campaign it is.
                    if begun is None or found == campaign != NO_ID:
                        continue
                    setup, campaign = begun, found
                    if cutter is not None:
                        cutter = StreamCutter(setup.analysis)
                    yield setup
            before += file.size

    def _is_wanted(self, channel: Channel, *, with_stream: bool) -> bool:
        return self._is_event(channel) and (with_stream or not is_stream(channel))

    def _is_event(self, channel: Channel) -> bool:
        prefix = self.namespace.rstrip("/") + "/"
        return channel.type_name in _EVENT_TYPES and channel.topic.startswith(prefix)

    def _read_setup(self) -> tuple[bytes, RigSetup]:
        """Return the id of the first campaign, and its set-up."""
        for file in self._files:
            for raw in file.read_messages(
                lambda channel: channel.type_name == SETUP_TYPE and self._is_event(channel)
            ):
                campaign, _ = self.convert(raw, _campaign_from_msg)
                return campaign, self.convert(raw, setup_from_msg)
        raise FileError(
            f"{self.path} holds no set-up of a rig (topic 'setup', {SETUP_TYPE}): without masses"
            " and settings its blocks cannot be evaluated"
        )

    def convert(self, raw: RawMessage, convert: Callable[[Any], _T]) -> _T:
        """Return a message as a core type.

        Parameters
        ----------
        raw : RawMessage
            Of this recording.
        convert : callable
            From the decoded message to the core type.

        Raises
        ------
        FileError
            If the message does not have the fields of this version, or they cannot be meant.
        """
        try:
            return convert(decode_message(raw))
        except AttributeError as error:
            raise FileError(
                f"{self.path}: {raw.channel.type_name} on {raw.channel.topic} has no field"
                f" {error.name!r}: it was recorded with another version of the interfaces"
            ) from None
        except FileError as error:  # it names the topic
            raise FileError(f"{self.path}: {error}") from None
        except RigError as error:
            raise FileError(f"{self.path}: {raw.channel.topic}: {error}") from None
        except (TypeError, ValueError, OverflowError) as error:
            raise FileError(
                f"{self.path}: {raw.channel.type_name} on {raw.channel.topic} has a field of"
                f" another kind than in this version: {error}"
            ) from None


def read_recording(path: Path) -> Recording:
    """Open a recording of a rig.

    Parameters
    ----------
    path : Path
        As `find_recordings` takes it.

    Raises
    ------
    FileError
        If there is no such file, it is no recording of ROS 2, holds no set-up, or holds several
        rigs.
    """
    files = [Scan(found) for found in find_recordings(Path(path))]
    namespaces = list_namespaces(files[0]) or ("/",)
    if len(namespaces) > 1:
        raise FileError(
            f"{path} holds several rigs, in the namespaces {', '.join(namespaces)}: it should hold"
            " one"
        )
    return Recording(path, files, namespaces[0])


def holds_blocks(file: Scan) -> bool:
    """Return whether a recording holds impacts, and not only a running stream that has them."""
    channels = file.read_channels()
    if not any(is_stream(channel) for channel in channels):
        return True
    return any(file.read_messages(lambda channel: channel.type_name == BLOCK_TYPE))


def is_stream(channel: Channel) -> bool:
    """Return whether a topic holds the running stream of a rig."""
    return channel.type_name == STREAM_TYPE


def list_namespaces(file: Scan) -> tuple[str, ...]:
    """Return the namespaces of the rigs in a recording, by the topics of its blocks.

    A set-up stands in for the blocks where there are none.
    """
    channels = file.read_channels()
    for type_name, name in ((BLOCK_TYPE, "acceleration"), (SETUP_TYPE, "setup")):
        topics = [channel.topic for channel in channels if channel.type_name == type_name]
        if topics:
            return tuple(sorted({_name_parent(topic, name) for topic in topics}))
    return ()


def _name_parent(topic: str, name: str) -> str:
    parent = topic[: -len(name)] if topic.endswith("/" + name) else topic.rpartition("/")[0]
    return parent.rstrip("/") or "/"


def _report_from(report: Report, before: int, done: int) -> None:
    report(before + done)


def _campaign_from_msg(message: Any) -> tuple[bytes, RigSetup | None]:
    """Return the id of a campaign and its set-up; None: it has not begun."""
    has_begun = stamp_from_msg(message.header.stamp)
    return campaign_id_from_msg(message), setup_from_msg(message) if has_begun else None


def _faults_from_msg(message: Any) -> tuple[HitLabel, tuple[str, ...]]:
    return label_from_msg(message), tuple(str(fault) for fault in message.faults)
