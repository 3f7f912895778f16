"""All that a report says of one run."""

from collections.abc import Sequence

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.present.figures.law_figure import draw_law_figure
from impact_rig.present.figures.paper_figures import draw_campaign_figures
from impact_rig.present.figures.sample_figure import draw_sample_figure
from impact_rig.present.figures.speed_figure import draw_speed_figure
from impact_rig.present.report.document import (
    Folded,
    Paragraph,
    Part,
    Picture,
    Remarks,
    Section,
    drop_empty,
)
from impact_rig.present.report.setup import format_time, is_dated, make_setup_section
from impact_rig.present.report.simulators import make_simulators_section
from impact_rig.results import tables
from impact_rig.results.campaign import Results
from impact_rig.results.law_curves import compute_law_curves
from impact_rig.results.remarks import (
    Remark,
    count_reasons,
    gather_notes,
    gather_warnings,
    tabulate_accepted,
    tabulate_rejections,
)
from impact_rig.results.run import Run

NO_WARNINGS = "None: nothing was found that makes the numbers doubtful."
NOT_DETERMINED = "Of no sample; why stands under “Not determined”."


def make_run_sections(run: Run, *, with_simulators: bool = False) -> tuple[Section, ...]:
    """Return what there is to say of one run but its warnings.

    Parameters
    ----------
    run : Run
        What to tell of.
    with_simulators : bool
        With the chapter on simulators.
    """
    results = run.campaign.results
    return drop_empty(
        _make_summary_section(results),
        make_setup_section(run),
        *_make_result_sections(run),
        *([make_simulators_section(run)] if with_simulators else []),
        _make_samples_section(run),
        _make_hits_section(results),
        _make_missing_section(results),
    )


def _make_summary_section(results: Results) -> Section:
    count, hits = len(results.samples), len(results.hits) - len(results.rejections)
    text = (
        f"{count} sample{'s' * (count != 1)}, {hits} hit{'s' * (hits != 1)} in the means,"
        f" {len(results.rejections)} left out."
    )
    parts: list[Part] = [Paragraph(text)]
    largest = tables.find_largest_differences(results)
    if largest:
        named = ", ".join(
            f"{symbol} {percent:.2f} % ({name})" for symbol, (percent, name) in largest.items()
        )
        parts.append(Paragraph(f"Largest differences from what is expected: {named}."))
    return Section("Summary", tuple(parts))


def _make_result_sections(run: Run) -> tuple[Section, ...]:
    """Return tables and figures, each by what it tells of; none without an accepted hit."""
    results = run.campaign.results
    samples = results.samples
    if not any(sample.impacts_accepted for sample in samples):
        return ()
    figures = draw_campaign_figures(results, run.campaign.samples)
    figure_3, figure_4, figure_5, figure_6 = map(Picture, figures)
    decays, errors = tables.tabulate_free_decays(samples), tables.tabulate_errors(samples)
    return drop_empty(
        Section("Contact time", (tables.tabulate_contact_times(results), figure_3, figure_4)),
        _make_table_section("Stiffness", tables.tabulate_stiffness(results)),
        _make_table_section("Damping", [*tables.tabulate_damping(results), *decays]),
        Section("Model against measurement", (figure_5, figure_6, *errors)),
        Section("Pulse shape", tuple(tables.tabulate_pulse_shapes(samples))),
        Section(
            "Contact law",
            (*tables.tabulate_contact_laws(samples), *tables.tabulate_size_exponents(results)),
        ),
        _make_speed_section(results),
        Section("Identification", tuple(tables.tabulate_identifications(samples))),
    )


def _make_speed_section(results: Results) -> Section | None:
    """Tell how the contact goes with the impact speed; None: it is one."""
    found = tables.tabulate_speed_exponents(results.speed_exponents)
    figure = Picture(draw_speed_figure(results)) if found else None
    return Section("Contact over impact speed", (*found, figure)) if figure else None


def _make_table_section(title: str, parts: Sequence[Part]) -> Section:
    """Return a section with tables, or the word that there are none."""
    return Section(title, tuple(parts) or (Paragraph(NOT_DETERMINED),))


def _make_samples_section(run: Run) -> Section:
    results = run.campaign.results
    sections = [_make_sample_section(run, sample) for sample in results.samples]
    parts = _fold_budgets("hammer", results.hammer)
    return Section("Samples one by one", tuple(parts), drop_empty(*sections))


def _make_sample_section(run: Run, sample: SampleEstimate) -> Section:
    traces = next((item for item in run.campaign.samples if item.name == sample.name), None)
    parts: list[Part] = []
    if sample.warnings:
        parts.append(Remarks(tuple(map(Remark, sample.warnings)), is_warning=True))
    if traces is not None:
        hits = [
            hit.aligned
            for hit in run.campaign.hits
            if hit.aligned is not None and hit.result.accepted and hit.result.sample == sample.name
        ]
        parts.append(Picture(draw_sample_figure(sample, traces, hits)))
        curves = compute_law_curves(sample.contact_law, traces, run.campaign.results.setup)
        if curves is not None:
            parts.append(Picture(draw_law_figure(sample, curves)))
    if sample.notes:
        parts.append(Remarks(tuple(map(Remark, sample.notes))))
    if variants := tables.tabulate_variants(sample):
        parts.append(Folded(f"Fitted models of {sample.name}", tuple(variants)))
    return Section(sample.name, (*parts, *_fold_budgets(sample.name, sample)), is_listed=False)


def _fold_budgets(name: str, body: SampleEstimate | HammerEstimate) -> list[Part]:
    """Return the uncertainty budgets of one body, to be unfolded; nothing if it has none."""
    budgets = tuple(tables.tabulate_budgets(name, body))
    return [Folded(f"Uncertainty budget of {name}", budgets)] if budgets else []


def _make_hits_section(results: Results) -> Section:
    """Tell of every hit of a campaign."""
    rejected, accepted = results.rejections, [hit for hit in results.hits if hit.accepted]
    text = (
        f"Of {len(results.hits)} hits {len(accepted)} are in the means and {len(rejected)} were"
        " left out"
    )
    if rejected:
        text += f": {count_reasons(rejected)}. A hit may have several reasons"
    folded = [Folded(table.caption, (table,)) for table in tabulate_accepted(results)]
    return Section("Hits", (Paragraph(f"{text}."), *tabulate_rejections(results), *folded))


def _make_missing_section(results: Results) -> Section | None:
    """Tell what could not be determined, and why."""
    items = tuple(gather_notes(results.samples, results.hammer))
    text = "A dash in a table stands for a number that the hits do not determine. The reasons:"
    return Section("Not determined", (Paragraph(text), Remarks(items))) if items else None


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


def _gather_warnings(run: Run) -> list[Remark]:
    results, provenance = run.campaign.results, run.provenance
    texts: list[str] = []
    if provenance is not None:
        losses = [f"lost while it was recorded: {provenance.losses}"] * bool(provenance.losses)
        texts += [*provenance.problems, *losses]
        if is_dated(provenance):
            day = format_time(provenance.start_time).partition(" ")[0]
            texts += results.setup.list_calibration_warnings(day)
    # Whoever read a damaged file warns of it, too.
    recording = [
        *(Remark(text, "recording" if run.has_traces else "") for text in run.warnings),
        *(Remark(text, "recording") for text in texts),
    ]
    return [
        *dict.fromkeys(recording),
        *_warn_of_samples_without_hits(results),
        *gather_warnings(results.samples),
    ]


def _warn_of_samples_without_hits(results: Results) -> list[Remark]:
    if not any(sample.impacts_accepted for sample in results.samples):
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
        for sample in results.samples
        if not sample.impacts_accepted
    ]
