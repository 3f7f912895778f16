"""The whole report of one run or several."""

from collections.abc import Callable, Sequence

from impact_rig.core.origin import IMPORTED, MEASURED, join_origins
from impact_rig.present.report.comparison import make_comparison_section
from impact_rig.present.report.document import Document, Facts, Section
from impact_rig.present.report.run import make_run_sections, make_warnings_section
from impact_rig.present.report.setup import format_time, is_dated
from impact_rig.results.remarks import describe_origin
from impact_rig.results.run import Run

TITLE = "Impact test report"
GUIDE = {
    "±": (
        "The half-width of the interval that holds the true value with a probability of 95 %"
        " (expanded uncertainty U, GUM). u is a standard uncertainty. A value is rounded to"
        " the second digit of its uncertainty."
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
        " they stand in the paper. “identified”: the variant that fits both traces best."
    ),
    "Paper, reference": (
        "The published value of the same sample, or the value that the rig's set-up expects."
        " The difference is measured minus expected, in percent of the expected."
    ),
    "Hits left out": (
        "A hit is judged before it counts: overload, double hit, too weak, truncated, no"
        " pulse, dead channel, gap, outlier of its sample. A person can overrule that."
    ),
}
"""How to read the report, for people who were not there: signs, methods and words."""


def make_report(
    runs: Sequence[Run],
    unread: Sequence[str] = (),
    report: Callable[[int], None] = lambda _: None,
    *,
    with_simulators: bool = False,
) -> Document:
    """Tell of runs: of one by itself; of several a comparison first, then each.

    Parameters
    ----------
    runs : sequence of Run
        At least one; the others are held against the first.
    unread : sequence of str
        Why others are not in it, a sentence each.
    report : callable, optional
        Told how many runs are done, after each.
    with_simulators : bool
        With a chapter on the contacts in simulators for each run.

    Raises
    ------
    ParameterError
        If a run names a sample that is not in its set-up.
    """
    kind = join_origins(run.campaign.results.origin for run in runs).kind
    sections = [make_warnings_section(runs, unread)]
    if len(runs) == 1:
        sections += make_run_sections(runs[0], with_simulators=with_simulators)
        report(1)
    else:
        sections.append(make_comparison_section(runs))
        for number, run in enumerate(runs, start=1):
            inner = make_run_sections(run, with_simulators=with_simulators)
            title = f"Run {number}: {run.name}"
            sections.append(Section(title, (), (make_warnings_section([run]), *inner)))
            report(number)
    return Document(
        title=TITLE if kind == MEASURED else f"{TITLE}: {kind}",
        subtitle=_describe_rigs(runs),
        name=", ".join(run.name for run in runs),
        banner=_tell_origins(runs),
        is_warning=kind not in (MEASURED, IMPORTED),
        facts=_list_facts(runs),
        sections=(*sections, Section("How to read this", (Facts(tuple(GUIDE.items())),))),
    )


def _tell_origins(runs: Sequence[Run]) -> str:
    """Return where the numbers come from, run by run where there are several."""
    told = [describe_origin(hit.origin for hit in run.campaign.results.hits) for run in runs]
    if len(runs) == 1:
        return told[0]
    return " ".join(f"{run.name}: {text}" for run, text in zip(runs, told, strict=True))


def _describe_rigs(runs: Sequence[Run]) -> str:
    setups = [run.campaign.results.setup for run in runs]
    described = dict.fromkeys(setup.description or setup.name for setup in setups)
    text = "; ".join(item for item in described if item)
    return text[:1].upper() + text[1:]


def _list_facts(runs: Sequence[Run]) -> tuple[tuple[str, str], ...]:
    """Return the few facts that belong beside the title."""
    results = [run.campaign.results for run in runs]
    rigs = dict.fromkeys(item.setup.name for item in results if item.setup.name)
    names = dict.fromkeys(sample.name for item in results for sample in item.samples)
    hits = sum(len(item.hits) for item in results)
    left_out = sum(len(item.rejections) for item in results)
    facts = [
        ("Run" if len(runs) == 1 else "Runs", ", ".join(run.name for run in runs)),
        ("Rig", ", ".join(rigs)),
        ("Recorded", _format_dates(runs)),
        ("Samples", str(len(names))),
        ("Hits in the means", f"{hits - left_out} of {hits}"),
    ]
    return tuple((name, text) for name, text in facts if text)


def _format_dates(runs: Sequence[Run]) -> str:
    """Return the days of the recordings, and the moment where there is one run."""
    found = [run.provenance for run in runs if run.provenance]
    known = sorted(format_time(item.start_time) for item in found if is_dated(item))
    if not known:
        return "date not known"
    if len(runs) == 1:
        return known[0]
    days = list(dict.fromkeys(text.partition(" ")[0] for text in known))
    return days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
