"""`impact-rig info`: what a recording holds, at a glance, and whether it is sound."""

from collections import Counter
from datetime import datetime
from pathlib import Path

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.contents import (
    contents_to_json,
    count_reasons,
    describe_interface_differences,
    describe_losses,
    describe_old_calibrations,
    describe_recovery,
    describe_verdict,
    inspect_with_progress,
    print_hits,
    print_topics,
    read_fields,
    read_sensors,
    read_versions,
)
from impact_rig.cli.each_file import print_json, process_each, raise_errors
from impact_rig.core.origin import join_origins
from impact_rig.present.terminal.console import ALARM, GOOD, make_console, print_facts, print_table
from impact_rig.recordings.contents import RECOVERY_RECORD, Contents
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD
from impact_rig.recordings.recover import extract_attachments
from impact_rig.recordings.writer import HEALTH_RECORD
from impact_rig.results.numbers import format_count
from impact_rig.results.tables import Column


def _list_facts(contents: Contents) -> list[tuple[str, str]]:
    facts = [("recording", _describe_files(contents))]
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
    return facts + _list_origins(contents) + _list_additions(contents)


def _list_origins(contents: Contents) -> list[tuple[str, str]]:
    """Return with what it was recorded, and whether that is understood here."""
    facts = []
    if versions := read_versions(contents):
        facts.append(("versions", ", ".join(f"{name} {text}" for name, text in versions.items())))
    differences = describe_interface_differences(contents)
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
    if parameters := read_fields(contents, PARAMETERS_RECORD):
        number = sum(len(text.splitlines()) for text in parameters.values())
        facts.append(("parameters", f"{number} of {len(parameters)} nodes (--parameters)"))
    facts += [
        ("attachment", f"{item.name}, {item.media_type}, {item.size} byte (--extract FOLDER)")
        for item in contents.attachments
    ]
    if notes := read_fields(contents, PROVENANCE_RECORD).get("notes"):
        facts.append(("notes", notes))
    return facts + [("note", f"{_format_time(note.time)}: {note.text}") for note in contents.notes]


def _describe_files(contents: Contents) -> str:
    size = sum(file.size for file in contents.files)
    kinds = dict.fromkeys(kind for file in contents.files for kind in file.compression)
    chunks = sum(file.chunks for file in contents.files)
    libraries = dict.fromkeys(file.library for file in contents.files if file.library)
    parts = [str(contents.path)]
    if len(contents.files) > 1:
        parts.append(format_count(len(contents.files), "file"))
    parts += [
        f"{size / 1e6:.4g} MB",
        f"{format_count(chunks, 'chunk')} ({', '.join(kinds) or 'none'})",
    ]
    if libraries:
        parts.append(f"by {', '.join(libraries)}")
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
    told = ", ".join(f"{reason} ({number})" for reason, number in reasons)
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
        [f"Rejected for {told}."] if told else (),
    )


EXIT_DAMAGED = 1
"""The recording can be read, but not all of it is sound."""


@click.command(
    "info",
    epilog="""
    \b
    Examples:
      impact-rig info session.mcap
      impact-rig info runs/*/session.mcap --json
      impact-rig info session.mcap --extract rig_files
    Exit code: 0 if every recording is sound, 1 if one is damaged or was never closed,
    2 if one cannot be read at all.
    """,
)
@options.files_argument
@click.option("--parameters", is_flag=True, help="Print the parameters of all nodes, too.")
@click.option(
    "--extract",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write the files that are attached to the recordings into a folder.",
)
@options.json_option
def command(
    files: tuple[Path, ...], parameters: bool, extract: Path | None, as_json: bool
) -> None:
    """See what a recording holds, and whether it is sound.

    Reads all of it and checks every checksum: samples, hits and verdicts, topics, gaps and losses,
    versions, notes and attachments. FILE is an .mcap file, a folder as rosbag2 writes it, or the
    folder of a run; recordings of other ROS 2 systems are shown topic by topic. No ROS is needed.
    """

    def process(file: Path) -> Contents:
        contents = inspect_with_progress(file)
        if not as_json:
            _print(contents, parameters=parameters)
        if extract is not None:
            for path in extract_attachments(contents.path, extract):
                click.echo(f"extracted: {path}", err=True)
        return contents

    found, errors = process_each(files, process)
    if as_json:
        print_json([contents_to_json(contents) for contents in found], is_list=len(files) > 1)
    raise_errors(errors)
    if not all(contents.is_sound for contents in found):
        raise SystemExit(EXIT_DAMAGED)


def _print(contents: Contents, *, parameters: bool) -> None:
    """Print the verdict first, then facts and tables."""
    console = make_console()
    style = GOOD if contents.is_sound else ALARM
    console.print(Text(describe_verdict(contents), style=style))
    console.print()
    print_facts(console, _list_facts(contents))
    _print_samples(console, contents)
    print_hits(console, contents)
    print_topics(console, contents)
    for remark in (*contents.remarks, *describe_old_calibrations(contents)):
        console.print(Text.assemble(("warning: ", ALARM), remark))
    for node, text in read_fields(contents, PARAMETERS_RECORD).items() if parameters else ():
        console.print(Text(node, style="bold"))
        console.print(Text(text.rstrip()))
        console.print()
