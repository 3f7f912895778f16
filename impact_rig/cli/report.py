"""`impact-rig report`: a run as one HTML file."""

from dataclasses import replace
from pathlib import Path

import click

from impact_rig.analysis.sources import find_run, read_runs
from impact_rig.cli.info import (
    describe_end,
    describe_losses,
    inspect_with_progress,
    read_fields,
    read_versions,
)
from impact_rig.cli.output import show_progress
from impact_rig.configuration.processes import REPORT_NAME
from impact_rig.core.errors import FileError
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import make_report
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD, compute_sha256
from impact_rig.recordings.run import Run
from impact_rig.results.traces import Provenance, RecordedFile


def read_provenance(recorded: Run) -> Provenance:
    """Read all of a run, checksums included.

    Raises
    ------
    FileError
        If a file cannot be read.
    """
    contents = inspect_with_progress(recorded)
    notes = [(note.time, note.text) for note in contents.notes]
    if first := read_fields(contents, PROVENANCE_RECORD).get("notes", ""):
        notes.insert(0, (0, first))
    return Provenance(
        start_time=contents.start_time,
        end_time=contents.end_time,
        files=tuple(
            RecordedFile(scan.path.name, scan.size, compute_sha256(scan.path))
            for scan in contents.scans
        ),
        problems=contents.problems,
        losses=describe_losses(contents),
        ended=describe_end(contents),
        versions=tuple(read_versions(contents).items()),
        parameters=tuple(sorted(read_fields(contents, PARAMETERS_RECORD).items())),
        notes=tuple(notes),
    )


def run(path: Path, output: Path | None, namespace: str | None) -> None:
    """Run the command; its options are declared in `commands.py`."""
    source = find_run(path, namespace)
    output = output or source.folder / REPORT_NAME
    if output.exists():
        raise FileError(f"{output} exists already: name another file with -o")
    with show_progress() as follow:
        follow(f"reading {source.named}", 0)
        runs = read_runs(source)
        if source.run is not None and runs[0].campaign.hits:
            provenance = read_provenance(source.run)
            runs = tuple(replace(run, provenance=provenance) for run in runs)
        document = make_report(runs, lambda done: follow("drawing", done, len(runs)))
    with write_new_file(output) as part:
        part.write_text(render_page(document), encoding="utf-8")
    click.echo(f"report: {output}", err=True)
