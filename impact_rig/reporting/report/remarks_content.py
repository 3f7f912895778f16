"""What a table does not say: warnings, and what could not be determined and why."""

from collections.abc import Iterable, Sequence

from impact_rig.core.setup.calibration_age import find_calibration_warning
from impact_rig.reporting.report.document import Paragraph, Part, Remark, Remarks, Section
from impact_rig.reporting.report.hits_content import count_reasons
from impact_rig.reporting.report.setup_content import format_time, is_dated
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import SampleResults
from impact_rig.results.run import Run

NO_WARNINGS = "None: nothing was found that makes the numbers doubtful."


def make_warnings_section(runs: Sequence[Run], unread: Sequence[str] = ()) -> Section:
    """Tell what a reader of the numbers must know before anything else.

    Parameters
    ----------
    runs : sequence of Run
        One, or several, whose names then stand with their warnings.
    unread : sequence of str
        Why others are not in the report.
    """
    items = [Remark(text, "not in this report") for text in unread]
    for run in runs:
        whose = run.name if len(runs) > 1 else ""
        items += [
            Remark(item.text, ", ".join(filter(None, (whose, item.about))))
            for item in _gather_warnings(run)
        ]
    parts: tuple[Part, ...] = (Remarks(tuple(items), is_warning=True),)
    return Section("Warnings", parts if items else (Paragraph(NO_WARNINGS),))


def make_missing_section(results: Results) -> Section | None:
    """Tell what could not be determined, and why."""
    items = gather_remarks([(sample.name, sample.notes) for sample in results.samples])
    items += [Remark(note, "hammer") for note in results.hammer.notes]
    if not items:
        return None
    text = "A dash in a table stands for a number that the hits do not determine. The reasons:"
    return Section("Not determined", (Paragraph(text), Remarks(tuple(items))))


def gather_remarks(remarks: Sequence[tuple[str, Iterable[str]]]) -> list[Remark]:
    """Return each text once, with the names of all that it is about."""
    holders: dict[str, list[str]] = {}
    for name, texts in remarks:
        for text in texts:
            holders.setdefault(text, []).append(name)
    return [
        Remark(text, "all samples" if len(names) == len(remarks) > 1 else ", ".join(names))
        for text, names in holders.items()
    ]


def _gather_warnings(run: Run) -> list[Remark]:
    results = run.campaign.results
    return [
        *_warn_of_recording(run),
        *_warn_of_sensors(run),
        *_warn_of_samples_without_hits(results.samples, results),
        *gather_remarks([(sample.name, sample.warnings) for sample in results.samples]),
    ]


def _warn_of_recording(run: Run) -> list[Remark]:
    items = [Remark(text, "recording" if run.has_traces else "") for text in run.warnings]
    if run.provenance is not None:
        items += [Remark(text, "recording") for text in run.provenance.problems]
        if run.provenance.losses:
            items.append(
                Remark(f"lost while it was recorded: {run.provenance.losses}", "recording")
            )
    # A damaged file is told of by whoever read it, too.
    return list(dict.fromkeys(items))


def _warn_of_sensors(run: Run) -> list[Remark]:
    """Warn of calibrations that were too old on the day of the recording."""
    if run.provenance is None or not is_dated(run.provenance):
        return []
    day = format_time(run.provenance.start_time).partition(" ")[0]
    sensors = [item.to_sensor() for item in run.campaign.results.setup.sensors]
    found = (find_calibration_warning(sensor, day) for sensor in sensors)
    return [Remark(text, "recording") for text in found if text]


def _warn_of_samples_without_hits(
    samples: Sequence[SampleResults], results: Results
) -> list[Remark]:
    if not any(sample.impacts_accepted for sample in samples):
        reasons = count_reasons(results.rejections)
        return [
            Remark(f"no hit was accepted, so that nothing is estimated; left out for {reasons}")
        ]
    return [
        Remark(
            "no hit was accepted; left out for "
            + count_reasons([hit for hit in results.rejections if hit.sample == sample.name]),
            sample.name,
        )
        for sample in samples
        if not sample.impacts_accepted
    ]
