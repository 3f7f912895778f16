"""`impact-rig report`: a run as one HTML file."""

import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click

from impact_rig.analysis.analyze import ByHand
from impact_rig.analysis.sources import RunSource, find_run, read_runs
from impact_rig.cli.info import (
    describe_end,
    describe_losses,
    inspect_with_progress,
    read_fields,
    read_versions,
)
from impact_rig.cli.output import show_progress
from impact_rig.configuration.particulars import (
    NOTHING_STATED,
    OF_SAMPLE,
    Particulars,
    read_particulars,
)
from impact_rig.configuration.processes import REPORT_NAME
from impact_rig.configuration.toml_table import read_toml_file
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.records import IMPORTED, MEASURED, join_origins
from impact_rig.present.console import print_warning
from impact_rig.present.report.certificate import list_bodies, list_results, make_certificate
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import ReportForm, make_report
from impact_rig.present.report.setup import find_test_days, list_calibration_warnings
from impact_rig.recordings.contents import Contents
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import compute_sha256
from impact_rig.recordings.records import IMPORT_REMARKS, PROVENANCE_RECORD
from impact_rig.results.traces import Provenance, RecordedFile, ReportedCampaign
from impact_rig.results.wire import format_json, to_json

CUSTOMER = "customer"  # of the option --for
EXIT_LACKING = 1  # the run can be reported, but a formal report would lack something
MOST_KEYS = 5  # that a warning names


def make_provenance(contents: Contents) -> Provenance:
    """Return when, by what and how a run was recorded; raises `FileError` on a lost file."""
    notes = [(note.time, note.text) for note in contents.notes]
    fields = read_fields(contents, PROVENANCE_RECORD)
    if first := fields.get("notes", ""):
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
        import_remarks=tuple(fields.get(IMPORT_REMARKS, "").splitlines()),
    )


def find_particulars(contents: Contents | None, rig_file: Path | None) -> Particulars:
    """Return a person's statements: by the named rig file, then by the recording's."""
    recorded = _read_recorded(contents)
    if rig_file is None:
        return recorded
    named = read_toml_file(rig_file, "rig file", read_particulars)
    left = [name for name, value in named.unused.items() if recorded.unused.get(name) != value]
    if left:
        more = f" and {len(left) - MOST_KEYS} more" if len(left) > MOST_KEYS else ""
        print_warning(
            f"of the rig file {rig_file} only texts, instruments and limits are taken:"
            f" {', '.join(left[:MOST_KEYS])}{more} as recorded"
        )
    return named.put_over(recorded)


def _read_recorded(contents: Contents | None) -> Particulars:
    for item in contents.attachments if contents is not None else ():
        if item.name.endswith(".toml"):
            try:
                return read_particulars(item.data.decode("utf-8-sig"))
            except (UnicodeDecodeError, ParameterError) as error:
                print_warning(f"the rig file {item.name} in the recording is not used: {error}")
    return NOTHING_STATED


def run(
    path: Path,
    output: Path | None,
    namespace: str | None,
    rig_file: Path | None,
    texts: tuple[str, ...],
    is_check: bool,
    is_final: bool,
    audience: str | None,
    is_short: bool,
    with_data: bool,
    with_printed: bool,
    **by_hand: str | tuple[str, ...],
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    source = find_run(path, namespace)
    output = output or source.folder / REPORT_NAME
    if output.exists() and not is_check:
        raise FileError(f"{output} exists already: name another file with -o")
    # Its fields are the options, and now.
    asked = ByHand(**by_hand, stamp=time.time_ns())  # type: ignore[arg-type]
    _check_reason(asked, source)
    contents = None
    with show_progress() as follow:
        follow(f"reading {source.named}", 0)
        runs = read_runs(source, asked)
        if source.run is not None and runs[0].campaign.hits:
            contents = inspect_with_progress(source.run)
            provenance = make_provenance(contents)
            runs = tuple(replace(run, provenance=provenance) for run in runs)
        stated = find_particulars(contents, rig_file).set(texts, _list_bodies(runs))
        is_signed = bool(stated.get("report", "authorised_by"))
        is_for_customer = audience == CUSTOMER if audience else is_signed
        doubts = _list_doubts(runs, stated)
        lacking = _list_lacking(runs, stated, has_opinions=not is_for_customer)
        if is_check:
            _print_lacking(lacking, [*doubts, *_list_warnings(runs, stated)])
            return
        stated.check_replacement()
        if is_final and (missing := [*lacking, *doubts]):
            raise ParameterError(
                f"the report is not final, and not written; lacking: {'; '.join(missing)}"
            )
        document = make_report(
            runs,
            stated,
            lambda done: follow("drawing", done, len(runs)),
            ReportForm(is_for_customer, is_short, with_printed),
        )
        written = {output: render_page(document)}
        if with_data:
            results = [to_json(item) for item in list_results(runs)]
            told = {"report": stated.get("report", "number"), "results": results}
            written[output.with_suffix(".xml")] = make_certificate(runs, stated)
            written[output.with_suffix(".json")] = format_json(told)
    for place, text in written.items():
        with write_new_file(place) as part:
            part.write_text(text, encoding="utf-8")
    for text in doubts:
        print_warning(text)
    click.echo(f"report: {', '.join(map(str, written))}", err=True)


def _check_reason(asked: ByHand, source: RunSource) -> None:
    """Refuse a decision that the report could not explain."""
    if not (asked.accept or asked.reject):
        if asked.reason or asked.who:
            raise ParameterError("--reason and --who belong to --accept or --reject: name a hit")
    elif not (asked.reason.strip() and asked.who.strip()):
        raise ParameterError(
            'a report says why a hit is decided on by hand, and who did: add --reason "TEXT" --who'
            ' "NAME"'
        )
    elif source.run is None:
        raise ParameterError(f"{source.named} has no traces: --accept and --reject need them")


def _list_bodies(runs: Sequence[ReportedCampaign]) -> list[str]:
    samples = (sample for run in runs for sample in run.campaign.results.setup.samples.samples)
    return list(dict.fromkeys(sample.body for sample in samples))


def _list_doubts(runs: Sequence[ReportedCampaign], stated: Particulars) -> list[str]:
    """Return which statements cannot be true of the runs: of other samples, of other days."""
    known = _list_bodies(runs)
    doubts = [
        f"facts or limits are stated of {name!r}, and the run has no such sample, so they are not"
        f" in the report: its samples are {', '.join(known)}"
        for name in stated.samples
        if name not in known
    ]
    today = datetime.now(UTC).date().isoformat()
    return doubts + stated.list_contradictions(*find_test_days(runs[0].provenance), today)


def _list_lacking(
    runs: Sequence[ReportedCampaign], stated: Particulars, *, has_opinions: bool
) -> list[str]:
    """Return what ISO/IEC 17025 asks for and is not stated."""
    bodies = list_bodies(runs)
    is_dated = any(find_test_days(runs[0].provenance))
    return stated.list_lacking(bodies, is_dated=is_dated, has_opinions=has_opinions)


def _list_warnings(runs: Sequence[ReportedCampaign], stated: Particulars) -> list[str]:
    """Return what a customer would object to: hits that no hammer struck, old calibrations."""
    results = [run.campaign.results for run in runs]
    texts = list_calibration_warnings(results[0].setup, stated, runs[0].provenance)
    kind = join_origins(item.origin for item in results).kind
    if kind not in (MEASURED, IMPORTED):
        texts.insert(0, f"measured hits are lacking: these are {kind}")
    return texts


def _print_lacking(lacking: Sequence[str], texts: Sequence[str]) -> None:
    """Print what a formal report would lack; the exit code says whether that is anything."""
    for text in (*lacking, *texts):
        click.echo(text[:1].upper() + text[1:])
    if lacking:
        click.echo(
            "State what is lacking in the rig file, in another file of the same tables (--rig-file"
            f" LABORATORY.toml), or with --set TABLE.KEY=TEXT, of a sample {OF_SAMPLE}NAME.KEY.",
            err=True,
        )
    if lacking or texts:
        raise SystemExit(EXIT_LACKING)
    click.echo("Nothing is lacking.")
