"""`impact-rig report`: a run as one HTML file."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import click

from impact_rig.analysis.sources import ByHand, RunSource, find_run, read_runs
from impact_rig.cli.info import (
    describe_end,
    describe_losses,
    inspect_with_progress,
    read_fields,
    read_versions,
)
from impact_rig.cli.output import show_progress
from impact_rig.configuration.particulars import Particulars, parse_particulars
from impact_rig.configuration.processes import REPORT_NAME
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.records import IMPORTED, MEASURED, join_origins
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import make_report
from impact_rig.present.report.setup import NO_DATE, format_date
from impact_rig.recordings.contents import Contents
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import PROVENANCE_RECORD, compute_sha256
from impact_rig.results.traces import Provenance, RecordedFile, ReportedCampaign

EXIT_LACKING = 1  # the run can be reported, but a formal report would lack something


def make_provenance(contents: Contents) -> Provenance:
    """Return when, by what and how a run was recorded; raises `FileError` on a lost file."""
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
        notes=tuple(notes),
    )


def read_particulars(contents: Contents | None, rig_file: Path | None) -> Particulars:
    """Return what a person states, by a rig file: the one given, else that of the recording."""
    if rig_file is not None:
        return read_rig_file(rig_file).particulars
    for item in contents.attachments if contents is not None else ():
        if item.name.endswith(".toml"):
            try:
                return parse_particulars(parse_toml_table(item.data.decode("utf-8-sig")))
            except (UnicodeDecodeError, ParameterError) as error:
                raise FileError(
                    f"the rig file {item.name} in the recording: {error}: name another one with"
                    " --rig-file"
                ) from None
    return Particulars()


def run(
    path: Path,
    output: Path | None,
    namespace: str | None,
    rig_file: Path | None,
    texts: tuple[str, ...],
    is_check: bool,
    with_printed: bool,
    **by_hand: str | tuple[str, ...],
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    source = find_run(path, namespace)
    output = output or source.folder / REPORT_NAME
    if output.exists() and not is_check:
        raise FileError(f"{output} exists already: name another file with -o")
    asked = ByHand(**by_hand)  # type: ignore[arg-type]  # its fields are the options
    _check_reason(asked, source)
    contents = None
    with show_progress() as follow:
        follow(f"reading {source.named}", 0)
        runs = read_runs(source, asked)
        if source.run is not None and runs[0].campaign.hits:
            contents = inspect_with_progress(source.run)
            provenance = make_provenance(contents)
            runs = tuple(replace(run, provenance=provenance) for run in runs)
        stated = read_particulars(contents, rig_file).set(texts)
        unknown = _find_unknown_items(runs, stated)
        if is_check:
            _print_lacking(runs, stated, unknown)
            return
        document = make_report(
            runs,
            stated,
            lambda done: follow("drawing", done, len(runs)),
            with_printed=with_printed,
        )
    with write_new_file(output) as part:
        part.write_text(render_page(document), encoding="utf-8")
    for text in unknown:
        click.echo(f"warning: {text}", err=True)
    click.echo(f"report: {output}", err=True)


def _check_reason(asked: ByHand, source: RunSource) -> None:
    """Refuse a decision that the report could not explain."""
    if not (asked.accept or asked.reject):
        if asked.reason or asked.who:
            raise ParameterError("--reason and --who belong to --accept or --reject: name a hit")
    elif not asked.reason.strip():
        raise ParameterError('a report says why a person overrules: add --reason "TEXT"')
    elif source.run is None:
        raise ParameterError(f"{source.named} has no traces: --accept and --reject need them")


def _find_unknown_items(runs: Sequence[ReportedCampaign], stated: Particulars) -> tuple[str, ...]:
    """Say of which samples something is stated though no run has them, as by a wrong name."""
    samples = (sample for run in runs for sample in run.campaign.results.setup.samples.samples)
    known = list(dict.fromkeys(sample.body for sample in samples))
    return tuple(
        f"the rig file states facts or limits of {name!r}, and the run has no such sample, so they"
        f" are not in the report: its samples are {', '.join(known)}"
        for name, item in stated.items.items()
        if (item.texts or item.limits) and name not in known
    )


def _print_lacking(
    runs: Sequence[ReportedCampaign], stated: Particulars, unknown: Iterable[str]
) -> None:
    """Print what a formal report would lack; the exit code says whether that is anything."""
    results = [run.campaign.results for run in runs]
    setups = [(item.setup.samples, sample.name) for item in results for sample in item.samples]
    lacking = stated.list_lacking(dict.fromkeys(known.find(name).body for known, name in setups))
    kind = join_origins(item.origin for item in results).kind
    if kind not in (MEASURED, IMPORTED):
        lacking.insert(0, f"Measured hits: these are {kind}")
    if format_date(runs[0].provenance) == NO_DATE:
        lacking.append("Date of the tests (7.8.2.1 i): the recording has none")
    lacking += (text[:1].upper() + text[1:] for text in unknown)
    for text in lacking:
        click.echo(text)
    if lacking:
        click.echo("State it in the rig file, or with --set TABLE.KEY=TEXT.", err=True)
        raise SystemExit(EXIT_LACKING)
    click.echo("Nothing is lacking.")
