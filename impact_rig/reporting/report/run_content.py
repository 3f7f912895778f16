"""All that a report says of one run."""

from collections.abc import Sequence

from impact_rig.reporting.figures.campaign import draw_campaign_figures
from impact_rig.reporting.figures.sample import draw_sample_figure
from impact_rig.reporting.report.budget_content import fold_budget
from impact_rig.reporting.report.document import (
    Folded,
    Paragraph,
    Part,
    Picture,
    Remarks,
    Section,
    drop_empty,
)
from impact_rig.reporting.report.hits_content import make_hits_section
from impact_rig.reporting.report.model_content import (
    tabulate_errors,
    tabulate_free_decays,
    tabulate_identifications,
    tabulate_pulse_shapes,
    tabulate_variants,
)
from impact_rig.reporting.report.paper_content import (
    find_largest_differences,
    tabulate_contact_times,
    tabulate_damping,
    tabulate_stiffness,
)
from impact_rig.reporting.report.remarks_content import (
    gather_remarks,
    make_missing_section,
)
from impact_rig.reporting.report.setup_content import make_setup_section
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import SampleResults
from impact_rig.results.run import Run

NOT_DETERMINED = "Of no sample; why stands under “Not determined”."


def make_run_sections(run: Run, *, prefix: str = "") -> tuple[Section, ...]:
    """Return what there is to say of one run but its warnings.

    Parameters
    ----------
    run : Run
        What to tell of.
    prefix : str
        Put before the names of its figures, so that those of several runs differ.
    """
    results = run.campaign.results
    return drop_empty(
        _make_summary_section(results),
        make_setup_section(run),
        *_make_result_sections(run, prefix),
        _make_samples_section(run, prefix),
        make_hits_section(results),
        make_missing_section(results),
    )


def _make_summary_section(results: Results) -> Section:
    count, hits = len(results.samples), len(results.hits) - len(results.rejections)
    text = (
        f"{count} sample{'s' * (count != 1)}, {hits} hit{'s' * (hits != 1)} in the means,"
        f" {len(results.rejections)} left out."
    )
    parts: list[Part] = [Paragraph(text)]
    largest = find_largest_differences(results)
    if largest:
        named = ", ".join(
            f"{symbol} {percent:.2f} % ({name})" for symbol, (percent, name) in largest.items()
        )
        parts.append(Paragraph(f"Largest differences from what is expected: {named}."))
    return Section("Summary", tuple(parts))


def _make_result_sections(run: Run, prefix: str) -> tuple[Section, ...]:
    """Return tables and figures, each by what it tells of; none without an accepted hit."""
    results = run.campaign.results
    samples = results.samples
    if not any(sample.impacts_accepted for sample in samples):
        return ()
    figures = draw_campaign_figures(results, run.campaign.samples, prefix=prefix)
    figure_3, figure_4, figure_5, figure_6 = map(Picture, figures)
    shapes = tabulate_pulse_shapes(samples)
    identified = tabulate_identifications(samples)
    return drop_empty(
        Section("Contact time", (tabulate_contact_times(results), figure_3, figure_4)),
        _tell("Stiffness", tabulate_stiffness(results)),
        _tell("Damping", [*tabulate_damping(results), *tabulate_free_decays(samples)]),
        Section("Model against measurement", (figure_5, figure_6, *tabulate_errors(samples))),
        Section("Pulse shape", tuple(shapes)),
        Section("Identification", tuple(identified)),
    )


def _tell(title: str, tables: Sequence[Part]) -> Section:
    """Return a section with tables, or the word that there are none."""
    return Section(title, tuple(tables) or (Paragraph(NOT_DETERMINED),))


def _make_samples_section(run: Run, prefix: str) -> Section:
    results = run.campaign.results
    sections = [_make_sample_section(run, sample, prefix) for sample in results.samples]
    parts: Sequence[Part] = fold_budget("hammer", results.hammer)
    return Section("Samples one by one", tuple(parts), drop_empty(*sections))


def _make_sample_section(run: Run, sample: SampleResults, prefix: str) -> Section:
    traces = next((item for item in run.campaign.samples if item.name == sample.name), None)
    parts: list[Part] = []
    if remarks := gather_remarks([("", sample.warnings)]):
        parts.append(Remarks(tuple(remarks), is_warning=True))
    if traces is not None:
        hits = [
            hit.aligned
            for hit in run.campaign.hits
            if hit.aligned is not None and hit.result.accepted and hit.result.sample == sample.name
        ]
        parts.append(Picture(draw_sample_figure(sample, traces, hits, prefix=prefix)))
    if remarks := gather_remarks([("", sample.notes)]):
        parts.append(Remarks(tuple(remarks)))
    if variants := tabulate_variants(sample):
        parts.append(Folded(f"Fitted models of {sample.name}", tuple(variants)))
    return Section(sample.name, (*parts, *fold_budget(sample.name, sample)), is_listed=False)
