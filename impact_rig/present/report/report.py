"""The whole report of a run."""

from collections.abc import Callable, Sequence

from impact_rig.core.records import IMPORTED, MEASURED, join_origins
from impact_rig.present.report.document import Document, Facts, Section
from impact_rig.present.report.run import make_run_sections
from impact_rig.present.report.setup import format_date
from impact_rig.results.remarks import describe_origin
from impact_rig.results.traces import Run

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
        " they stand in the paper. “identified”: “driven”, fitted to both traces."
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


def make_report(runs: Sequence[Run], report: Callable[[int], None] = lambda _: None) -> Document:
    """Return the report of a run.

    Parameters
    ----------
    runs : sequence of Run
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


def _describe_origins(runs: Sequence[Run]) -> str:
    """Return where the numbers come from, run by run where there are several."""
    texts = [describe_origin(hit.origin for hit in run.campaign.results.hits) for run in runs]
    if len(runs) == 1:
        return texts[0]
    return " ".join(f"{run.name}: {text}" for run, text in zip(runs, texts, strict=True))


def _describe_rigs(runs: Sequence[Run]) -> str:
    setups = [run.campaign.results.setup for run in runs]
    described = dict.fromkeys(setup.description or setup.name for setup in setups)
    text = "; ".join(item for item in described if item)
    return text[:1].upper() + text[1:]


def _list_facts(runs: Sequence[Run]) -> tuple[tuple[str, str], ...]:
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
