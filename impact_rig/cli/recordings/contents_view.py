"""What `impact-rig info` prints of a recording."""

from collections import Counter
from datetime import datetime

from rich.console import Console
from rich.table import Table
from rich.text import Text

from impact_rig.cli.recordings.contents_report import (
    count,
    count_reasons,
    describe_losses,
    describe_recovery,
    describe_verdict,
    find_fields,
    find_health,
    find_interface_differences,
    find_parameters,
    find_versions,
)
from impact_rig.cli.recordings.recorded_sensors import find_sensor_warnings, list_sensors
from impact_rig.core.hits.overrule import describe_label
from impact_rig.recording.recovery.contents import RECOVERY_RECORD, Contents
from impact_rig.recording.recovery.recorded_hits import HitState, RecordedHit
from impact_rig.recording.writing.origin import ORIGIN_RECORD
from impact_rig.reporting.terminal.columns import Column, make_optional
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table
from impact_rig.results.numbers import MISSING, format_number

MOST_HITS = 20
"""How many damaged or lost hits are named, our choice: JSON has them all."""


def print_contents(console: Console, contents: Contents) -> None:
    """Print what a recording holds: the verdict first, then facts and tables."""
    style = GOOD if contents.is_sound else ALARM
    console.print(Text(describe_verdict(contents), style=style))
    console.print()
    _print_facts(console, contents)
    _print_samples(console, contents)
    print_incomplete_hits(console, contents)
    print_topics(console, contents)
    for remark in (*contents.remarks, *find_sensor_warnings(contents)):
        console.print(Text.assemble(("warning: ", ALARM), remark))


def print_parameters(console: Console, contents: Contents) -> None:
    """Print the parameters of all nodes."""
    for node, text in find_parameters(contents).items():
        console.print(Text(node, style="bold"))
        console.print(Text(text.rstrip()))
        console.print()


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
    for place, header, numbers in (
        (2, "Lost", [topic.lost for topic in topics]),
        (2, "Unverified", [topic.unverified for topic in topics]),
    ):
        if any(numbers):
            cells = [str(number) for number in numbers]
            styles = [ALARM if number else "" for number in numbers]
            columns.insert(place, Column(header, cells, styles=styles))
    print_table(console, f"Topics: {len(topics)}", columns)


def print_incomplete_hits(console: Console, contents: Contents) -> None:
    """Print the hits of which something is missing."""
    hits = [hit for hit in contents.hits if hit.state is not HitState.SAVED]
    if not hits:
        return
    shown = hits[:MOST_HITS]
    notes = [f"And {len(hits) - MOST_HITS} more: --json names them all."]
    print_table(
        console,
        f"Hits damaged or lost: {len(hits)}",
        [
            Column("Hit", [_name_hit(hit) for hit in shown], is_text=True),
            Column(
                "State",
                [hit.state.value for hit in shown],
                is_text=True,
                styles=[ALARM] * len(shown),
            ),
            Column("Why", [hit.reason for hit in shown], is_text=True),
        ],
        notes if len(hits) > MOST_HITS else (),
    )


def _name_hit(hit: RecordedHit) -> str:
    return str(hit.record) if hit.label is None else describe_label(hit.label)


def _print_facts(console: Console, contents: Contents) -> None:
    table = Table.grid(padding=(0, 2, 0, 0))
    for name, text in _list_facts(contents):
        table.add_row(Text(name), Text(text, overflow="fold"))
    console.print(table)
    console.print()


def _list_facts(contents: Contents) -> list[tuple[str, str]]:
    facts = [("recording", _describe_files(contents))]
    if contents.messages:
        facts.append(("when", _describe_time(contents)))
    if campaigns := {(hit.rig, hit.campaign) for hit in contents.hits}:
        rigs = dict.fromkeys(str(getattr(setup, "name", "")) for setup in contents.setups)
        named = ", ".join(name for name in rigs if name)
        facts.append(("campaigns", f"{len(campaigns)}{f' on {named}' if named else ''}"))
    facts += [("sensor", text) for text in list_sensors(contents)]
    facts += [
        ("stream", f"{stream.topic}, {stream.points} points of each channel")
        for stream in contents.streams
    ]
    facts.append(("losses", describe_losses(contents) or "none"))
    if recovery := find_fields(contents, RECOVERY_RECORD):
        facts.append(("recovery", describe_recovery(recovery)))
    if reason := find_health(contents).get("reason"):
        facts.append(("ended", reason))
    return facts + _list_origins(contents) + _list_additions(contents)


def _list_origins(contents: Contents) -> list[tuple[str, str]]:
    """Return with what it was recorded, and whether that is understood here."""
    facts = []
    if versions := find_versions(contents):
        facts.append(("versions", ", ".join(f"{name} {text}" for name, text in versions.items())))
    differences = find_interface_differences(contents)
    if differences is None:
        facts.append(("interfaces", "not compared: the rig's ROS 2 interfaces are not installed"))
    elif differences:
        facts += [("interfaces", text) for text in differences]
    elif contents.hits:
        facts.append(("interfaces", "as installed"))
    return facts


def _list_additions(contents: Contents) -> list[tuple[str, str]]:
    """Return what is in it beside the messages, and what operators had to say."""
    facts = []
    if parameters := find_parameters(contents):
        number = sum(len(text.splitlines()) for text in parameters.values())
        facts.append(("parameters", f"{number} of {len(parameters)} nodes (--parameters)"))
    facts += [
        ("attachment", f"{item.name}, {item.media_type}, {item.size} byte (--extract FOLDER)")
        for item in contents.attachments
    ]
    if notes := find_fields(contents, ORIGIN_RECORD).get("notes"):
        facts.append(("notes", notes))
    return facts + [("note", f"{_format_time(note.time)}: {note.text}") for note in contents.notes]


def _describe_files(contents: Contents) -> str:
    size = sum(file.size for file in contents.files)
    kinds = dict.fromkeys(kind for file in contents.files for kind in file.compression)
    chunks = sum(file.chunks for file in contents.files)
    libraries = dict.fromkeys(file.library for file in contents.files if file.library)
    parts = [str(contents.path)]
    if len(contents.files) > 1:
        parts.append(count(len(contents.files), "file"))
    parts += [f"{size / 1e6:.4g} MB", f"{count(chunks, 'chunk')} ({', '.join(kinds) or 'none'})"]
    if libraries:
        parts.append(f"by {', '.join(libraries)}")
    return ", ".join(parts)


def _describe_time(contents: Contents) -> str:
    duration = (contents.end_time - contents.start_time) * 1e-9
    return f"{_format_time(contents.start_time)}, {duration:.1f} s"


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
        [f"Rejected for {_describe_reasons(contents)}."] if count_reasons(contents) else (),
    )


def _describe_reasons(contents: Contents) -> str:
    return ", ".join(
        f"{reason} ({number})" for reason, number in count_reasons(contents).most_common()
    )
