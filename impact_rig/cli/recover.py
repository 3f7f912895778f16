"""`impact-rig recover`: a good recording of one that was cut off, never closed or damaged."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from impact_rig.cli.recordings.each_file import process_each, raise_errors
from impact_rig.core.errors import ParameterError

if TYPE_CHECKING:
    from impact_rig.recording.recovery.recovery import Recovery

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
    or was altered. --keep-unverified takes those that still fit their type, and the new recording
    lists them.
    Exit code: 0 if nothing was wrong, or everything that was in the file is in the new one;
    1 if a recording was written, but something is lost or left out; 2 if nothing could be
    recovered.
    """,
)
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="The new recording, of one FILE. [NAME.recovered.mcap beside it]",
)
@click.option(
    "--keep-unverified",
    is_flag=True,
    help="Keep messages that fit their type although no checksum vouches for them.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
def command(
    files: tuple[Path, ...], output: Path | None, keep_unverified: bool, as_json: bool
) -> None:
    """Make a good recording of one that was killed, cut off or damaged.

    The new one has everything that is sound: topics, messages with their times and numbers,
    metadata and attachments, and the index that other tools look for. It says what was lost, by
    topic and by hit. FILE is an .mcap file, a folder as rosbag2 writes it, or the folder of a run;
    it is only read, and nothing is overwritten. No ROS is needed.
    """
    from impact_rig.cli.recordings.recovery_view import print_recovery, recovery_to_json
    from impact_rig.reporting.terminal.console import make_console
    from impact_rig.results.results_file import format_json

    if output is not None and len(files) > 1:
        raise ParameterError(f"--output {output} is for one FILE, and {len(files)} are given")
    console = make_console()

    def process(file: Path) -> "Recovery":
        recovery = _recover(file, output, keep_unverified=keep_unverified)
        if not as_json:
            print_recovery(console, recovery)
        return recovery

    found, errors = process_each(files, process)
    if as_json and found:
        items = [recovery_to_json(recovery) for recovery in found]
        click.echo(format_json(items[0] if len(files) == 1 else items), nl=False)
    raise_errors(errors)
    if not all(recovery.is_complete for recovery in found):
        raise SystemExit(EXIT_INCOMPLETE)


def _recover(path: Path, output: Path | None, *, keep_unverified: bool) -> "Recovery":
    from impact_rig.cli.recordings.reading_progress import ReadingProgress, measure
    from impact_rig.recording.reading.source import find_recording
    from impact_rig.recording.recovery.recovery import PASSES, name_output, recover_recording
    from impact_rig.reporting.terminal.console import make_console

    found = find_recording(path)
    target = output or name_output(found)
    total = PASSES * measure(found)
    with ReadingProgress(make_console(stderr=True), f"recovering {path}", total) as bar:
        return recover_recording(found, target, keep_unverified=keep_unverified, report=bar.report)
