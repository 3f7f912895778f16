"""`impact-rig info`: what a recording holds, at a glance, and whether it is sound."""

import contextlib
import dataclasses
import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli.output import print_json, process_each, raise_errors, show_progress
from impact_rig.core.given.records import join_origins
from impact_rig.core.given.sensors import Sensor
from impact_rig.present.console import (
    ALARM,
    GOOD,
    make_console,
    print_facts,
    print_item,
    print_table,
    print_warning,
)
from impact_rig.recordings.contents import Contents, extract_attachments, inspect_run
from impact_rig.recordings.hits import HitState, RecordedHit
from impact_rig.recordings.messages import CONVERSION_ERRORS, setup_from_msg
from impact_rig.recordings.records import HEALTH_RECORD, PROVENANCE_RECORD, RECOVERY_RECORD
from impact_rig.recordings.run import Run, find_runs
from impact_rig.results.numbers import (
    MISSING,
    format_count,
    format_date,
    format_number,
    format_time,
    is_dated,
)
from impact_rig.results.table import Column, make_optional, make_table, make_text_column
from impact_rig.results.wire import origin_to_json, to_json

MOST_HITS = 20  # named in a terminal; JSON has them all
EXIT_DAMAGED = 1  # the recording can be read, but not all of it is sound


def read_sensors(contents: Contents) -> tuple[Sensor, ...]:
    """Return the sensors of all set-ups of a recording, each once."""
    found: list[Sensor] = []
    for message in contents.setups.values():
        # `analyze` reports errors of a set-up.
        with contextlib.suppress(*CONVERSION_ERRORS):
            found += setup_from_msg(message).sensors
    return tuple(dict.fromkeys(found))


def list_remarks(contents: Contents) -> list[str]:
    """Return hints for the reader, and which calibrations were too old on the day."""
    day = format_time(contents.start_time).partition(" ")[0]
    sensors = read_sensors(contents) if is_dated(contents.start_time) else ()
    twice = f"{format_count(contents.repeated, 'block')} there twice: each is used once"
    return [
        *contents.remarks,
        *[twice] * bool(contents.repeated),
        *filter(None, (sensor.describe_age(day) for sensor in sensors)),
    ]


def describe_hits(contents: Contents) -> str:
    """Count samples, hits and verdicts in words; without hits, messages."""
    if not contents.hits:
        return f"{format_count(contents.messages, 'message')}, no hit"
    saved = [hit for hit in contents.hits if hit.state is HitState.SAVED]
    samples = {hit.label.sample for hit in saved if hit.label is not None}
    outcomes = Counter(map(find_outcome, contents.hits))
    parts = [format_count(len(samples), "sample")]
    if outcomes[ACCEPTED] or outcomes[REJECTED]:
        parts.append(f"{format_count(outcomes[ACCEPTED], 'hit')} {ACCEPTED}")
        parts.append(f"{outcomes[REJECTED]} {REJECTED}")
    if outcomes[OPEN]:
        parts.append(f"{format_count(outcomes[OPEN], 'hit')} {OPEN}")
    states = (state.value for state in HitState if state is not HitState.SAVED)
    return ", ".join([*parts, *(f"{outcomes[it]} {it}" for it in states if outcomes[it])])


UNCODED = "reasons in words"
"""Reasons of older recordings, which have no codes; --json shows them."""
ACCEPTED, REJECTED, OPEN = "accepted", "rejected", "without a verdict"


def find_outcome(hit: RecordedHit) -> str:
    """Return the verdict on a hit or, if it is not saved, its state."""
    if hit.state is not HitState.SAVED:
        return hit.state.value
    return {True: ACCEPTED, False: REJECTED, None: OPEN}[hit.is_accepted]


def describe_losses(contents: Contents) -> str | None:
    """Return in words what was lost while recording; None: nothing."""
    places = {"the blocks": contents.hits, **{k: [it] for k, it in contents.streams.items()}}
    parts = []
    for where, items in places.items():
        if number := sum(item.gaps for item in items):
            points = format_count(sum(item.missing_points for item in items), "point")
            parts.append(f"{format_count(number, 'gap')} of {points} in {where}")
    for number, where in (
        (contents.messages_lost, "on the way to the recorder"),
        (contents.lost, "of the file"),
    ):
        if number:
            parts.append(f"{format_count(number, 'message')} {where}")
    return ", ".join(parts) or None


def read_fields(contents: Contents, name: str) -> dict[str, str]:
    """Return the last metadata record of a name; empty without one."""
    records = [record.fields for record in contents.metadata if record.name == name]
    return records[-1] if records else {}


def describe_end(contents: Contents) -> str | None:
    """Return why the recorder ended; None: it does not say, or its file was not closed."""
    is_closed = contents.scans[-1].is_closed
    return read_fields(contents, HEALTH_RECORD).get("reason") if is_closed else None


def read_versions(contents: Contents) -> dict[str, str]:
    """Return the versions of the software, Python, ROS 2 and libraries that recorded."""
    fields = read_fields(contents, PROVENANCE_RECORD)
    names = {"software_version": "impact_rig", "python": "Python", "ros_distro": "ROS 2"}
    versions = {text: fields[key] for key, text in names.items() if fields.get(key)}
    for setup in contents.setups.values():
        versions.setdefault("impact_rig", str(getattr(setup, "software_version", "")))
    # Recordings of another origin may have anything there.
    with contextlib.suppress(KeyError, ValueError, AttributeError, RecursionError):
        versions |= {str(key): str(text) for key, text in json.loads(fields["libraries"]).items()}
    return {name: text for name, text in versions.items() if text}


def inspect_with_progress(run: Run) -> Contents:
    """Read a run, with a progress bar; errors as `inspect_run`."""
    with show_progress() as follow:
        stage = f"reading {run.path}"
        return inspect_run(run, report=lambda done: follow(stage, done, run.size))


def describe_verdict(contents: Contents) -> str:
    """Return in one sentence what a recording holds, or how it is damaged."""
    found = describe_hits(contents)
    if contents.years_apart is not None:
        apart = f"its messages are {contents.years_apart:.0f} years apart"
        found += f"; its times are wrong: {apart}, which no clock counted"
    if contents.problems:
        return (
            f"damaged: {'; '.join(contents.problems)}. Left of it: {found}."
            f" `impact-rig export {contents.run.path} -o sound.mcap` saves that"
        )
    if contents.is_live:
        return f"live, it is being recorded; so far: {found}"
    if recovery := read_fields(contents, RECOVERY_RECORD):
        found += f"; recovered from {recovery['recovered_from']}: {recovery['problems']}"
    return f"sound: {found}"


def contents_to_json(contents: Contents) -> dict[str, Any]:
    """Return a recording's content as plain values."""
    return {
        "path": str(contents.run.path),
        "sound": contents.is_sound,
        "live": contents.is_live,
        "verdict": describe_verdict(contents),
        "problems": contents.problems,
        "remarks": list_remarks(contents),
        "start_time_ns": contents.start_time,
        "end_time_ns": contents.end_time,
        "messages": contents.messages,
        "messages_lost": contents.lost,
        "messages_lost_on_the_way": contents.messages_lost,
        "hits": [{**dataclasses.asdict(hit), "state": hit.state.value} for hit in contents.hits],
        **origin_to_json(join_origins(hit.origin for hit in contents.hits)),
        "streams": {
            topic: dataclasses.asdict(stream) for topic, stream in contents.streams.items()
        },
        "topics": [
            {**vars(topic), "rate_hz": topic.rate if math.isfinite(topic.rate) else None}
            for topic in contents.topics.values()
        ],
        "files": [
            {
                "path": str(reading.scan.path),
                "size_bytes": reading.scan.size,
                "closed": reading.scan.is_closed,
                "has_index": reading.scan.summary is not None,
                "unread_bytes": sum(damage.size for damage in reading.damages),
            }
            for reading in contents.passes
        ],
        "sensors": [to_json(sensor) for sensor in read_sensors(contents)],
        "versions": read_versions(contents),
        "metadata": {record.name: record.fields for record in contents.metadata},
        "notes": [vars(note) for note in contents.notes],
        "attachments": [
            {"name": item.name, "media_type": item.media_type, "size": len(item.data)}
            for item in contents.attachments
        ],
    }


def _list_facts(contents: Contents) -> list[tuple[str, str]]:
    duration = (contents.end_time - contents.start_time) * 1e-9
    period = f", {duration:.1f} s" if contents.years_apart is None else ""
    origin = join_origins(hit.origin for hit in contents.hits)
    start = format_date(contents.start_time, origin)
    notes = read_fields(contents, PROVENANCE_RECORD).get("notes", "")
    facts = [
        *(("recording", f"{scan.path}, {scan.size / 1e6:.4g} MB") for scan in contents.scans),
        ("when", f"{start}{period}" if start else "not known"),
        ("campaigns", str(len({(hit.rig, hit.campaign) for hit in contents.hits}) or "")),
        ("origin", str(origin) * bool(contents.hits)),
        *(("sensor", f"{item.channel}: {item.describe()}") for item in read_sensors(contents)),
        *(
            ("stream", f"{topic}, {stream.points} points of each channel")
            for topic, stream in contents.streams.items()
        ),
        ("losses", describe_losses(contents) or "none"),
        ("ended", describe_end(contents) or ""),
        ("versions", ", ".join(map(" ".join, read_versions(contents).items()))),
        *(
            ("attachment", f"{name}, {kind}, {len(data)} byte (--extract FOLDER)")
            for name, kind, _, data in contents.attachments
        ),
        ("notes", notes),
        *(("note", f"{format_time(note.time)}: {note.text}") for note in contents.notes),
    ]
    # Each fact is a line, whatever was typed as a note.
    return [(name, " ".join(text.split())) for name, text in facts if text]


def _print_samples(console: Console, contents: Contents) -> None:
    hits = [(hit.label.sample, find_outcome(hit)) for hit in contents.hits if hit.label]
    names = list(dict.fromkeys(name for name, _ in hits))
    if not names:
        return
    outcomes = Counter(hits)
    # A hit may have several reasons.
    reasons = Counter(it.reason or UNCODED for hit in contents.hits for it in hit.rejections)
    given = ", ".join(f"{reason} ({number})" for reason, number in reasons.most_common())
    columns = [
        make_text_column("Sample", names),
        Column("Hits", [str(sum(item == name for item, _ in hits)) for name in names]),
        Column("Accepted", [str(outcomes[name, ACCEPTED]) for name in names]),
        Column("Rejected", [str(outcomes[name, REJECTED]) for name in names]),
        *(
            make_optional(outcome.capitalize(), [str(outcomes[name, outcome]) for name in names])
            for outcome in dict.fromkeys(outcome for _, outcome in hits)
            if outcome not in (ACCEPTED, REJECTED)
        ),
    ]
    notes = [f"Rejected for {given}."] if given else []
    marked = [place for place, name in enumerate(names) if outcomes[name, REJECTED]]
    print_table(console, make_table(f"Samples: {len(names)}", columns, notes, marked))


def _print_topics(console: Console, contents: Contents) -> None:
    """Print the topics with their messages, found and lost."""
    topics = list(contents.topics.values())
    if not topics:
        return
    columns = [
        make_text_column("Topic", [topic.name for topic in topics]),
        Column("Messages", [str(topic.messages) for topic in topics]),
        Column("Lost", [str(topic.lost or "") for topic in topics]),
        make_optional("Hz", [format_number(topic.rate, 1) for topic in topics]),
        make_text_column("Type", [topic.type_name or MISSING for topic in topics]),
    ]
    marked = [place for place, topic in enumerate(topics) if topic.lost]
    print_table(console, make_table(f"Topics: {len(topics)}", columns, marked=marked))


def run(
    files: tuple[Path, ...], extract: Path | None, namespace: str | None, as_json: bool
) -> None:
    """Run the command; its options are declared in `commands.py`."""

    def process(run: Run) -> Contents:
        contents = inspect_with_progress(run)
        if not as_json:
            _print(contents)
        if extract is not None:
            for path in extract_attachments(contents, extract):
                click.echo(f"extracted: {path}", err=True)
        return contents

    runs, errors = find_runs(files, namespace)
    found, unreadable = process_each(runs, process)
    if as_json and found:
        print_json(list(map(contents_to_json, found)), is_list=len(files) > 1)
    raise_errors([*errors, *unreadable])
    if not all(contents.is_sound for contents in found):
        raise SystemExit(EXIT_DAMAGED)


def _print(contents: Contents) -> None:
    """Print the verdict first, then facts and tables."""
    console = make_console()
    if (part := contents.run.describe_part()) is not None:
        print_warning(part)
    style = GOOD if contents.is_sound else ALARM
    console.print(Text(describe_verdict(contents), style=style))
    console.print()
    print_facts(console, _list_facts(contents))
    _print_samples(console, contents)
    incomplete = [hit for hit in contents.hits if hit.state is not HitState.SAVED]
    for hit in incomplete[:MOST_HITS]:  # --json names all
        print_item(
            console, f"{hit.label or f'record {hit.record}'}: {hit.state.value}, {hit.reason}"
        )
    _print_topics(console, contents)
    for remark in list_remarks(contents):
        console.print(Text.assemble(("warning: ", ALARM), remark))
