"""`impact-rig report`: one run, or several compared, in a file to hand over."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from impact_rig.analysis.repeated_files import find_repeated_files
from impact_rig.analysis.report_sources import RunSource, find_run, name_sources, read_runs
from impact_rig.cli.contents import (
    describe_losses,
    inspect_with_progress,
    read_fields,
    read_versions,
)
from impact_rig.cli.each_file import process_each, raise_errors
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.present.report.document import Document
from impact_rig.present.report.page import render_page
from impact_rig.present.report.pdf import find_browser, print_pdf
from impact_rig.present.report.report import make_report
from impact_rig.present.terminal.console import make_console
from impact_rig.recordings.contents import Contents
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD, compute_sha256
from impact_rig.recordings.writer import HEALTH_RECORD
from impact_rig.results.run import Note, Provenance, RecordedFile, Run


def read_provenance(path: Path) -> Provenance:
    """Read all of a recording, checksums included.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    contents = inspect_with_progress(path)
    return Provenance(
        start_time=contents.start_time,
        end_time=contents.end_time,
        files=tuple(
            RecordedFile(file.path.name, file.size, compute_sha256(file.path))
            for file in contents.files
        ),
        problems=contents.problems,
        losses=describe_losses(contents),
        ended=read_fields(contents, HEALTH_RECORD).get("reason", ""),
        versions=tuple(read_versions(contents).items()),
        parameters=tuple(sorted(read_fields(contents, PARAMETERS_RECORD).items())),
        notes=_gather_notes(contents),
    )


def _gather_notes(contents: Contents) -> tuple[Note, ...]:
    first = read_fields(contents, PROVENANCE_RECORD).get("notes", "")
    notes = (Note(0, first),) if first else ()
    return notes + tuple(Note(note.time, note.text) for note in contents.notes)


DEFAULT_NAME = "report.html"
PDF_SUFFIX = ".pdf"


@click.command(
    "report",
    epilog="""
    \b
    Examples:
      impact-rig report runs/2025-01-31T12-00-00
      impact-rig report session.mcap -o steel.html --pdf
      impact-rig report runs/before runs/after -o change.html
    Exit code: 2 if a run could not be read or no PDF be made, which the others and the HTML do
    not suffer from. Nothing is overwritten.
    """,
)
@click.argument(
    "paths", nargs=-1, required=True, metavar="RUN...", type=click.Path(path_type=Path)
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The HTML file. [report.html: of one run in its folder, of several in this one]",
)
@click.option("--pdf", is_flag=True, help="Print it as well, beside the HTML; needs Chromium.")
@click.option(
    "--simulators",
    is_flag=True,
    help="With a chapter on simulators: parameters of every contact, and what those that are"
    " installed make of the control sample.",
)
def command(paths: tuple[Path, ...], output: Path | None, pdf: bool, simulators: bool) -> None:
    """Write a report: one HTML file that needs nothing else, and a PDF.

    What was measured and with what, tables with uncertainties and budgets, the paper's figures,
    traces with models and residuals, hits left out and why. Several runs are compared first: what
    changed beyond its uncertainty. RUN is a recording, the folder of a run, or a results.json,
    which has no traces. No ROS is needed.
    """
    sources, errors = _find_sources(paths)
    if not sources:
        raise_errors(errors)
    folder = sources[0].folder if len(sources) == 1 else Path()
    path = output or folder / DEFAULT_NAME
    _check_targets(path, with_pdf=pdf)
    named = list(zip(sources, name_sources(sources), strict=True))
    read, more = process_each(named, lambda item: _read(*item))
    errors += more
    if read:
        runs = [run for found in read for run in found]
        with ProgressBar(make_console(stderr=True), "drawing", total=len(runs)) as bar:
            document = make_report(runs, errors, bar.report, with_simulators=simulators)
        with write_new_file(path) as part:
            part.write_text(render_page(document), encoding="utf-8")
        click.echo(f"report: {path}", err=True)
        errors += _write_pdf(document, path.with_suffix(PDF_SUFFIX)) if pdf else []
    raise_errors(errors)


def _find_sources(named: Sequence[Path]) -> tuple[list[RunSource], list[str]]:
    """Return what the paths mean, each run once, and what is wrong with the others."""
    found, errors = process_each(named, find_run)
    repeated = find_repeated_files([source.path for source in found])
    sources = [source for place, source in enumerate(found) if place not in repeated]
    return sources, errors + list(repeated.values())


def _check_targets(path: Path, *, with_pdf: bool) -> None:
    """Refuse what cannot be written, before anything is read."""
    if path.suffix == PDF_SUFFIX:
        raise ParameterError(
            f"{path} is named as a PDF: name the HTML file, --pdf prints it beside that"
        )
    targets = [path, path.with_suffix(PDF_SUFFIX)] if with_pdf else [path]
    for target in targets:
        if target.exists():
            raise FileError(f"{target} exists already: name another file with -o")


def _read(source: RunSource, name: str) -> tuple[Run, ...]:
    with ProgressBar(make_console(stderr=True), f"reading {source.named}"):
        runs = read_runs(source, name)
    if not runs[0].has_traces:
        return runs
    provenance = read_provenance(source.path)
    return tuple(replace(run, provenance=provenance) for run in runs)


def _write_pdf(document: Document, path: Path) -> list[str]:
    """Print the report; return why that was not possible."""
    try:
        browser = find_browser()
        with (
            ProgressBar(make_console(stderr=True), "printing"),
            write_new_file(path) as part,
        ):
            print_pdf(render_page(document, is_unfolded=True), part, browser)
    except RigError as error:
        return [str(error)]
    click.echo(f"report: {path}", err=True)
    return []
