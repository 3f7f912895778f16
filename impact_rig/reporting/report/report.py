"""The whole report of one run or several."""

from collections.abc import Callable, Sequence

from impact_rig.reporting.report.comparison_content import make_comparison_section
from impact_rig.reporting.report.document import Document, Section
from impact_rig.reporting.report.guide_content import make_guide_section
from impact_rig.reporting.report.remarks_content import make_warnings_section
from impact_rig.reporting.report.run_content import make_run_sections
from impact_rig.reporting.report.setup_content import format_time, is_dated
from impact_rig.results.run import Run

TITLE = "Impact test report"


def make_report(
    runs: Sequence[Run],
    unread: Sequence[str] = (),
    report: Callable[[int], None] = lambda _: None,
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

    Raises
    ------
    ParameterError
        If a run names a sample that is not in its set-up.
    """
    sections = [make_warnings_section(runs, unread)]
    if len(runs) == 1:
        sections += make_run_sections(runs[0])
        report(1)
    else:
        sections.append(make_comparison_section(runs))
        for number, run in enumerate(runs, start=1):
            inner = make_run_sections(run, prefix=f"run-{number}")
            title = f"Run {number}: {run.name}"
            sections.append(Section(title, (), (make_warnings_section([run]), *inner)))
            report(number)
    return Document(
        title=TITLE,
        subtitle=_describe_rigs(runs),
        name=", ".join(run.name for run in runs),
        facts=_list_facts(runs),
        sections=(*sections, make_guide_section()),
    )


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
        ("Measured", _find_dates(runs)),
        ("Samples", str(len(names))),
        ("Hits in the means", f"{hits - left_out} of {hits}"),
    ]
    return tuple((name, text) for name, text in facts if text)


def _find_dates(runs: Sequence[Run]) -> str:
    """Return the days of the measurements, and the moment where there is one run."""
    found = [run.provenance for run in runs if run.provenance]
    known = sorted(format_time(item.start_time) for item in found if is_dated(item))
    if not known:
        return "date not known"
    if len(runs) == 1:
        return known[0]
    days = list(dict.fromkeys(text.partition(" ")[0] for text in known))
    return days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
