"""`impact-rig info`: what a recording holds, at a glance, and whether it is sound."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from impact_rig.cli.recordings.each_file import process_each, raise_errors

if TYPE_CHECKING:
    from impact_rig.recording.recovery.contents import Contents

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
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option("--parameters", is_flag=True, help="Print the parameters of all nodes, too.")
@click.option(
    "--extract",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write the files that are attached to the recordings into a folder.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
def command(
    files: tuple[Path, ...], parameters: bool, extract: Path | None, as_json: bool
) -> None:
    """See what a recording holds, and whether it is sound.

    Reads all of it and checks every checksum: samples, hits and verdicts, topics, gaps and losses,
    versions, notes and attachments. FILE is an .mcap file, a folder as rosbag2 writes it, or the
    folder of a run; recordings of other ROS 2 systems are shown topic by topic. No ROS is needed.
    """
    from impact_rig.cli.recordings.contents_report import contents_to_json
    from impact_rig.cli.recordings.reading_progress import inspect_with_progress
    from impact_rig.results.results_file import format_json

    def process(file: Path) -> "Contents":
        contents = inspect_with_progress(file)
        if not as_json:
            _print(contents, parameters=parameters)
        if extract is not None:
            _extract(contents, extract)
        return contents

    found, errors = process_each(files, process)
    if as_json and found:
        items = [contents_to_json(contents) for contents in found]
        click.echo(format_json(items[0] if len(files) == 1 else items), nl=False)
    raise_errors(errors)
    if not all(contents.is_sound for contents in found):
        raise SystemExit(EXIT_DAMAGED)


def _print(contents: "Contents", *, parameters: bool) -> None:
    from impact_rig.cli.recordings.contents_view import print_contents, print_parameters
    from impact_rig.reporting.terminal.console import make_console

    console = make_console()
    print_contents(console, contents)
    if parameters:
        print_parameters(console, contents)


def _extract(contents: "Contents", folder: Path) -> None:
    from impact_rig.recording.recovery.attached_files import extract_attachments

    for path in extract_attachments(contents.path, folder):
        click.echo(f"extracted: {path}", err=True)
