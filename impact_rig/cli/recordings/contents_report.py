"""What `impact-rig info` and `impact-rig recover` say of a recording, in words and in JSON."""

import contextlib
import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from impact_rig.cli.recordings.recorded_sensors import find_sensor_warnings, find_sensors
from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.interface_changes import find_interface_changes
from impact_rig.recording.interfaces.message_definitions import find_message_definition
from impact_rig.recording.recovery.contents import RECOVERY_RECORD, Contents
from impact_rig.recording.recovery.recorded_hits import HitState, RecordedHit
from impact_rig.recording.writing.origin import ORIGIN_RECORD, PARAMETERS_RECORD
from impact_rig.recording.writing.split_contents import HEALTH_RECORD
from impact_rig.results.results_file import record_to_json

OUR_INTERFACES = "impact_rig_msgs/"
"""How the names of the rig's message types begin."""


def describe_verdict(contents: Contents) -> str:
    """Return in one sentence what a recording holds, or what is wrong with it."""
    found = describe_hits(contents)
    if contents.is_sound:
        recovery = find_fields(contents, RECOVERY_RECORD)
        origin = f"; recovered from {recovery.get('recovered_from', '?')}" if recovery else ""
        return f"sound: {found}{origin}"
    return (
        f"damaged: {'; '.join(contents.problems)}. Left of it: {found}."
        f" `impact-rig recover {contents.path}` saves that"
    )


def describe_hits(contents: Contents) -> str:
    """Return how much a recording holds: samples, hits and verdicts, or messages alone."""
    if not contents.hits:
        return f"{count(contents.messages, 'message')}, no hit"
    saved = [hit for hit in contents.hits if hit.state is HitState.SAVED]
    samples = {hit.label.sample for hit in saved if hit.label is not None}
    verdicts = Counter(hit.is_accepted for hit in saved)
    parts = [count(len(samples), "sample")]
    if verdicts[True] or verdicts[False]:
        parts += [f"{count(verdicts[True], 'hit')} accepted", f"{verdicts[False]} rejected"]
    if verdicts[None]:
        parts.append(f"{count(verdicts[None], 'hit')} without a verdict")
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
        f" lost, {fields.get('messages_unverified', '?')} unverified,"
        f" {fields.get('hits_lost', '?')} hits lost, {fields.get('hits_damaged', '?')} damaged"
    )


def describe_losses(contents: Contents) -> str:
    """Return what was lost while it was recorded, in words; what was lost later is damage."""
    gaps = sum(hit.gaps for hit in contents.hits)
    points = sum(hit.missing_points for hit in contents.hits)
    parts = []
    if gaps:
        parts.append(f"{count(gaps, 'gap')} of {count(points, 'point')} in the blocks")
    parts += [
        f"{count(stream.gaps, 'gap')} of {count(stream.missing_points, 'point')} in {stream.topic}"
        for stream in contents.streams
        if stream.gaps
    ]
    if contents.messages_lost:
        parts.append(f"{count(contents.messages_lost, 'message')} on the way to the recorder")
    if contents.lost:
        parts.append(f"{count(contents.lost, 'message')} of the file")
    if contents.unverified:
        parts.append(f"{count(contents.unverified, 'message')} that no checksum vouches for")
    return ", ".join(parts)


def count(number: int, what: str) -> str:
    """Return ``1 hit`` or ``2 hits``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def count_reasons(contents: Contents) -> Counter[str]:
    """Return how often each reason for rejection was given; a hit may have several."""
    return Counter(reason.partition(":")[0] for hit in contents.hits for reason in hit.rejections)


def find_fields(contents: Contents, name: str) -> dict[str, str]:
    """Return the last metadata record of a name; empty: there is none."""
    records = [record.fields for record in contents.metadata if record.name == name]
    return records[-1] if records else {}


def find_parameters(contents: Contents) -> dict[str, str]:
    """Return the parameters of all nodes as YAML, by full node name."""
    return find_fields(contents, PARAMETERS_RECORD)


def find_versions(contents: Contents) -> dict[str, str]:
    """Return what recorded: software, Python, ROS 2 and libraries with their versions."""
    fields = find_fields(contents, ORIGIN_RECORD)
    names = {"software_version": "impact_rig", "python": "Python", "ros_distro": "ROS 2"}
    versions = {text: fields[key] for key, text in names.items() if fields.get(key)}
    for setup in contents.setups:
        versions.setdefault("impact_rig", str(getattr(setup, "software_version", "")))
    # Recordings of another origin may have anything there.
    with contextlib.suppress(KeyError, ValueError, AttributeError):
        versions |= {str(key): str(text) for key, text in json.loads(fields["libraries"]).items()}
    return {name: text for name, text in versions.items() if text}


def find_interface_differences(contents: Contents) -> tuple[str, ...] | None:
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
            changes = find_interface_changes(topic.type_name, topic.schema, installed.text)
        except FileError as error:
            differences[str(error)] = None
            continue
        differences |= dict.fromkeys(map(str, changes))
    return tuple(differences)


def find_health(contents: Contents) -> dict[str, str]:
    """Return what the recorder said of its work at the end."""
    return find_fields(contents, HEALTH_RECORD)


def contents_to_json(contents: Contents) -> dict[str, Any]:
    """Return what a recording holds as plain values."""
    return {
        "path": str(contents.path),
        "sound": contents.is_sound,
        "verdict": describe_verdict(contents),
        "problems": list(contents.problems),
        "remarks": [*contents.remarks, *find_sensor_warnings(contents)],
        "start_time_ns": contents.start_time,
        "end_time_ns": contents.end_time,
        "messages": contents.messages,
        "messages_unverified": contents.unverified,
        "messages_lost": contents.lost,
        "messages_lost_on_the_way": contents.messages_lost,
        "gaps": sum(hit.gaps for hit in contents.hits),
        "missing_points": sum(hit.missing_points for hit in contents.hits),
        "hits": [_hit_to_json(hit) for hit in contents.hits],
        "streams": [dataclasses.asdict(stream) for stream in contents.streams],
        "rejections": dict(count_reasons(contents)),
        "topics": [
            {
                "name": topic.name,
                "type": topic.type_name,
                "messages": topic.messages,
                "unverified": topic.unverified,
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
        "sensors": [record_to_json(sensor) for sensor in find_sensors(contents)],
        "versions": find_versions(contents),
        "interface_differences": find_interface_differences(contents),
        "health": find_health(contents),
        "recovery": find_fields(contents, RECOVERY_RECORD),
        "parameters": find_parameters(contents),
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
    }
