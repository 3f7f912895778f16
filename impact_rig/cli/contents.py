"""What a recording holds, in words and in JSON, read under a bar."""

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
from rich.progress import DownloadColumn

from impact_rig.cli.progress_bar import PATIENCE, ProgressBar, TimeLeft
from impact_rig.core.errors import FileError, RigError
from impact_rig.core.hits.overrule import describe_label
from impact_rig.core.origin import join_origins
from impact_rig.core.setup.sensors import Sensor
from impact_rig.present.terminal.console import ALARM, make_console, print_table
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents, inspect_recording
from impact_rig.recordings.hits import HitState, RecordedHit
from impact_rig.recordings.messages import setup_from_msg
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD
from impact_rig.recordings.schemas import compare_definitions, find_message_definition
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
        # Whatever else is wrong with a set-up: `analyze` tells.
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


OUR_INTERFACES = "impact_rig_msgs/"
"""How the names of the rig's message types begin."""


def describe_verdict(contents: Contents) -> str:
    """Return in one sentence what a recording holds, or what is wrong with it."""
    found = describe_hits(contents)
    if contents.is_sound:
        recovery = read_fields(contents, RECOVERY_RECORD)
        origin = f"; recovered from {recovery.get('recovered_from', '?')}" if recovery else ""
        return f"sound: {found}{origin}"
    return (
        f"damaged: {'; '.join(contents.problems)}. Left of it: {found}."
        f" `impact-rig recover {contents.path}` saves that"
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


def describe_recovery(fields: Mapping[str, str]) -> str:
    """Return what a recovered recording says of what was lost."""
    return (
        f"from {fields.get('recovered_from', '?')}: {fields.get('messages_lost', '?')} messages"
        " lost,"
        f" {fields.get('hits_lost', '?')} hits lost, {fields.get('hits_damaged', '?')} damaged"
    )


def describe_losses(contents: Contents) -> str:
    """Return what was lost while it was recorded, in words; what was lost later is damage."""
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


def describe_interface_differences(contents: Contents) -> tuple[str, ...] | None:
    """Return in words where the rig's messages differ from the installed ones.

    None: the installed ones are not at hand.
    """
    differences: dict[str, None] = {}
    for topic in contents.topics:
        if not topic.type_name.startswith(OUR_INTERFACES):
            continue
        try:
            installed = find_message_definition(topic.type_name)
        except FileError:
            return None
        try:
            changes = compare_definitions(topic.type_name, topic.schema, installed.text)
        except FileError as error:
            differences[str(error)] = None
            continue
        differences |= dict.fromkeys(changes)
    return tuple(differences)


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
        "files": [
            {
                "path": str(file.path),
                "size_bytes": file.size,
                "library": file.library,
                "compression": list(file.compression),
                "chunks": file.chunks,
                "messages": file.messages,
                "closed": file.is_closed,
                "has_index": file.has_index,
                "unread_bytes": file.unread,
                "damages": [
                    {"start_byte": start, "size_bytes": size, "reason": reason}
                    for start, size, reason, _ in file.damages
                ],
            }
            for file in contents.files
        ],
        "missing_files": list(contents.missing_files),
        "sensors": [to_json(sensor) for sensor in read_sensors(contents)],
        "versions": read_versions(contents),
        "interface_differences": describe_interface_differences(contents),
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
    """Return a bar that follows the reading of a file or folder, so often, to be told bytes."""
    total = passes * _measure(path)
    columns = (DownloadColumn(), TimeLeft())
    return ProgressBar(make_console(stderr=True), title, *columns, total=total, patience=PATIENCE)


def inspect_with_progress(path: Path) -> Contents:
    """Read all of the recording that a path means, under a bar; errors as `inspect_recording`."""
    found = find_recording(path)
    with follow_reading(f"reading {path}", found) as bar:
        return inspect_recording(found, report=bar.report)


def _measure(path: Path) -> int:
    """Return the size of a file, or of all files of a folder [byte]; 0: it cannot be told."""
    try:
        files = list(path.iterdir()) if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files)
    except OSError:
        return 0


MOST_HITS = 20
"""How many imported, damaged or lost hits are named, our choice: JSON has them all."""


def print_hits(console: Console, contents: Contents) -> None:
    """Print the hits of which something is missing, and from which files others were imported."""
    incomplete = [hit for hit in contents.hits if hit.state is not HitState.SAVED]
    imported = [hit for hit in contents.hits if hit.origin.file]
    for title, hits, (first, second), read in (
        ("Hits damaged or lost", incomplete, ("State", "Why"), _tell_state),
        ("Imported hits", imported, ("File", "Place"), _tell_file),
    ):
        rows = [(_name_hit(hit), *read(hit)) for hit in hits[:MOST_HITS]]
        left = len(hits) - len(rows)
        if rows:
            print_table(
                console,
                f"{title}: {len(hits)}",
                [
                    Column(name, cells, is_text=True)
                    for name, cells in zip(
                        ("Hit", first, second), zip(*rows, strict=True), strict=True
                    )
                ],
                [f"And {left} more: --json names them all."] if left else (),
            )


def _name_hit(hit: RecordedHit) -> str:
    return str(hit.record) if hit.label is None else describe_label(hit.label)


def _tell_state(hit: RecordedHit) -> tuple[str, str]:
    return hit.state.value, hit.reason


def _tell_file(hit: RecordedHit) -> tuple[str, str]:
    return hit.origin.file, hit.origin.place


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
