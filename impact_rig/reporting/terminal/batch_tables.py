"""Many recordings in one table, and how far they lie apart."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, stdev

from rich.console import Console

from impact_rig.reporting.terminal.columns import Column, leave_out_repeated, make_optional
from impact_rig.reporting.terminal.console import ALARM, print_table
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_number, format_uncertain

ENOUGH_RECORDINGS = 3
"""From which on a spread says something [-], our choice."""
NOTE = (
    "Half-widths of the 95 % intervals. Recordings of one rig share masses and clock, and with"
    " them a part of these."
)
SPREAD_NOTE = (
    "Mean of the recordings' values, each counted once, and their standard deviation in percent"
    " of it."
)


@dataclass(frozen=True)
class BatchCampaign:
    """One campaign of a recording among many.

    Attributes
    ----------
    recording : Path
        As it was named.
    number : int
        Of the campaign in its recording, from 1.
    results : Results
        What was found.
    """

    recording: Path
    number: int
    results: Results


@dataclass(frozen=True)
class _Quantity:
    header: str
    scale: float
    digits: int
    read: Callable[[SampleResults], float]
    read_expanded: Callable[[SampleResults], float]

    def format(self, sample: SampleResults) -> str:
        return format_uncertain(
            self.read(sample) * self.scale, self.read_expanded(sample) * self.scale, self.digits
        )


QUANTITIES = (
    _Quantity(
        "τp [µs]",
        MICRO,
        2,
        lambda sample: sample.contact_time_s,
        lambda sample: sample.contact_time_expanded_s,
    ),
    _Quantity(
        "k2 [MN/m]",
        MEGA,
        2,
        lambda sample: sample.stiffness_n_per_m,
        lambda sample: sample.stiffness_expanded_n_per_m,
    ),
    _Quantity(
        "c2 [N s/m]",
        1.0,
        1,
        lambda sample: sample.damping_coefficient_n_s_per_m,
        lambda sample: sample.damping_coefficient_expanded_n_s_per_m,
    ),
)


def print_batch(console: Console, campaigns: Sequence[BatchCampaign]) -> None:
    """Print one row for each recording, campaign and sample, and the spread between them.

    Parameters
    ----------
    console : Console
        See `make_console`.
    campaigns : sequence of BatchCampaign
        In the order in which they are to stand.
    """
    names = shorten_paths([campaign.recording for campaign in campaigns])
    several = any(campaign.number > 1 for campaign in campaigns)
    rows = [
        (name, campaign.number, sample)
        for name, campaign in zip(names, campaigns, strict=True)
        for sample in campaign.results.samples
    ]
    places = [f"{name}, {number}" if several else name for name, number, _ in rows]
    hits = [_format_hits(sample) for _, _, sample in rows]
    columns = [
        Column(
            "Recording, campaign" if several else "Recording",
            leave_out_repeated(places),
            is_text=True,
        ),
        Column("Sample", [sample.name for _, _, sample in rows], is_text=True),
        make_optional(
            "Hits",
            hits,
            styles=[ALARM if sample.impacts_rejected else "" for _, _, sample in rows],
        ),
    ]
    columns += [
        Column(quantity.header, [quantity.format(sample) for _, _, sample in rows])
        for quantity in QUANTITIES
    ]
    print_table(console, "Recordings", columns, [NOTE])
    _print_spread(console, [sample for _, _, sample in rows])


def shorten_paths(paths: Sequence[Path]) -> list[str]:
    """Return names that tell paths apart, without the folders and the file name all share."""
    if len(set(paths)) < 2:  # noqa: PLR2004 - one path has nothing to be told from
        return [path.name for path in paths]
    parents = [path.parent for path in paths]
    if len({path.name for path in paths}) == 1:
        return shorten_paths(parents)
    common = os.path.commonpath([parent.absolute() for parent in parents])
    return [str(path.absolute().relative_to(common)) for path in paths]


def _format_hits(sample: SampleResults) -> str:
    total = sample.impacts_accepted + sample.impacts_rejected
    return f"{sample.impacts_accepted} of {total}"


def _print_spread(console: Console, samples: Sequence[SampleResults]) -> None:
    by_name: dict[str, list[SampleResults]] = {}
    for sample in samples:
        by_name.setdefault(sample.name, []).append(sample)
    enough = {name: found for name, found in by_name.items() if len(found) >= ENOUGH_RECORDINGS}
    if not enough:
        return
    columns = [
        Column("Sample", list(enough), is_text=True),
        Column("n", [str(len(found)) for found in enough.values()]),
    ]
    for quantity in QUANTITIES:
        cells = [_describe_spread(quantity, found) for found in enough.values()]
        columns += [
            Column(quantity.header, [mean for mean, _ in cells]),
            Column("s [%]", [spread for _, spread in cells]),
        ]
    print_table(console, "Between the recordings", columns, [SPREAD_NOTE])


def _describe_spread(quantity: _Quantity, samples: Sequence[SampleResults]) -> tuple[str, str]:
    """Return mean and relative standard deviation of the values that are determined."""
    values = [value for value in map(quantity.read, samples) if math.isfinite(value)]
    if len(values) < ENOUGH_RECORDINGS:
        return MISSING, MISSING
    mean = fmean(values)
    return (
        format_number(mean * quantity.scale, quantity.digits),
        format_number(100.0 * stdev(values) / abs(mean), 2),
    )
