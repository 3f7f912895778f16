"""From when to when a recording reaches."""

from mcap.exceptions import McapError
from mcap.reader import SeekingReader

from impact_rig.core.errors import FileError
from impact_rig.recording.reading.source import RecordingSource


def find_time_range(source: RecordingSource) -> tuple[int, int]:
    """Return the log times of a recording's first and last message.

    They stand in the index of a file that was closed; else all of it is read.

    Returns
    -------
    tuple of int
        Nanoseconds since the epoch.

    Raises
    ------
    FileError
        If it holds no message, or is damaged.
    """
    ranges = _read_statistics(source) if source.is_complete else []
    times = [time for item in ranges for time in item]
    if not times:
        times = [message.log_time for message in source.read_messages()]
    if not times:
        raise FileError(f"{source.path} holds no message")
    return min(times), max(times)


def _read_statistics(source: RecordingSource) -> list[tuple[int, int]]:
    """Return the times of each file with messages, by their indexes; empty: one has none."""
    ranges = []
    for path in source.files:
        try:
            with path.open("rb") as file:
                summary = SeekingReader(file).get_summary()
        except (McapError, OSError, ValueError):
            return []
        statistics = summary.statistics if summary is not None else None
        if statistics is None:
            return []
        if statistics.message_count:
            ranges.append((statistics.message_start_time, statistics.message_end_time))
    return ranges
