"""Results in a terminal: a campaign, several campaigns, hits of plain traces."""

from collections.abc import Sequence
from itertools import accumulate

from rich.console import Console

from impact_rig.core.given.records import IMPORTED, MEASURED, join_origins
from impact_rig.present.console import ALARM, TITLE, print_item, print_table, print_text
from impact_rig.results.batch import BatchCampaign, tabulate_batch, tabulate_changes
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import format_count
from impact_rig.results.remarks import (
    Remark,
    describe_origin,
    gather_remarks,
    select_attention,
    tabulate_hits,
    tabulate_rejections,
)
from impact_rig.results.tables import tabulate_results, tabulate_summary

MOST_LETTERS = 750
"""Letters of all remarks on the screen [-], ten lines of 80 columns: the most important ones,
each whole; --full shows all."""


def print_screen(console: Console, results: Results, reading: Sequence[str] = ()) -> None:
    """Print a campaign on one screen: origin, one table, remarks.

    Parameters
    ----------
    console : Console
        See `make_console`.
    results : Results
        Results with their set-up, which gives the expected values.
    reading : sequence of str
        Warnings from reading the file.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    print_origin(console, results.hits)
    for table in tabulate_summary(results):
        print_table(console, table)
    remarks = gather_remarks(results, reading)
    shown = _choose_shown(select_attention(remarks))
    if shown:
        print_text(console, "What needs attention", ALARM)
    for remark in shown:
        print_item(console, str(remark))
    if shown:
        console.print()
    text = f"{results.count_hits()}."
    if more := len(remarks) - len(shown):
        text += f" {format_count(more, 'more remark')} with --full."
    print_text(console, text)


def _choose_shown(remarks: Sequence[Remark]) -> Sequence[Remark]:
    """Return the first remarks that have room, one at least."""
    letters = accumulate(len(str(remark)) for remark in remarks)
    return remarks[: max(sum(total <= MOST_LETTERS for total in letters), 1)]


def print_full(console: Console, results: Results, reading: Sequence[str] = ()) -> None:
    """Print all results of a campaign; parameters as `print_screen`.

    The list of rejected hits, which may be long, comes first: the results stay in sight.
    """
    print_origin(console, results.hits)
    files = results.files
    hits = [tabulate_hits(files)] if files else tabulate_rejections(results)
    for table in (*hits, *tabulate_results(results), *tabulate_summary(results)):
        print_table(console, table)
    for remark in gather_remarks(results, reading):
        print_item(console, str(remark))
    print_text(console, f"{results.count_hits()}.")


def print_origin(console: Console, hits: Sequence[HitResults]) -> None:
    """Print the origin of hits, and an empty line."""
    origins = [hit.origin for hit in hits]
    style = TITLE if join_origins(origins).kind in (MEASURED, IMPORTED) else ALARM
    print_text(console, describe_origin(origins), style)
    console.print()


def print_batch(console: Console, campaigns: Sequence[BatchCampaign]) -> None:
    """Print campaigns below each other, or the changes between two."""
    print_origin(console, [hit for campaign in campaigns for hit in campaign.results.hits])
    changes = tabulate_changes(*campaigns) if len(campaigns) == 2 else []  # noqa: PLR2004 - a pair
    for table in changes or tabulate_batch(campaigns):
        print_table(console, table)
