"""The whole report of a run: its first page, its samples, tables of all, hits, method."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from impact_rig.configuration.particulars import NOTHING_STATED, REPORT, Particulars
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import IMPORTED, MEASURED, join_origins
from impact_rig.present.campaign_figures import (
    make_contact_pictures,
    make_model_pictures,
    make_speed_picture,
)
from impact_rig.present.picture import drawing_style
from impact_rig.present.report.page import (
    Document,
    Folded,
    Paragraph,
    Part,
    Remarks,
    Section,
    drop_empty,
)
from impact_rig.present.report.setup import (
    find_test_days,
    list_calibration_warnings,
    make_items_section,
    make_sampling_section,
    make_setup_section,
)
from impact_rig.present.sample_figures import (
    leave_out_printed,
    make_key_picture,
    make_sample_picture,
)
from impact_rig.results import tables
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    SAMPLE_MEASURANDS,
    format_count,
    format_date,
    format_quantity,
    format_rounded,
)
from impact_rig.results.references import JudgedValue, judge_values, tabulate_conformity
from impact_rig.results.remarks import (
    NO_RESULT,
    UNSTATED_EFFECT,
    Common,
    Remark,
    describe_origin,
    find_common,
    gather_remarks,
    gather_sample_remarks,
    select_attention,
    sort_remarks,
    tabulate_accepted,
    tabulate_marks,
    tabulate_overrules,
    tabulate_rejections,
)
from impact_rig.results.traces import ReportedCampaign, compute_law_curves

SCOPE = (
    "The results relate only to the items tested{received}. Without the laboratory's approval the"
    " report may be reproduced only as a whole."
)


@dataclass(frozen=True)
class ReportForm:
    """For whom a report is, and how long."""

    # Without opinions and advice, which are for the laboratory's own people.
    is_for_customer: bool = False
    is_short: bool = False  # results, set-up, method and signature alone, without the annex
    with_printed: bool = False  # every figure shows the model as printed


def make_run_sections(
    run: ReportedCampaign, stated: Particulars, form: ReportForm
) -> tuple[tuple[Section, ...], tuple[Section, ...]]:
    """Return the sections on one run before the signature, and those of the annex."""
    results = run.campaign.results
    remarks = gather_run_remarks(run, stated)
    if form.is_for_customer:
        remarks = [remark for remark in remarks if _concerns_customer(remark)]
    first = drop_empty(
        _make_results_section(results, select_attention(remarks), stated),
        make_items_section(run, stated),
        make_setup_section(run),
    )
    if form.is_short:
        return first, ()
    others = tuple(remark for remark in remarks if not remark.effect)
    common = find_common(results)
    samples = [_make_sample_section(run, item, common, form) for item in results.samples]
    return first, drop_empty(
        Section("Annex: samples", _explain_figures(run), tuple(samples)),
        _make_tables_section(run),
        _make_hits_section(run),
        make_sampling_section(run),
        Section("Further remarks", (Remarks(others),) if others else ()),
    )


def _concerns_customer(remark: Remark) -> bool:
    """Return whether a remark is of a missing result, the recording or the instruments."""
    return remark.effect == NO_RESULT or remark.about in ("file", "instruments")


def _make_results_section(
    results: Results, remarks: Sequence[Remark], stated: Particulars
) -> Section:
    """Return the first page: the conclusion, one table, what needs attention."""
    judged = judge_values(results, stated.limits)
    # If their sampling is not stated, the laboratory did not take the items (7.8.2.2).
    received = "" if stated.get("report", "sampling") else ", as received"
    parts: list[Part] = [
        Paragraph(conclude(results, judged)),
        *tables.tabulate_summary(results),
        *_describe_coverage(results),
        *tabulate_conformity(judged),
        Paragraph(f"{results.count_hits()}. {SCOPE.format(received=received)}"),
    ]
    if remarks:
        parts += [Paragraph("What needs attention:"), Remarks(tuple(remarks), is_warning=True)]
    return Section("Results", tuple(parts))


def _describe_coverage(results: Results) -> list[Part]:
    """Return the coverage factors of the uncertainties above; empty without any."""
    values = [item.read(sample) for sample in results.samples for item in SAMPLE_MEASURANDS]
    factors = [item.expanded / item.standard for item in values if item.standard > 0.0]
    if not factors:
        return []
    ends = dict.fromkeys(f"{factor:.2f}" for factor in (min(factors), max(factors)))
    text = f"U = k u for 95 %, with k of {' to '.join(ends)} by Student's t: each value's k and"
    return [Paragraph(f"{text} effective degrees of freedom stand with its sample.")]


def conclude(results: Results, judged: Sequence[JudgedValue]) -> str:
    """Return in one sentence what was found, and whether it is as expected or required."""
    clauses = [
        f"{item.name} {item.symbol} {spanned} {item.unit}"
        for item in SAMPLE_MEASURANDS
        if (spanned := _span(map(item.read, results.samples), item.digits, item.scale))
    ]
    text = "; ".join(clauses) or "nothing could be determined"
    laws = [item.contact_law for item in results.samples if item.contact_law.is_known]
    if laws:
        text += f"; by the contact law, of {format_count(len(laws), 'sample')}: duration"
        text += f" {_span((law.duration for law in laws), 2, 1e6)} µs"
        if stiffness := _span((law.equivalent_stiffness for law in laws), 2, 1e-6):
            text += f", linear stiffness {stiffness} MN/m"
    expected = tables.count_expected(results)
    if any(expected):
        text += f"; {expected[0]} of {sum(expected)} values agree with what is expected, within U"
    if judged:
        counts = Counter(item.conformity.value for item in judged)
        told = ", ".join(f"{count} {name}" for name, count in counts.items())
        text += f"; of {format_count(len(judged), 'value')} with limits {told}"
    return f"{format_count(len(results.samples), 'sample')}: {text}."


def _span(found: Iterable[Quantity], digits: int, scale: float) -> str:
    """Return what is known, as the tables round it: of several the least and the largest."""
    known = sorted((item for item in found if item.is_known), key=lambda item: item.value)
    if len(known) < 2:  # noqa: PLR2004 - no span
        return "".join(format_quantity(item, digits, scale) for item in known)
    ends = (format_rounded(end, digits, scale) for end in (known[0], known[-1]))
    return " to ".join(dict.fromkeys(ends))


def _make_tables_section(run: ReportedCampaign) -> Section | None:
    """Return the tables and figures of all samples; None without an accepted hit."""
    results = run.campaign.results
    samples = results.samples
    if not any(sample.impacts_accepted for sample in samples):
        return None
    speeds = tables.tabulate_speed_exponents(results.speed_exponents)
    budgets = [part for item in samples for part in _fold_budgets(item.name, item)]
    parts = (
        tables.tabulate_contact_times(results),
        *make_contact_pictures(results),
        *tables.tabulate_stiffness(results),
        *tables.tabulate_damping(results),
        *tables.tabulate_free_decays(samples),
        *make_model_pictures(results, run.campaign.samples),
        *tables.tabulate_errors(samples),
        *tables.tabulate_pulse_shapes(samples),
        *tables.tabulate_contact_laws(samples),
        *tables.tabulate_momenta(samples),
        *speeds,
        *(make_speed_picture(results) for _ in speeds),
        *tables.tabulate_shares(results),
        *budgets,
        *_fold_budgets("hammer", results.hammer),
    )
    return Section("All samples", parts)


def _explain_figures(run: ReportedCampaign) -> tuple[Part, ...]:
    """Return what the figures of all samples show, as far as they show it."""
    if not run.campaign.samples:
        return ()
    laws = [sample.contact_law for sample in run.campaign.results.samples]
    has_law = any(law.impact_speed.is_known for law in laws)
    return (make_key_picture(run.campaign.samples, has_law=has_law),)


def _make_sample_section(
    run: ReportedCampaign, sample: SampleEstimate, common: Common, form: ReportForm
) -> Section:
    """Return what there is of one sample: its traces with the models, methods, remarks."""
    results = run.campaign.results
    traces = run.campaign.find_traces(sample.name)
    parts: list[Part] = []
    if traces is not None:
        hits = run.campaign.list_aligned(sample.name)
        curves = compute_law_curves(sample.contact_law, traces, results.setup)
        parts.append(make_sample_picture(traces, hits, curves))
        if len(hits) < sample.impacts_accepted:
            told = f"Drawn evenly: {len(hits)} of {sample.impacts_accepted} hits."
            parts.append(Paragraph(told))
    if sample.impacts_accepted:
        parts.append(tables.tabulate_methods(results, sample))
    remarks = gather_sample_remarks(sample, common)
    if remarks and not form.is_for_customer:
        parts.append(Remarks(tuple(remarks)))
    return Section(sample.name, tuple(parts), is_whole=True)


def _fold_budgets(name: str, body: SampleEstimate | HammerEstimate) -> list[Part]:
    """Return the uncertainty budgets of one body, folded; empty without any."""
    budgets = tuple(tables.tabulate_budgets(name, body))
    return [Folded(f"Uncertainty budget of {name}", budgets)] if budgets else []


def _make_hits_section(run: ReportedCampaign) -> Section:
    """Return the section with every hit of a campaign."""
    results, overrules = run.campaign.results, run.campaign.overrules
    decided = {label for label, _ in overrules}
    others = tuple(hit for hit in results.hits if hit.label not in decided)
    folded = [Folded(table.caption, (table,)) for table in tabulate_accepted(results)]
    parts: tuple[Part, ...] = (
        *tabulate_marks(results),
        *tabulate_overrules(results, overrules),
        *tabulate_rejections(replace(results, hits=others)),
        *folded,
    )
    return Section("Hits", parts)


def gather_run_remarks(run: ReportedCampaign, stated: Particulars) -> list[Remark]:
    """Return the remarks on the results of a run and on its recording."""
    results, provenance = run.campaign.results, run.provenance
    texts = list(run.warnings)
    if provenance is not None:
        texts += (*provenance.problems, *provenance.import_remarks)
        if provenance.losses is not None:
            texts.append(f"lost while recording: {provenance.losses}")
    old = list_calibration_warnings(results.setup, stated, provenance)
    remarks = [Remark(text, "instruments", UNSTATED_EFFECT) for text in old]
    return sort_remarks([*remarks, *gather_remarks(results, texts)])


TITLE = "Impact test report"
PAPER = (
    "“An evaluation of a simple dynamical model for impacts between rigid objects”, known here by"
    " its title alone"
)
"""The method's source, where no other one is stated."""
UNCERTAINTY = (
    "± is the expanded uncertainty U = k u for 95 %, by JCGM 100:2008 (GUM), k by Student's t."
)


def make_report(
    runs: Sequence[ReportedCampaign],
    stated: Particulars = NOTHING_STATED,
    report: Callable[[int], None] = lambda _: None,
    form: ReportForm = ReportForm(),
) -> Document:
    """Return the report of a run.

    Parameters
    ----------
    runs : sequence of ReportedCampaign
        The campaigns of a recording, usually one.
    stated : Particulars
        Laboratory, report, items and instruments, as a person states them.
    report : callable, optional
        Gets the number of finished campaigns.
    form : ReportForm
        For whom it is, and how long.

    Raises
    ------
    ParameterError
        If a run names a sample that is not in its set-up.
    """
    kind = join_origins(run.campaign.results.origin for run in runs).kind
    sections: list[Section] = []
    annex: list[Section] = []
    with drawing_style():
        for number, run in enumerate(runs, start=1):
            shown = run if form.with_printed else _leave_out_printed(run)
            parts, further = make_run_sections(shown, stated, form)
            sections += parts if len(runs) == 1 else [Section(run.name, (), parts)]
            annex += further if len(runs) == 1 else [Section(run.name, (), further)]
            report(number)
    samples = [item for run in runs for item in run.campaign.results.samples]
    laws = [item.contact_law for item in samples]
    return Document(
        title=TITLE if kind == MEASURED else f"{TITLE}: {kind}",
        subtitle=_describe_rigs(runs),
        name=", ".join(run.name for run in runs),
        number=stated.get("report", "number"),
        signatory=stated.get("report", "authorised_by"),
        banner=_describe_origins(runs),
        is_warning=kind not in (MEASURED, IMPORTED),
        facts=_list_facts(runs, stated),
        sections=tuple(sections),
        annex=drop_empty(*annex),
        has_annex=not form.is_short,
        has_opinions=not form.is_for_customer,
        method=_cite_method(runs, stated),
        reference=stated.get("report", "reference") or PAPER,
        has_damping=any(item.paper.damping_ratio.is_known for item in samples),
        has_models=any(item.models for run in runs for item in run.campaign.samples),
        has_expected=any(any(tables.count_expected(run.campaign.results)) for run in runs),
        laws=frozenset(form for law in laws for form in law.form.split(" + ") if form),
    )


def _cite_method(
    runs: Sequence[ReportedCampaign], stated: Particulars
) -> tuple[tuple[str, str], ...]:
    """Return the method as a customer cites it, and which values are its results."""
    method = stated.get("report", "method") or "of the laboratory, without a number"
    cited = stated.get("report", "reference") or PAPER
    results = [run.campaign.results for run in runs]
    units = dict.fromkeys(item.setup.analysis.pulse_factor for item in results)
    factor = " or ".join(f"{value:g}" for value in units)
    result = (
        f"Contact time τp = {factor} w50, of the mean pulse's width at half its height; stiffness"
        " k by τp and the masses; damping c of the sample. One value of each is the result, and"
        " stands in the first table. Values by other methods (pulse shape, contact law, free"
        " decay, momenta) are additional."
    )
    return (
        ("Method", f"{method}, after [1]: {cited}."),
        ("Validated by", stated.get("report", "validated")),
        ("Results", result),
        ("Uncertainty", UNCERTAINTY),
    )


def _leave_out_printed(run: ReportedCampaign) -> ReportedCampaign:
    """Return a run without the models as printed, where the driven one is nearer."""
    samples = tuple(map(leave_out_printed, run.campaign.samples))
    return replace(run, campaign=replace(run.campaign, samples=samples))


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


def _list_facts(
    runs: Sequence[ReportedCampaign], stated: Particulars
) -> tuple[tuple[str, str], ...]:
    """Return the facts below the title: what a person states, and of the runs."""
    results = [run.campaign.results for run in runs]
    rigs = dict.fromkeys(item.setup.name for item in results if item.setup.name)
    return (
        *stated.list_facts("laboratory"),
        *_list_stated(runs, stated),
        ("Run", ", ".join(run.name for run in runs)),
        ("Rig", ", ".join(rigs)),
        ("Tested on", _date_tests(runs[0], stated)),
    )


def _list_stated(
    runs: Sequence[ReportedCampaign], stated: Particulars
) -> Iterator[tuple[str, str]]:
    """Return what is stated of the report, without what the run says otherwise."""
    decided = [str(label) for run in runs for label, _ in run.campaign.overrules]
    by_hand = ", ".join(dict.fromkeys(decided))
    for entry in REPORT:
        text = stated.get("report", entry.key)
        if entry.key == "deviations" and text and by_hand:
            text += f", beside the hits on which a person decided: {by_hand}"
        if entry.key == "specification" and not text:
            text = "not stated" if any(stated.limits.values()) else "none: no conformity is stated"
        if text and entry.key not in ("tested", "method", "reference", "validated"):
            yield entry.label, text


def _date_tests(run: ReportedCampaign, stated: Particulars) -> str:
    """Return when it was: by the recording; what a person says otherwise stands beside it."""
    start = run.provenance.start_time if run.provenance is not None else 0
    recorded = format_date(start, run.campaign.results.origin)
    tested = stated.get("report", "tested")
    first, last = find_test_days(run.provenance)
    if not (tested and recorded) or first <= tested <= last:
        return recorded or tested or "date not known"
    return f"{recorded} by the recording, {tested} as stated"
