"""`impact-rig info`: what a recording holds, at a glance, and whether it is sound."""

from collections import Counter
from datetime import datetime
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli.contents import (
    contents_to_json,
    count_reasons,
    describe_losses,
    describe_old_calibrations,
    describe_recovery,
    describe_verdict,
    inspect_with_progress,
    print_incomplete_hits,
    print_topics,
    read_fields,
    read_sensors,
    read_versions,
)
from impact_rig.cli.each_file import print_json, process_each, raise_errors
from impact_rig.core.records import join_origins
from impact_rig.present.terminal.console import ALARM, GOOD, make_console, print_facts, print_table
from impact_rig.recordings.attachments import extract_attachments
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD
from impact_rig.recordings.source import find_recordings
from impact_rig.recordings.writer import HEALTH_RECORD
from impact_rig.results.numbers import format_count
from impact_rig.results.tables import Column


def _list_facts(contents: Contents) -> list[tuple[str, str]]:
    facts = [("recording", _describe_file(contents))]
    if contents.messages:
        duration = (contents.end_time - contents.start_time) * 1e-9
        facts.append(("when", f"{_format_time(contents.start_time)}, {duration:.1f} s"))
    if campaigns := {(hit.rig, hit.campaign) for hit in contents.hits}:
        rigs = dict.fromkeys(str(getattr(setup, "name", "")) for setup in contents.setups.values())
        named = ", ".join(name for name in rigs if name)
        facts.append(("campaigns", f"{len(campaigns)}{f' on {named}' if named else ''}"))
    if contents.hits:
        facts.append(("origin", str(join_origins(hit.origin for hit in contents.hits))))
    facts += [
        ("sensor", f"{sensor.channel}: {sensor.describe()}") for sensor in read_sensors(contents)
    ]
    facts += [
        ("stream", f"{topic}, {stream.points} points of each channel")
        for topic, stream in contents.streams.items()
    ]
    facts.append(("losses", describe_losses(contents) or "none"))
    if recovery := read_fields(contents, RECOVERY_RECORD):
        facts.append(("recovery", describe_recovery(recovery)))
    if reason := read_fields(contents, HEALTH_RECORD).get("reason"):
        facts.append(("ended", reason))
    if versions := read_versions(contents):
        facts.append(("versions", ", ".join(f"{name} {text}" for name, text in versions.items())))
    return facts + _list_additions(contents)


def _list_additions(contents: Contents) -> list[tuple[str, str]]:
    """Return what is in it beside the messages, and what operators had to say."""
    facts = []
    if parameters := read_fields(contents, PARAMETERS_RECORD):
        number = sum(len(text.splitlines()) for text in parameters.values())
        facts.append(("parameters", f"{number} of {len(parameters)} nodes (--json)"))
    facts += [
        ("attachment", f"{item.name}, {item.media_type}, {item.size} byte (--extract FOLDER)")
        for item in contents.attachments
    ]
    if notes := read_fields(contents, PROVENANCE_RECORD).get("notes"):
        facts.append(("notes", notes))
    return facts + [("note", f"{_format_time(note.time)}: {note.text}") for note in contents.notes]


def _describe_file(contents: Contents) -> str:
    kinds = ", ".join(contents.compression) or "none"
    parts = [
        str(contents.path),
        f"{contents.size / 1e6:.4g} MB",
        f"{format_count(contents.chunks, 'chunk')} ({kinds})",
    ]
    if contents.library:
        parts.append(f"by {contents.library}")
    return ", ".join(parts)


def _format_time(nanoseconds: int) -> str:
    try:
        moment = datetime.fromtimestamp(nanoseconds * 1e-9).astimezone()
    except (OverflowError, OSError, ValueError):
        return f"{nanoseconds} ns"
    return f"{moment:%Y-%m-%d %H:%M:%S}"


def _print_samples(console: Console, contents: Contents) -> None:
    hits = [(hit.label.sample, hit) for hit in contents.hits if hit.label is not None]
    names = list(dict.fromkeys(name for name, _ in hits))
    if not names:
        return
    verdicts = Counter((name, hit.is_accepted) for name, hit in hits)
    reasons = count_reasons(contents).most_common()
    reasons_given = ", ".join(f"{reason} ({number})" for reason, number in reasons)
    print_table(
        console,
        f"Samples: {len(names)}",
        [
            Column("Sample", names, is_text=True),
            Column("Hits", [str(sum(item == name for item, _ in hits)) for name in names]),
            Column("Accepted", [str(verdicts[name, True]) for name in names]),
            Column(
                "Rejected",
                [str(verdicts[name, False]) for name in names],
                styles=[ALARM if verdicts[name, False] else "" for name in names],
            ),
        ],
        [f"Rejected for {reasons_given}."] if reasons_given else (),
    )


EXIT_DAMAGED = 1
"""The recording can be read, but not all of it is sound."""


def run(files: tuple[Path, ...], extract: Path | None, as_json: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""

    def process(file: Path) -> Contents:
        contents = inspect_with_progress(file)
        if not as_json:
            _print(contents)
        if extract is not None:
            for path in extract_attachments(contents.path, extract):
                click.echo(f"extracted: {path}", err=True)
        return contents

    named, errors = process_each(files, find_recordings)
    parts = [part for run in named for part in run]
    found, unreadable = process_each(parts, process)
    if as_json:
        is_list = len(files) > 1 or len(parts) > 1
        print_json([contents_to_json(contents) for contents in found], is_list=is_list)
    raise_errors([*errors, *unreadable])
    if not all(contents.is_sound for contents in found):
        raise SystemExit(EXIT_DAMAGED)


def _print(contents: Contents) -> None:
    """Print the verdict first, then facts and tables."""
    console = make_console()
    style = GOOD if contents.is_sound else ALARM
    console.print(Text(describe_verdict(contents), style=style))
    console.print()
    print_facts(console, _list_facts(contents))
    _print_samples(console, contents)
    print_incomplete_hits(console, contents)
    print_topics(console, contents)
    for remark in (*contents.remarks, *describe_old_calibrations(contents)):
        console.print(Text.assemble(("warning: ", ALARM), remark))
