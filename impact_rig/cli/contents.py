"""What a recording holds, as text and as JSON."""

import contextlib
import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import DownloadColumn, TimeRemainingColumn

from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.core.errors import RigError
from impact_rig.core.hits import describe_label
from impact_rig.core.records import join_origins
from impact_rig.core.sensors import Sensor
from impact_rig.present.terminal.console import ALARM, make_console, print_table
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents, inspect_recording
from impact_rig.recordings.hits import HitState, RecordedHit
from impact_rig.recordings.messages import setup_from_msg
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD
from impact_rig.recordings.source import find_recording
from impact_rig.recordings.writer import HEALTH_RECORD
from impact_rig.results.numbers import MISSING, format_count, format_number
from impact_rig.results.results_file import origin_to_json
from impact_rig.results.tables import Column, make_optional
from impact_rig.results.wire import to_json


def read_sensors(contents: Contents) -> tuple[Sensor, ...]:
    """Return the sensors of all set-ups of a recording, each once."""
    found: list[Sensor] = []
    for message in contents.setups.values():
        # `analyze` reports what is wrong with a set-up.
        with contextlib.suppress(RigError, AttributeError, TypeError):
            found += setup_from_msg(message).sensors
    # By their words: a sensitivity that is not known (NaN) is not equal to itself.
    return tuple({(item.channel, item.describe()): item for item in found}.values())


def describe_old_calibrations(contents: Contents) -> list[str]:
    """Return which sensors' calibrations were too old on the day of the recording."""
    try:
        day = datetime.fromtimestamp(contents.start_time * 1e-9, tz=UTC).date().isoformat()
    except (OverflowError, OSError, ValueError):
        return []
    found = [sensor.describe_age(day) for sensor in read_sensors(contents)]
    return [text for text in found if text]


def describe_verdict(contents: Contents) -> str:
    """Return in one sentence what a recording holds, or what is wrong with it."""
    found = describe_hits(contents)
    if contents.is_sound:
        recovery = read_fields(contents, RECOVERY_RECORD)
        origin = f"; recovered from {recovery.get('recovered_from', '?')}" if recovery else ""
        return f"sound: {found}{origin}"
    return (
        f"damaged: {'; '.join(contents.problems)}. Left of it: {found}."
        f" `impact-rig export {contents.path} -o sound.mcap` saves that"
    )


def describe_hits(contents: Contents) -> str:
    """Return how much a recording holds: samples, hits and verdicts, or messages alone."""
    if not contents.hits:
        return f"{format_count(contents.messages, 'message')}, no hit"
    saved = [hit for hit in contents.hits if hit.state is HitState.SAVED]
    samples = {hit.label.sample for hit in saved if hit.label is not None}
    verdicts = Counter(hit.is_accepted for hit in saved)
    parts = [format_count(len(samples), "sample")]
    if verdicts[True] or verdicts[False]:
        parts += [f"{format_count(verdicts[True], 'hit')} accepted", f"{verdicts[False]} rejected"]
    if verdicts[None]:
        parts.append(f"{format_count(verdicts[None], 'hit')} without a verdict")
    parts += [
        f"{contents.count_hits(state)} {state.value}"
        for state in (HitState.DAMAGED, HitState.LOST)
        if contents.count_hits(state)
    ]
    return ", ".join(parts)


def describe_loss(contents: Contents) -> str:
    """Return as text what a sound copy lacks."""
    parts = [f"{contents.unread} byte that cannot be read"] if contents.unread else []
    if contents.lost:
        parts.append(f"at least {format_count(contents.lost, 'message')}")
    return f"lost: {' and '.join(parts) or 'nothing'}"


def describe_recovery(fields: Mapping[str, str]) -> str:
    """Return what a recovered recording says of the damaged one."""
    return f"from {fields.get('recovered_from', '?')}: {fields.get('problems', '?')}"


def describe_losses(contents: Contents) -> str:
    """Return as text what was lost while recording."""
    gaps = [
        (
            "the blocks",
            sum(hit.gaps for hit in contents.hits),
            sum(hit.missing_points for hit in contents.hits),
        ),
        *((topic, item.gaps, item.missing_points) for topic, item in contents.streams.items()),
    ]
    parts = [
        f"{format_count(number, 'gap')} of {format_count(points, 'point')} in {where}"
        for where, number, points in gaps
        if number
    ]
    for number, where in (
        (contents.messages_lost, "on the way to the recorder"),
        (contents.lost, "of the file"),
    ):
        if number:
            parts.append(f"{format_count(number, 'message')} {where}")
    return ", ".join(parts)


def count_reasons(contents: Contents) -> Counter[str]:
    """Return how often each reason for rejection was given; a hit may have several."""
    return Counter(reason.partition(":")[0] for hit in contents.hits for reason in hit.rejections)


def read_fields(contents: Contents, name: str) -> dict[str, str]:
    """Return the last metadata record of a name; empty: there is none."""
    records = [record.fields for record in contents.metadata if record.name == name]
    return records[-1] if records else {}


def read_versions(contents: Contents) -> dict[str, str]:
    """Return what recorded: software, Python, ROS 2 and libraries with their versions."""
    fields = read_fields(contents, PROVENANCE_RECORD)
    names = {"software_version": "impact_rig", "python": "Python", "ros_distro": "ROS 2"}
    versions = {text: fields[key] for key, text in names.items() if fields.get(key)}
    for setup in contents.setups.values():
        versions.setdefault("impact_rig", str(getattr(setup, "software_version", "")))
    # Recordings of another origin may have anything there.
    with contextlib.suppress(KeyError, ValueError, AttributeError, RecursionError):
        versions |= {str(key): str(text) for key, text in json.loads(fields["libraries"]).items()}
    return {name: text for name, text in versions.items() if text}


def contents_to_json(contents: Contents) -> dict[str, Any]:
    """Return what a recording holds as plain values."""
    return {
        "path": str(contents.path),
        "sound": contents.is_sound,
        "verdict": describe_verdict(contents),
        "problems": list(contents.problems),
        "remarks": [*contents.remarks, *describe_old_calibrations(contents)],
        "start_time_ns": contents.start_time,
        "end_time_ns": contents.end_time,
        "messages": contents.messages,
        "messages_lost": contents.lost,
        "messages_lost_on_the_way": contents.messages_lost,
        "gaps": sum(hit.gaps for hit in contents.hits),
        "missing_points": sum(hit.missing_points for hit in contents.hits),
        "hits": [_hit_to_json(hit) for hit in contents.hits],
        **origin_to_json(join_origins(hit.origin for hit in contents.hits)),
        "streams": [
            {
                "topic": topic,
                "blocks": stream.blocks,
                "points": stream.points,
                "gaps": stream.gaps,
                "missing_points": stream.missing_points,
            }
            for topic, stream in contents.streams.items()
        ],
        "rejections": dict(count_reasons(contents)),
        "topics": [
            {
                "name": topic.name,
                "type": topic.type_name,
                "messages": topic.messages,
                "lost": topic.lost,
                "rate_hz": topic.rate if math.isfinite(topic.rate) else None,
            }
            for topic in contents.topics
        ],
        "file": {
            "size_bytes": contents.size,
            "library": contents.library,
            "compression": list(contents.compression),
            "chunks": contents.chunks,
            "closed": contents.is_closed,
            "has_index": contents.has_index,
            "unread_bytes": contents.unread,
            "damages": [
                {"start_byte": start, "size_bytes": size, "reason": reason}
                for start, size, reason in contents.damages
            ],
        },
        "sensors": [to_json(sensor) for sensor in read_sensors(contents)],
        "versions": read_versions(contents),
        "health": read_fields(contents, HEALTH_RECORD),
        "recovery": read_fields(contents, RECOVERY_RECORD),
        "parameters": read_fields(contents, PARAMETERS_RECORD),
        "notes": [dataclasses.asdict(note) for note in contents.notes],
        "attachments": [dataclasses.asdict(item) for item in contents.attachments],
    }


def _hit_to_json(hit: RecordedHit) -> dict[str, Any]:
    label = hit.label
    return {
        "rig": hit.rig,
        "campaign": hit.campaign,
        "record": hit.record,
        "sample": label.sample if label else None,
        "impact": label.impact if label else None,
        "attempt": label.attempt if label else None,
        "state": hit.state.value,
        "reason": hit.reason,
        "gaps": hit.gaps,
        "missing_points": hit.missing_points,
        "accepted": hit.is_accepted,
        "rejections": list(hit.rejections),
        **to_json(hit.origin),
    }


def follow_reading(title: str, path: Path, passes: int = 1) -> ProgressBar:
    """Return a bar that follows the reading of a file, so often, in bytes."""
    total = passes * path.stat().st_size
    columns = (DownloadColumn(), TimeRemainingColumn())
    return ProgressBar(make_console(stderr=True), title, *columns, total=total)


def inspect_with_progress(path: Path) -> Contents:
    """Read all of the recording that a path means, under a bar; errors as `inspect_recording`."""
    found = find_recording(path)
    with follow_reading(f"reading {path}", found) as bar:
        return inspect_recording(found, report=bar.report)


MOST_HITS = 20  # named in a terminal; JSON has them all


def print_incomplete_hits(console: Console, contents: Contents) -> None:
    """Print the hits of which something is missing."""
    hits = [hit for hit in contents.hits if hit.state is not HitState.SAVED]
    if not hits:
        return
    shown = hits[:MOST_HITS]
    names = [describe_label(hit.label) if hit.label else str(hit.record) for hit in shown]
    columns = [
        Column("Hit", names, is_text=True),
        Column("State", [hit.state.value for hit in shown], is_text=True),
        Column("Why", [hit.reason for hit in shown], is_text=True),
    ]
    left = len(hits) - len(shown)
    notes = [f"And {left} more: --json names them all."] if left else ()
    print_table(console, f"Hits damaged or lost: {len(hits)}", columns, notes)


def print_topics(console: Console, contents: Contents) -> None:
    """Print the topics with what is there of each, and what is not."""
    topics = contents.topics
    if not topics:
        return
    columns = [
        Column("Topic", [topic.name for topic in topics], is_text=True),
        Column("Messages", [str(topic.messages) for topic in topics]),
        make_optional("Hz", [format_number(topic.rate, 1) for topic in topics]),
        Column("Type", [topic.type_name or MISSING for topic in topics], is_text=True),
    ]
    lost = [topic.lost for topic in topics]
    if any(lost):
        styles = [ALARM if number else "" for number in lost]
        columns.insert(2, Column("Lost", [str(number) for number in lost], styles=styles))
    print_table(console, f"Topics: {len(topics)}", columns)
