"""Reads the rig's recordings back, without ROS: decoded by the schemas in the file itself."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from impact_rig.core.errors import FileError, RigError
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.core.signals.stream_cutter import StreamCutter
from impact_rig.recordings.messages import (
    BLOCK_TYPE,
    SETUP_TYPE,
    STREAM_TYPE,
    VIRTUAL_IMPACT_TYPE,
    block_from_msg,
    head_from_msg,
    label_from_msg,
    setup_from_msg,
    stamp_from_msg,
)
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.schemas import SchemaDecoder
from impact_rig.recordings.source import RecordingSource, open_source

_EVENT_TYPES = (SETUP_TYPE, BLOCK_TYPE, STREAM_TYPE, VIRTUAL_IMPACT_TYPE)

SHARED_TOPICS = frozenset({"/diagnostics", "/rosout", "/parameter_events", "/clock"})
"""Topics that are the same for all namespaces: they are never taken as relative."""

_T = TypeVar("_T")


class Recording:
    """A recording of one rig; it is read anew by each iteration, nothing is held in memory.

    Made by `read_recording`.

    Attributes
    ----------
    path : Path
        Of the file, or of the folder.
    namespace : str
        Of the rig, "/" for none.
    setup : RigSetup
        The first set-up in the file.
    warnings : tuple of str
        What the reader should know, in words; empty: nothing.
    """

    def __init__(self, file: RecordingSource, namespace: str) -> None:
        self._file = file
        self._decoder = SchemaDecoder()
        self._faults: dict[HitLabel, tuple[str, ...]] = {}
        self.path = file.path
        self.namespace = namespace
        self.warnings = file.warnings
        self.setup = self._read_setup()

    @property
    def faults(self) -> Mapping[HitLabel, tuple[str, ...]]:
        """Faults injected by the virtual rig, by hit, as far as `events` has been read.

        Without an entry: nothing is known of the hit; empty: a good hit.
        """
        return MappingProxyType(self._faults)

    @property
    def size(self) -> int:
        """Of all its files together [byte]."""
        return self._file.size

    def events(self, report: Callable[[int], None] | None = None) -> Iterator[RigSetup | Block]:
        """Yield set-ups and blocks in file order, the first set-up before everything else.

        Where nobody found the impacts in a running stream while it was recorded, they are found
        now.

        Parameters
        ----------
        report : callable, optional
            Is told now and then how much was read [byte].

        Yields
        ------
        RigSetup or Block
            A set-up holds for the blocks after it.

        Raises
        ------
        FileError
            If the file is damaged, or a message does not have the fields of this version.
        """
        yield self.setup
        is_first = True
        cutter = None if holds_blocks(self._file) else StreamCutter(self.setup.analysis)

        def is_wanted(channel: Channel) -> bool:
            return self._is_event(channel) and (cutter is not None or not is_stream(channel))

        for raw in self._file.read_messages(is_wanted, report=report):
            if raw.channel.type_name == VIRTUAL_IMPACT_TYPE:
                label, faults = self.convert(raw, _faults_from_msg)
                self._faults[label] = faults
            elif raw.channel.type_name == BLOCK_TYPE:
                yield self.convert(raw, block_from_msg)
            elif cutter is not None and is_stream(raw.channel):
                yield from cutter.feed(self.convert(raw, block_from_msg))
            elif is_first:
                is_first = False
            else:
                setup = self.convert(raw, _begun_setup_from_msg)
                if setup is None:
                    continue
                if cutter is not None:
                    cutter = StreamCutter(setup.analysis)
                yield setup

    def raw_messages(
        self, *type_names: str, start_time: int | None = None, end_time: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield messages as they stand in the file; see `RecordingSource.read_messages`.

        Parameters
        ----------
        type_names : str
            Of `SETUP_TYPE`, `BLOCK_TYPE` and so on: those to be read.
        start_time, end_time : int, optional
            Only messages logged from the one to before the other, nanoseconds since the epoch.
        """
        return self._file.read_messages(
            lambda channel: channel.type_name in type_names and self._is_event(channel),
            start_time=start_time,
            end_time=end_time,
        )

    def _is_event(self, channel: Channel) -> bool:
        prefix = self.namespace.rstrip("/") + "/"
        return channel.type_name in _EVENT_TYPES and channel.topic.startswith(prefix)

    def _read_setup(self) -> RigSetup:
        for raw in self.raw_messages(SETUP_TYPE):
            return self.convert(raw, setup_from_msg)
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
            return convert(self._decoder.decode(raw.channel, raw.data))
        except AttributeError as error:
            raise FileError(
                f"{self.path}: {raw.channel.type_name} on {raw.channel.topic} has no field"
                f" {error.name!r}: it was recorded with another version of the interfaces"
            ) from None
        except (RigError, TypeError, ValueError, OverflowError) as error:
            if isinstance(error, FileError):
                raise FileError(f"{self.path}: {error}") from None
            if isinstance(error, RigError):
                raise FileError(f"{self.path}: {raw.channel.topic}: {error}") from None
            raise FileError(
                f"{self.path}: {raw.channel.type_name} on {raw.channel.topic} has a field of"
                f" another kind than in this version: {error}"
            ) from None


def read_recording(path: Path, namespace: str | None = None) -> Recording:
    """Open a recording of a rig.

    Parameters
    ----------
    path : Path
        As `find_recording` takes it.
    namespace : str, optional
        Of the rig; found in the file by default.

    Returns
    -------
    Recording

    Raises
    ------
    FileError
        If there is no such file, it is no recording of ROS 2, holds no set-up, or holds several
        rigs of which none was chosen.
    """
    file = open_source(Path(path))
    if namespace is None:
        namespaces = list_namespaces(file)
        if len(namespaces) > 1:
            raise FileError(
                f"{path} holds several rigs, in the namespaces {', '.join(namespaces)}: choose one"
            )
        namespace = namespaces[0] if namespaces else "/"
    return Recording(file, "/" + namespace.strip("/"))


def holds_blocks(file: RecordingSource) -> bool:
    """Return whether a recording holds impacts, and not only a running stream that has them."""
    channels = file.read_channels()
    if not any(is_stream(channel) for channel in channels):
        return True
    return any(file.read_messages(lambda channel: channel.type_name == BLOCK_TYPE))


def is_stream(channel: Channel) -> bool:
    """Return whether a topic holds the running stream of a rig."""
    return channel.type_name == STREAM_TYPE


def list_namespaces(file: RecordingSource) -> tuple[str, ...]:
    """Return the namespaces of the rigs in a recording, by the topics of its blocks.

    A set-up stands in for the blocks where there are none.
    """
    channels = file.read_channels()
    for type_name, name in ((BLOCK_TYPE, "acceleration"), (SETUP_TYPE, "setup")):
        topics = [channel.topic for channel in channels if channel.type_name == type_name]
        if topics:
            return tuple(sorted({_name_parent(topic, name) for topic in topics}))
    return ()


def make_relative(topic: str, namespace: str) -> str:
    """Return a topic's name relative to a namespace; unchanged where it lies outside."""
    prefix = namespace.rstrip("/") + "/"
    if topic in SHARED_TOPICS or not topic.startswith(prefix):
        return topic
    return topic[len(prefix) :]


def _name_parent(topic: str, name: str) -> str:
    parent = topic[: -len(name)] if topic.endswith("/" + name) else topic.rpartition("/")[0]
    return parent.rstrip("/") or "/"


def _begun_setup_from_msg(message: Any) -> RigSetup | None:
    """Return a set-up; None: no campaign began with it."""
    return setup_from_msg(message) if stamp_from_msg(message.header.stamp) else None


def _faults_from_msg(message: Any) -> tuple[HitLabel, tuple[str, ...]]:
    return label_from_msg(message), tuple(str(fault) for fault in message.faults)


@dataclass(frozen=True)
class IndexedHit:
    """Where one hit lies.

    Attributes
    ----------
    label : HitLabel
        Which hit.
    start_time, end_time : int
        When its first and its last block were received, nanoseconds since the epoch.
    """

    label: HitLabel
    start_time: int
    end_time: int


def index_hits(recording: Recording) -> tuple[tuple[IndexedHit, ...], ...]:
    """Find the hits of a recording; of its blocks no more than the heads are looked at.

    Parameters
    ----------
    recording : Recording
        It is read once; what its index shows to hold no hit is passed over.

    Returns
    -------
    tuple of tuple of IndexedHit
        The campaigns with hits, as `analyze_recording` tells them apart, each with its hits in
        file order.

    Raises
    ------
    FileError
        If the file is damaged.
    """
    campaigns: list[list[IndexedHit]] = [[]]
    begun: IndexedHit | None = None
    next_sample = 0
    has_setup = False
    for raw in recording.raw_messages(SETUP_TYPE, BLOCK_TYPE):
        if raw.channel.type_name == SETUP_TYPE:
            # The first one holds for what came before it, too.
            if has_setup:
                campaigns.append([])
            has_setup, begun = True, None
            continue
        head = recording.convert(raw, head_from_msg)
        is_next = begun is not None and begun.label == head.label
        if begun is None or not is_next or head.first_sample < next_sample:
            begun = IndexedHit(head.label, raw.log_time, raw.log_time)
            campaigns[-1].append(begun)
        else:
            start, end = begun.start_time, begun.end_time
            begun = IndexedHit(head.label, min(start, raw.log_time), max(end, raw.log_time))
            campaigns[-1][-1] = begun
        next_sample = head.first_sample + head.points
        if head.last:
            begun = None
    return tuple(tuple(hits) for hits in campaigns if hits)


def read_hit(recording: Recording, hit: IndexedHit) -> tuple[Block, ...]:
    """Return the blocks of a hit as they were recorded, in file order.

    Of a recording that was closed only the chunks of this hit are read.

    Raises
    ------
    FileError
        If the file is damaged, or is not the one that was indexed.
    """
    raws = recording.raw_messages(BLOCK_TYPE, start_time=hit.start_time, end_time=hit.end_time + 1)
    blocks = tuple(recording.convert(raw, block_from_msg) for raw in raws)
    found = tuple(block for block in blocks if block.label == hit.label)
    if not found:
        raise FileError(
            f"{recording.path} no longer holds record {hit.label.record} of"
            f" {hit.label.sample!r}: the file was changed"
        )
    return found
