"""A recording, opened to be replayed: its topics, the chosen hits, its times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from impact_rig.core.errors import FileError, ParameterError
from impact_rig.nodes.replaying.replay_pace import NANOSECONDS
from impact_rig.nodes.replaying.replay_plan import HitChoice, ReplayPlan, choose_hits
from impact_rig.nodes.replaying.replay_topics import ReplayTopic, choose_namespace, choose_topics
from impact_rig.recording.reading.mcap_reader import (
    BLOCK_TYPE,
    SETUP_TYPE,
    STREAM_TYPE,
    VIRTUAL_IMPACT_TYPE,
)
from impact_rig.recording.reading.source import RecordingSource, open_source
from impact_rig.recording.reading.time_range import find_time_range


@dataclass(frozen=True)
class RecordingToReplay:
    """What is known of a recording before it is replayed.

    Attributes
    ----------
    source : RecordingSource
        Where it is.
    topics : mapping
        What is published, by channel number.
    choice : HitChoice or None
        Only these hits; None: all.
    first_time, last_time : int
        Of its messages, nanoseconds since the epoch.
    warnings : tuple of str
        What the user should know.
    """

    source: RecordingSource
    topics: Mapping[int, ReplayTopic]
    choice: HitChoice | None
    first_time: int
    last_time: int
    warnings: tuple[str, ...]

    @property
    def duration(self) -> float:
        """From the first message to the last [s]."""
        return self.find_position(self.last_time)

    @property
    def is_virtual(self) -> bool:
        """Whether its hits were simulated."""
        return any(
            topic.channel.type_name == VIRTUAL_IMPACT_TYPE for topic in self.topics.values()
        )

    @property
    def block_names(self) -> tuple[str, ...]:
        """Names of the topics that hold the rig's blocks."""
        return tuple(
            topic.name
            for topic in self.topics.values()
            if topic.channel.type_name in (BLOCK_TYPE, STREAM_TYPE)
        )

    def find_position(self, moment: int) -> float:
        """Return how long after the first message something was recorded [s]."""
        return (moment - self.first_time) / NANOSECONDS

    def find_campaigns(self) -> list[tuple[float, float]]:
        """Return from when to when each campaign with blocks was recorded.

        A set-up begins a campaign; what comes before the first one is part of it, as in the
        analysis of the file.

        Returns
        -------
        list of (start, end)
            Since the first message [s]; an end of 0: the recording's.

        Raises
        ------
        FileError
            If the recording is damaged, or holds no set-up.
        """
        kinds = {number: topic.channel.type_name for number, topic in self.topics.items()}
        begins: list[float] = []
        with_blocks: set[int] = set()
        for message in self.source.read_messages(
            lambda channel: kinds.get(channel.id) in (SETUP_TYPE, BLOCK_TYPE, STREAM_TYPE)
        ):
            if message.channel.type_name == SETUP_TYPE:
                begins.append(self.find_position(message.log_time) if begins else 0.0)
            else:
                with_blocks.add(max(len(begins) - 1, 0))
        if not begins:
            raise FileError(
                f"{self.source.path} holds no set-up of a rig: without masses and settings its"
                " blocks cannot be evaluated"
            )
        ends = [*begins[1:], 0.0]
        return [(begins[number], ends[number]) for number in sorted(with_blocks)]

    def make_plan(self, start: float, end: float) -> ReplayPlan:
        """Return what is published of a part of it.

        Parameters
        ----------
        start, end : float
            Since its first message [s]; an end of 0: all of it.

        Raises
        ------
        ParameterError
            If it is shorter, or the end is not after the start.
        """
        if start > self.duration:
            raise ParameterError(f"start is {start:g} s: the recording takes {self.duration:g} s")
        if end and end <= start:
            raise ParameterError(f"end is {end:g} s: it must be later than start, {start:g} s")
        return ReplayPlan(
            self.source,
            self.topics,
            start=self.first_time + round(start * NANOSECONDS) if start else None,
            end=self.first_time + round(end * NANOSECONDS) if end else None,
            choice=self.choice,
        )


def open_recording(
    path: Path,
    *,
    namespace: str,
    is_everything: bool,
    samples: Sequence[str],
    hits: Sequence[str],
) -> RecordingToReplay:
    """Open a recording.

    Parameters
    ----------
    path : Path
        Of a file or a folder; see `find_recording`.
    namespace : str
        Of the rig in it; empty: it is found.
    is_everything : bool
        Whether all its topics are published, not only what an estimator works from.
    samples, hits : sequence of str
        Only these hits, by name; both empty: all.

    Raises
    ------
    FileError
        If there is none, it is damaged, or holds nothing to replay.
    ParameterError
        If there is no such sample or hit.
    """
    source = open_source(path)
    warnings = list(source.warnings)
    topics = choose_topics(
        source,
        choose_namespace(source, namespace),
        is_everything=is_everything,
        warn=warnings.append,
    )
    blocks = {
        topic.channel.id
        for topic in topics
        if topic.channel.type_name in (BLOCK_TYPE, STREAM_TYPE)
    }
    choice = choose_hits(source, blocks, samples, hits)
    first_time, last_time = find_time_range(source)
    return RecordingToReplay(
        source=source,
        topics={topic.channel.id: topic for topic in topics},
        choice=choice,
        first_time=first_time,
        last_time=last_time,
        warnings=tuple(warnings),
    )
