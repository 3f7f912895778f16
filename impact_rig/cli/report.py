"""`impact-rig report`: one run, or several compared, in a file to hand over."""

import hashlib
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
from impact_rig.recordings.provenance import PARAMETERS_RECORD, PROVENANCE_RECORD
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
        files=tuple(_describe_file(file.path) for file in contents.files),
        problems=contents.problems,
        losses=describe_losses(contents),
        ended=read_fields(contents, HEALTH_RECORD).get("reason", ""),
        versions=tuple(read_versions(contents).items()),
        parameters=tuple(sorted(read_fields(contents, PARAMETERS_RECORD).items())),
        notes=_gather_notes(contents),
    )


def _describe_file(path: Path) -> RecordedFile:
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return RecordedFile(path.name, path.stat().st_size, digest)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}") from None


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
@click.argument("runs", nargs=-1, required=True, metavar="RUN...", type=click.Path(path_type=Path))
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
def command(runs: tuple[Path, ...], output: Path | None, pdf: bool, simulators: bool) -> None:
    """Write a report: one HTML file that needs nothing else, and a PDF.

    What was measured and with what, tables with uncertainties and budgets, the paper's figures,
    traces with models and residuals, hits left out and why. Several runs are compared first: what
    changed beyond its uncertainty. RUN is a recording, the folder of a run, or a results.json,
    which has no traces. No ROS is needed.
    """
    sources, errors = _find_sources(runs)
    if not sources:
        raise_errors(errors)
    path = output or _choose_output(sources)
    _check_targets(path, with_pdf=pdf)
    read, more = _read_sources(sources)
    errors += more
    if read:
        document = _make_document(read, errors, with_simulators=simulators)
        _write_page(document, path)
        errors += _write_pdf(document, path.with_suffix(PDF_SUFFIX)) if pdf else []
    raise_errors(errors)


def _find_sources(named: Sequence[Path]) -> tuple[list[RunSource], list[str]]:
    """Return what the paths mean, each run once, and what is wrong with the others."""
    found, errors = process_each(named, find_run)
    repeated = find_repeated_files([source.path for source in found])
    sources = [source for place, source in enumerate(found) if place not in repeated]
    return sources, errors + list(repeated.values())


def _choose_output(sources: Sequence[RunSource]) -> Path:
    return sources[0].folder / DEFAULT_NAME if len(sources) == 1 else Path(DEFAULT_NAME)


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


def _read_sources(sources: Sequence[RunSource]) -> tuple[list[Run], list[str]]:
    names = {
        source.named: name for source, name in zip(sources, name_sources(sources), strict=True)
    }
    by_path = {source.named: source for source in sources}
    read, errors = process_each(list(names), lambda path: _read(by_path[path], names[path]))
    return [run for runs in read for run in runs], errors


def _read(source: RunSource, name: str) -> tuple[Run, ...]:
    with ProgressBar(make_console(stderr=True), f"reading {source.named}"):
        runs = read_runs(source, name)
    if not runs[0].has_traces:
        return runs
    provenance = read_provenance(source.path)
    return tuple(replace(run, provenance=provenance) for run in runs)


def _make_document(
    runs: Sequence[Run], errors: Sequence[str], *, with_simulators: bool
) -> Document:
    with ProgressBar(make_console(stderr=True), "drawing", total=len(runs)) as bar:
        return make_report(
            runs,
            errors,
            bar.report,
            with_simulators=with_simulators,
        )


def _write_page(document: Document, path: Path) -> None:
    with write_new_file(path) as part:
        part.write_text(render_page(document), encoding="utf-8")
    click.echo(f"report: {path}", err=True)


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
