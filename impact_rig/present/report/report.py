"""The whole report of a run: its first page, its samples, tables of all, hits, method."""

from collections.abc import Callable, Sequence

from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.records import IMPORTED, MEASURED, join_origins
from impact_rig.core.sample import SampleEstimate
from impact_rig.present.campaign_figures import (
    make_contact_pictures,
    make_model_pictures,
    make_speed_picture,
)
from impact_rig.present.report.page import (
    Document,
    Facts,
    Folded,
    Paragraph,
    Part,
    Remarks,
    Section,
    drop_empty,
)
from impact_rig.present.report.setup import format_date, make_setup_section
from impact_rig.present.sample_figures import make_law_picture, make_sample_picture
from impact_rig.results import tables
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import format_count, format_time, is_dated
from impact_rig.results.references import find_expected
from impact_rig.results.remarks import (
    Remark,
    count_reasons,
    describe_origin,
    gather_remarks,
    gather_sample_remarks,
    select_attention,
    tabulate_accepted,
    tabulate_rejections,
)
from impact_rig.results.traces import ReportedCampaign, compute_law_curves


def make_run_sections(run: ReportedCampaign) -> tuple[Section, ...]:
    """Return the sections on one run: results, samples, tables, hits, set-up."""
    results = run.campaign.results
    remarks = gather_run_remarks(run)
    others = tuple(remark for remark in remarks if not remark.effect)
    return drop_empty(
        _make_results_section(results, select_attention(remarks)),
        Section("Samples", (), tuple(_make_sample_section(run, item) for item in results.samples)),
        *_make_table_sections(run),
        _make_hits_section(results),
        Section("Further remarks", (Remarks(others),) if others else ()),
        _make_budgets_section(results),
        make_setup_section(run),
    )


def _make_results_section(results: Results, remarks: Sequence[Remark]) -> Section:
    """Return the first page: one table, what needs attention."""
    left_out = len(results.rejections)
    accepted = format_count(len(results.hits) - left_out, "hit")
    parts: list[Part] = [
        *tables.tabulate_summary(results),
        Paragraph(f"{accepted} accepted, {left_out} rejected."),
    ]
    if remarks:
        parts += [Paragraph("What needs attention:"), Remarks(tuple(remarks), is_warning=True)]
    return Section("Results", tuple(parts))


def _make_table_sections(run: ReportedCampaign) -> tuple[Section, ...]:
    """Return the tables and figures of all samples; empty without an accepted hit."""
    results = run.campaign.results
    samples = results.samples
    if not any(sample.impacts_accepted for sample in samples):
        return ()
    models = make_model_pictures(results, run.campaign.samples)
    decays, errors = tables.tabulate_free_decays(samples), tables.tabulate_errors(samples)
    times = tables.tabulate_contact_times(results)
    return drop_empty(
        Section("Contact time", (times, *make_contact_pictures(results))),
        Section("Stiffness", tuple(tables.tabulate_stiffness(results))),
        Section("Damping", (*tables.tabulate_damping(results), *decays)),
        Section("Model against measurement", (*models, *errors)),
        Section("Pulse shape", tuple(tables.tabulate_pulse_shapes(samples))),
        Section("Contact law", tuple(tables.tabulate_contact_laws(samples))),
        Section("Momenta", tuple(tables.tabulate_momenta(samples))),
        _make_speed_section(results),
    )


def _make_speed_section(results: Results) -> Section | None:
    """Return the section on the impact speed; None if there is only one speed."""
    found = tables.tabulate_speed_exponents(results.speed_exponents)
    if not found:
        return None
    return Section("Contact over impact speed", (*found, make_speed_picture(results)))


def _make_sample_section(run: ReportedCampaign, sample: SampleEstimate) -> Section:
    """Return the page of one sample: its traces with the models, its law, its remarks."""
    results = run.campaign.results
    traces = next((item for item in run.campaign.samples if item.name == sample.name), None)
    parts: list[Part] = []
    if traces is not None:
        hits = [
            hit.aligned
            for hit in run.campaign.hits
            if hit.aligned is not None and hit.result.accepted and hit.result.sample == sample.name
        ]
        parts.append(make_sample_picture(sample, traces, hits))
        curves = compute_law_curves(sample.contact_law, traces, results.setup)
        if curves is not None:
            parts.append(make_law_picture(sample, curves))
    if sample.impacts_accepted:
        parts.append(tables.tabulate_methods(sample, find_expected(results, sample.name)))
    if remarks := gather_sample_remarks(sample):
        parts.append(Remarks(tuple(remarks)))
    return Section(sample.name, tuple(parts), is_page=True)


def _make_budgets_section(results: Results) -> Section:
    parts: list[Part] = []
    for sample in results.samples:
        parts += _fold_budgets(sample.name, sample)
    parts += _fold_budgets("hammer", results.hammer)
    return Section("Uncertainty budgets", tuple(parts))


def _fold_budgets(name: str, body: SampleEstimate | HammerEstimate) -> list[Part]:
    """Return the uncertainty budgets of one body, folded; empty without any."""
    budgets = tuple(tables.tabulate_budgets(name, body))
    return [Folded(f"Uncertainty budget of {name}", budgets)] if budgets else []


def _make_hits_section(results: Results) -> Section:
    """Return the section with every hit of a campaign."""
    rejected, accepted = results.rejections, [hit for hit in results.hits if hit.accepted]
    text = (
        f"Of {len(results.hits)} hits {len(accepted)} are in the means and {len(rejected)} were"
        " left out"
    )
    if rejected:
        text += f": {count_reasons(rejected)}. A hit may have several reasons"
    folded = [Folded(table.caption, (table,)) for table in tabulate_accepted(results)]
    return Section("Hits", (Paragraph(f"{text}."), *tabulate_rejections(results), *folded))


def gather_run_remarks(run: ReportedCampaign) -> list[Remark]:
    """Return the remarks on the results of a run and on its recording."""
    results, provenance = run.campaign.results, run.provenance
    texts = list(run.warnings)
    if provenance is not None:
        losses = [f"lost while recording: {provenance.losses}"] * bool(provenance.losses)
        texts += [*provenance.problems, *losses]
        if is_dated(provenance.start_time):
            day = format_time(provenance.start_time).partition(" ")[0]
            texts += results.setup.list_calibration_warnings(day)
    return gather_remarks(results, texts)


TITLE = "Impact test report"
GUIDE = {
    "±": (
        "The half-width of the interval that holds the true value with a probability of 95 %"
        " (expanded uncertainty U, GUM). u is a standard uncertainty. A value is rounded to"
        " the second digit of its uncertainty. Where U is above 10 % of what a formula makes of"
        " τp, as k ~ 1/τp², the interval has its own half-widths: 0.45 +0.44 -0.18."
    ),
    "Contact time τp": (
        "Twice the width of the mean hammer pulse at half its amplitude, w50: right for a"
        " versed-sine pulse. Hits are laid over each other at the middle of the pulse and"
        " averaged."
    ),
    "Stiffness k": (
        "k_eq = m_eq (π/τp)², with m_eq = m1 m2/(m1 + m2) and m2 the sample with its"
        " accelerometer. k1 = 2 k_eq of the control sample, which is alike to the hammer; then"
        " 1/k2 = 1/k_eq - 1/k1."
    ),
    "Damping c": (
        "From the logarithmic decrement Δ = ln(U1/U2) of two successive peaks:"
        " ζ = Δ/√(4π² + Δ²) and c = 2ζ√(km). U1 lies inside the contact, where the response is"
        " still forced: the free decay after the contact is given beside it."
    ),
    "Model": (
        "Two bodies, each with a spring and a damper, pressed together by a versed-sine force."
        " “driven”: the force alone drives the sample. “printed”: equations (1) and (2) as"
        " they stand in the paper. Both with k and c by the paper's method."
    ),
    "Paper, reference": (
        "The published value of the same sample, or the value that the rig's set-up expects."
        " Δ/U is measured minus expected, over the half-width of the measured value's interval."
    ),
    "Hits left out": (
        "A hit is judged before it counts: overload, double hit, too weak, truncated, no"
        " pulse, dead channel, gap, outlier of its sample. A person can overrule that."
    ),
}
"""How to read the report: signs, methods and words."""


def make_report(
    runs: Sequence[ReportedCampaign], report: Callable[[int], None] = lambda _: None
) -> Document:
    """Return the report of a run.

    Parameters
    ----------
    runs : sequence of ReportedCampaign
        The campaigns of a recording, usually one.
    report : callable, optional
        Gets the number of finished campaigns.

    Raises
    ------
    ParameterError
        If a run names a sample that is not in its set-up.
    """
    kind = join_origins(run.campaign.results.origin for run in runs).kind
    sections: list[Section] = []
    for number, run in enumerate(runs, start=1):
        parts = make_run_sections(run)
        sections += parts if len(runs) == 1 else [Section(run.name, (), parts)]
        report(number)
    return Document(
        title=TITLE if kind == MEASURED else f"{TITLE}: {kind}",
        subtitle=_describe_rigs(runs),
        name=", ".join(run.name for run in runs),
        banner=_describe_origins(runs),
        is_warning=kind not in (MEASURED, IMPORTED),
        facts=_list_facts(runs),
        sections=(*sections, Section("Method", (Facts(tuple(GUIDE.items())),))),
    )


def _describe_origins(runs: Sequence[ReportedCampaign]) -> str:
    """Return where the numbers come from, run by run where there are several."""
    texts = [describe_origin(hit.origin for hit in run.campaign.results.hits) for run in runs]
    if len(runs) == 1:
        return texts[0]
    return " ".join(f"{run.name}: {text}" for run, text in zip(runs, texts, strict=True))


def _describe_rigs(runs: Sequence[ReportedCampaign]) -> str:
    setups = [run.campaign.results.setup for run in runs]
    described = dict.fromkeys(setup.description or setup.name for setup in setups)
    text = "; ".join(item for item in described if item)
    return text[:1].upper() + text[1:]


def _list_facts(runs: Sequence[ReportedCampaign]) -> tuple[tuple[str, str], ...]:
    """Return the facts beside the title."""
    results = [run.campaign.results for run in runs]
    rigs = dict.fromkeys(item.setup.name for item in results if item.setup.name)
    names = dict.fromkeys(sample.name for item in results for sample in item.samples)
    hits = sum(len(item.hits) for item in results)
    left_out = sum(len(item.rejections) for item in results)
    facts = [
        ("Run", ", ".join(run.name for run in runs)),
        ("Rig", ", ".join(rigs)),
        ("Recorded", format_date(runs[0].provenance)),
        ("Samples", str(len(names))),
        ("Hits in the means", f"{hits - left_out} of {hits}"),
    ]
    return tuple((name, text) for name, text in facts if text)
