"""A recording, opened to be replayed: its topics, the chosen hits, its times."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from impact_rig.core.errors import ParameterError
from impact_rig.nodes.replay_pace import NANOSECONDS
from impact_rig.nodes.replay_plan import HitChoice, ReplayPlan, choose_hits
from impact_rig.nodes.replay_topics import ReplayTopic, choose_namespace, choose_topics
from impact_rig.recording.mcap_reader import BLOCK_TYPE
from impact_rig.recording.source import RecordingSource, open_source
from impact_rig.recording.time_range import find_time_range


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
    """

    source: RecordingSource
    topics: Mapping[int, ReplayTopic]
    choice: HitChoice | None
    first_time: int
    last_time: int

    @property
    def duration(self) -> float:
        """From the first message to the last [s]."""
        return (self.last_time - self.first_time) / NANOSECONDS

    @property
    def block_names(self) -> tuple[str, ...]:
        """Names of the topics that hold the rig's blocks."""
        return tuple(
            topic.name for topic in self.topics.values() if topic.channel.type_name == BLOCK_TYPE
        )

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
    warn: Callable[[str], None],
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
    warn : callable
        Told what the user should know.

    Raises
    ------
    FileError
        If there is none, it is damaged, or holds nothing to replay.
    ParameterError
        If there is no such sample or hit.
    """
    source = open_source(path)
    for warning in source.warnings:
        warn(warning)
    topics = choose_topics(
        source, choose_namespace(source, namespace), is_everything=is_everything, warn=warn
    )
    blocks = {topic.channel.id for topic in topics if topic.channel.type_name == BLOCK_TYPE}
    return RecordingToReplay(
        source,
        {topic.channel.id: topic for topic in topics},
        choose_hits(source, blocks, samples, hits),
        *find_time_range(source),
    )
