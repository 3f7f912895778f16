"""`impact-rig recover`: a good recording of one that was cut off, never closed or damaged."""

from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.contents import (
    contents_to_json,
    describe_hits,
    follow_reading,
    print_hits,
    print_topics,
)
from impact_rig.cli.each_file import print_json, process_each, raise_errors
from impact_rig.core.errors import ParameterError
from impact_rig.present.terminal.console import ALARM, GOOD, make_console
from impact_rig.recordings.contents import Contents
from impact_rig.recordings.recover import PASSES, Recovery, name_output, recover_recording
from impact_rig.recordings.source import find_recording
from impact_rig.results.numbers import format_count


def print_recovery(console: Console, recovery: Recovery) -> None:
    """Print what became of a recording."""
    contents = recovery.contents
    if recovery.output is None:
        console.print(
            Text(f"{contents.path}: nothing is wrong with it: {describe_hits(contents)}")
        )
        return
    console.print(Text(f"{contents.path}: {'; '.join(contents.problems)}", style="bold"))
    console.print(Text(f"saved: {describe_hits(contents)}"))
    saved = f"{format_count(recovery.written, 'message')} in {recovery.output}"
    # A path in two pieces is of no use to anybody.
    console.print(Text(f"       {saved}", style=GOOD), soft_wrap=True)
    unread = sum(file.unread for file in contents.files)
    if recovery.is_complete:
        console.print(Text("lost:  nothing that was in it"))
    else:
        console.print(Text(f"lost:  {_describe_loss(contents, unread)}", style=ALARM))
    console.print()
    print_hits(console, contents)
    print_topics(console, contents)


def recovery_to_json(recovery: Recovery) -> dict[str, Any]:
    """Return what became of a recording as plain values."""
    return {
        "output": None if recovery.output is None else str(recovery.output),
        "complete": recovery.is_complete,
        "messages_written": recovery.written,
        "found": contents_to_json(recovery.contents),
    }


def _describe_loss(contents: Contents, unread: int) -> str:
    parts = [f"{unread} byte could not be read"] if unread else []
    if contents.lost:
        parts.append(f"at least {format_count(contents.lost, 'message')}")
    if contents.missing_files:
        parts.append(f"what was in {', '.join(contents.missing_files)}")
    return ", ".join(parts)


EXIT_INCOMPLETE = 1
"""A recording was written, but not all that was in the damaged one is in it."""


@click.command(
    "recover",
    epilog="""
    \b
    Examples:
      impact-rig recover session.mcap                makes session.recovered.mcap
      impact-rig recover session.mcap -o good.mcap
      impact-rig recover runs/*/session.mcap --json
    What no checksum vouches for is left out, and counted: the messages of a chunk that is cut off
    or was altered.
    Exit code: 0 if nothing was wrong, or everything that was in the file is in the new one;
    1 if a recording was written, but something is lost or left out; 2 if nothing could be
    recovered.
    """,
)
@options.files_argument
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="The new recording, of one FILE. [NAME.recovered.mcap beside it]",
)
@options.json_option
def command(files: tuple[Path, ...], output: Path | None, as_json: bool) -> None:
    """Make a good recording of one that was killed, cut off or damaged.

    The new one has everything that is sound: topics, messages with their times and numbers,
    metadata and attachments, and the index that other tools look for. It says what was lost, by
    topic and by hit. FILE is an .mcap file, a folder as rosbag2 writes it, or the folder of a run;
    it is only read, and nothing is overwritten. No ROS is needed.
    """
    if output is not None and len(files) > 1:
        raise ParameterError(f"--output {output} is for one FILE, and {len(files)} are given")
    console = make_console()

    def process(path: Path) -> Recovery:
        found = find_recording(path)
        with follow_reading(f"recovering {path}", found, PASSES) as bar:
            recovery = recover_recording(found, output or name_output(found), report=bar.report)
        if not as_json:
            print_recovery(console, recovery)
        return recovery

    found, errors = process_each(files, process)
    if as_json:
        print_json([recovery_to_json(recovery) for recovery in found], is_list=len(files) > 1)
    raise_errors(errors)
    if not all(recovery.is_complete for recovery in found):
        raise SystemExit(EXIT_INCOMPLETE)
