"""Counts what one file of a recording holds, and what is wrong with it."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field

from impact_rig.recording.recovery.contents import FileContents
from impact_rig.recording.recovery.found import ChunkEnd, Damage, FoundMessage
from impact_rig.recording.recovery.salvage import Salvage

OUR_LIBRARY = "impact_rig"
"""First word of the library in files of our recorder, which numbers messages without gaps."""
PROFILE = "ros2"
"""Of recordings of ROS 2."""
MOST_PLACES = 10
"""How many damaged places are told in words, our choice."""


@dataclass
class ChannelTally:
    """Counts of one channel: messages that are sound and unverified, and the sound ones' spans."""

    messages: int = 0
    unverified: int = 0
    first_sequence: int = 0
    last_sequence: int = 0
    start_time: int = 0
    end_time: int = 0

    def add(self, message: FoundMessage) -> None:
        """Count a message that is sound."""
        if self.messages == 0:
            self.start_time, self.first_sequence = message.log_time, message.sequence
        self.messages += 1
        self.last_sequence = message.sequence
        self.start_time = min(self.start_time, message.log_time)
        self.end_time = max(self.end_time, message.log_time)


@dataclass
class FileTally:
    """Counts of one file."""

    channels: dict[int, ChannelTally] = field(default_factory=lambda: defaultdict(ChannelTally))
    compression: dict[str, None] = field(default_factory=dict)

    def add_message(self, message: FoundMessage, *, is_decodable: bool) -> None:
        """Count a message; one that is neither vouched nor decodable is nothing."""
        tally = self.channels[message.topic.channel.id]
        if message.is_vouched:
            tally.add(message)
        elif is_decodable:
            tally.unverified += 1

    def add_chunk(self, chunk: ChunkEnd) -> None:
        """Note how a chunk was compressed."""
        self.compression[chunk.compression or "none"] = None

    def count_lost(self, salvage: Salvage) -> dict[int, int]:
        """Return how many further messages of each channel are known to have been written."""
        lost = {}
        for number, existing in self._count_existing(salvage).items():
            tally = self.channels[number]
            lost[number] = max(existing - tally.messages - tally.unverified, 0)
        return lost

    def _count_existing(self, salvage: Salvage) -> Counter[int]:
        existing = Counter(salvage.existing)
        index = salvage.index
        if index is not None and index.is_sound and index.statistics is not None:
            existing |= Counter(index.statistics.channel_message_counts)
        if salvage.header is not None and salvage.header.library.split(" ")[0] == OUR_LIBRARY:
            for number, tally in self.channels.items():
                if tally.messages:
                    span = tally.last_sequence - tally.first_sequence + 1
                    existing[number] = max(existing[number], span)
        return existing

    def describe(self, salvage: Salvage, lost: dict[int, int]) -> FileContents:
        """Return what is known of the file itself, once it was read."""
        tallies = [tally for tally in self.channels.values() if tally.messages]
        return FileContents(
            path=salvage.path,
            size=salvage.size,
            library=salvage.header.library if salvage.header is not None else "",
            compression=tuple(self.compression),
            chunks=salvage.chunks,
            messages=sum(tally.messages for tally in tallies),
            start_time=min((tally.start_time for tally in tallies), default=0),
            end_time=max((tally.end_time for tally in tallies), default=0),
            is_closed=salvage.is_closed,
            has_index=salvage.index is not None and salvage.index.is_sound,
            damages=tuple(salvage.damages),
            problems=tuple(self._find_problems(salvage, lost)),
        )

    def _find_problems(self, salvage: Salvage, lost: dict[int, int]) -> Iterator[str]:
        if not salvage.is_closed:
            yield "it was never closed, its end is missing"
        elif salvage.index is None:
            yield "it has no index at its end"
        if salvage.header is not None and salvage.header.profile != PROFILE:
            yield f"its profile is {salvage.header.profile!r}: it should be {PROFILE!r}"
        yield from map(describe_damage, salvage.damages[:MOST_PLACES])
        if len(salvage.damages) > MOST_PLACES:
            yield f"{len(salvage.damages) - MOST_PLACES} further places cannot be read"
        if not salvage.damages and any(lost.values()):
            yield f"{sum(lost.values())} messages are missing: their numbers, or the index, tell"
        unsure = sorted(
            topic.channel.topic for topic in salvage.topics.values() if not topic.is_vouched
        )
        if unsure:
            yield f"no checksum vouches for the description of {', '.join(unsure)}"
        if count := salvage.unknown.total():
            yield f"the topic of {count} messages is not described any more"


def describe_damage(damage: Damage) -> str:
    """Return in words what cannot be read, and where."""
    if not damage.size:
        return f"{damage.reason} (at byte {damage.start})"
    return f"{damage.reason} ({damage.size} byte from byte {damage.start})"
