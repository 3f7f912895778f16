"""What was found, in a terminal: a campaign, many of them, hits from plain traces."""

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.origin import IMPORTED, MEASURED, join_origins
from impact_rig.present.terminal.console import (
    ALARM,
    GOOD,
    TITLE,
    print_item,
    print_result,
    print_text,
)
from impact_rig.results.batch import BatchCampaign, tabulate_batch
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.remarks import (
    Remark,
    describe_origin,
    gather_notes,
    gather_warnings,
    tabulate_rejections,
)
from impact_rig.results.tables import (
    find_largest_differences,
    tabulate_budgets,
    tabulate_results,
)
from impact_rig.results.trace_series import FileResults, tabulate_hits


def print_results(console: Console, results: Results, files: Sequence[FileResults] = ()) -> None:
    """Print everything that a campaign found.

    The list of rejected hits, which may be long, comes first: the results stay in sight.

    Parameters
    ----------
    console : Console
        See `make_console`.
    results : Results
        What was found, and the set-up that the expected values come from.
    files : sequence of FileResults
        Imported hits, each by itself: they take the place of the list of rejected ones.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    print_origin(console, files or results.hits)
    hits = [tabulate_hits(files)] if files else tabulate_rejections(results)
    for table in (*hits, *tabulate_results(results)):
        print_result(console, table)
    print_remarks(console, results.samples, results.hammer)
    _print_summary(console, results)


def print_origin(console: Console, hits: Sequence[HitResults | FileResults]) -> None:
    """Print where the numbers of hits come from, and an empty line."""
    origins = [hit.origin for hit in hits]
    style = TITLE if join_origins(origins).kind in (MEASURED, IMPORTED) else ALARM
    print_text(console, describe_origin(origins), style)
    console.print()


def print_batch(console: Console, campaigns: Sequence[BatchCampaign]) -> None:
    """Print one row for each recording, campaign and sample, and the spread between them."""
    print_origin(console, [hit for campaign in campaigns for hit in campaign.results.hits])
    for table in tabulate_batch(campaigns):
        print_result(console, table)


def print_budgets(
    console: Console, samples: Sequence[SampleEstimate], hammer: HammerEstimate
) -> None:
    """Print the uncertainty budget of every sample, and of the hammer."""
    bodies: list[tuple[str, SampleEstimate | HammerEstimate]] = [
        *((sample.name, sample) for sample in samples),
        ("hammer", hammer),
    ]
    for name, body in bodies:
        for table in tabulate_budgets(name, body):
            print_result(console, table)


def print_remarks(
    console: Console, samples: Sequence[SampleEstimate], hammer: HammerEstimate
) -> None:
    """Print what fitted models leave open, warnings, and what could not be determined."""
    undetermined = [
        Remark(text, sample.name)
        for sample in samples
        if sample.identification is not None
        for text in sample.identification.undetermined
    ]
    for title, style, remarks in (
        ("", "", undetermined),
        ("Warnings", ALARM, gather_warnings(samples)),
        ("Not determined", TITLE, gather_notes(samples, hammer)),
    ):
        if not remarks:
            continue
        if title:
            print_text(console, title, style)
        for remark in remarks:
            print_item(console, f"{remark.about}: {remark.text}")
        console.print()


def _print_summary(console: Console, results: Results) -> None:
    count, rejected = len(results.samples), len(results.rejections)
    accepted = sum(sample.impacts_accepted for sample in results.samples)
    print_text(
        console,
        Text.assemble(
            (f"{count} sample{'s' * (count != 1)}, ", TITLE),
            (f"{accepted} hit{'s' * (accepted != 1)} accepted", GOOD if accepted else ALARM),
            (", ", TITLE),
            (f"{rejected} rejected", ALARM if rejected else TITLE),
            (".", TITLE),
        ),
    )
    largest = find_largest_differences(results)
    if largest:
        parts = (f"{symbol} {percent:.2f} %" for symbol, (percent, _) in largest.items())
        print_text(console, f"Largest differences: {', '.join(parts)}.")
