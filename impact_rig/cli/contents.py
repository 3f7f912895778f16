"""What a recording holds, in words."""

import contextlib
import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from impact_rig.cli.progress import show_progress
from impact_rig.core.errors import RigError
from impact_rig.core.sensors import Sensor
from impact_rig.recordings.contents import Contents, inspect_recording
from impact_rig.recordings.hits import HitState
from impact_rig.recordings.messages import setup_from_msg
from impact_rig.recordings.provenance import PROVENANCE_RECORD
from impact_rig.recordings.source import find_recording
from impact_rig.results.numbers import format_count


def read_sensors(contents: Contents) -> tuple[Sensor, ...]:
    """Return the sensors of all set-ups of a recording, each once."""
    found: list[Sensor] = []
    for message in contents.setups.values():
        # `analyze` reports errors of a set-up.
        with contextlib.suppress(RigError, AttributeError, TypeError):
            found += setup_from_msg(message).sensors
    # By their words: a sensitivity that is not known (NaN) is not equal to itself.
    return tuple({(item.channel, item.describe()): item for item in found}.values())


def list_old_calibrations(contents: Contents) -> list[str]:
    """Return which calibrations were too old on the day of the recording."""
    try:
        day = datetime.fromtimestamp(contents.start_time * 1e-9, tz=UTC).date().isoformat()
    except (OverflowError, OSError, ValueError):
        return []
    found = [sensor.describe_age(day) for sensor in read_sensors(contents)]
    return [text for text in found if text]


def describe_hits(contents: Contents) -> str:
    """Return the number of samples, hits and verdicts; without hits that of messages."""
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


def describe_losses(contents: Contents) -> str:
    """Return in words what was lost while recording."""
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


def read_fields(contents: Contents, name: str) -> dict[str, str]:
    """Return the last metadata record of a name; empty without one."""
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


def inspect_with_progress(path: Path) -> Contents:
    """Read all of the recording that a path means, under a bar; errors as `inspect_recording`."""
    found = find_recording(path)
    with show_progress() as follow:
        stage, size = f"reading {path}", found.stat().st_size
        return inspect_recording(found, report=lambda done: follow(stage, done, size))
