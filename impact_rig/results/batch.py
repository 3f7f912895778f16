"""Many recordings in one table, and how far they lie apart."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from impact_rig.core.estimates.ringing import BY_FREE_DECAY
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.uncertainty import PULSE_SHAPE, leave_out
from impact_rig.core.given.quantity import Quantity
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    HAMMER_MEASURANDS,
    HAMMER_NAME,
    MISSING,
    SAMPLE_MEASURANDS,
    Measurand,
    format_number,
    is_beyond_rounding,
)
from impact_rig.results.references import shows_scatter
from impact_rig.results.table import (
    Column,
    Table,
    list_table,
    make_optional,
    make_table,
    make_text_column,
)

ENOUGH_RECORDINGS = 3
"""Fewest recordings for which a spread is shown [-], our choice."""
NOTE = (
    "Half-widths of the 95 % intervals. Recordings of one rig share masses and clock, and with"
    " them a part of these."
)
SPREAD_NOTE = (
    "Mean of the recordings' values, each counted once, and their standard deviation in percent"
    " of it."
)


CHANGE_NOTE = (
    "En is the difference over its expanded uncertainty √(U1² + U2²), not known where a value is"
    " of fewer than four hits. Marked: |En| above 1, the value changed by more than its"
    " uncertainty explains. What one method gets wrong in both runs alike is no part of that."
    " Masses and clock that both runs share cancel in the difference, so that a change has to be"
    " larger than need be to be marked. Of many comparisons without any change, one in twenty at"
    " most goes beyond 1 by chance."
)


BY_METHOD = {PULSE_SHAPE, BY_FREE_DECAY}
"""Lines of budgets that two values by one method have in common."""


@dataclass(frozen=True)
class BatchCampaign:
    """One campaign of a recording among many."""

    recording: Path  # as a person named it
    number: int  # in its recording, from 1
    results: Results
    began: int = 0  # time of its first hit [ns since the epoch]


def tabulate_batch(campaigns: Sequence[BatchCampaign]) -> list[Table]:
    """Return one row for each recording, campaign and sample, and the spread between them.

    Marked are samples with rejected hits.
    """
    names = shorten_paths([campaign.recording for campaign in campaigns])
    several = any(campaign.number > 1 for campaign in campaigns)
    rows = [
        (f"{name}, {campaign.number}" if several else name, campaign.results, sample)
        for name, campaign in zip(names, campaigns, strict=True)
        for sample in campaign.results.samples
    ]
    places = [place for place, _, _ in rows]
    shown = ["" if place == before else place for before, place in pairwise(["", *places])]
    kinds = [results.find_origin(sample.name).kind for _, results, sample in rows]
    columns = [
        make_text_column("Recording, campaign" if several else "Recording", shown),
        make_text_column("Sample", [sample.name for _, _, sample in rows]),
        make_text_column("Origin", kinds if len(set(kinds)) > 1 else [""] * len(kinds)),
        make_optional(
            "Hits",
            [
                f"{it.impacts_accepted} of {it.impacts_accepted + it.impacts_rejected}"
                for _, _, it in rows
            ],
        ),
    ]
    columns += [
        Column(_make_header(item), [item.format(item.read(sample)) for _, _, sample in rows])
        for item in SAMPLE_MEASURANDS
    ]
    marked = [place for place, (_, _, sample) in enumerate(rows) if sample.impacts_rejected]
    spread = _tabulate_spread([sample for _, _, sample in rows])
    return [make_table("Recordings", columns, [NOTE], marked), *spread]


def tabulate_changes(first: BatchCampaign, second: BatchCampaign) -> list[Table]:
    """Return the changes from one run to another, and whether they exceed their uncertainty.

    Empty where the runs have no quantity of a sample in common. A value changed where |En| is
    above 1, ISO 13528, 9.7, with U at 95 %.
    """
    seconds = {sample.name: sample for sample in second.results.samples}
    bodies: list[tuple[str, Sequence[Measurand], Any, Any]] = [
        (sample.name, SAMPLE_MEASURANDS, sample, seconds[sample.name])
        for sample in first.results.samples
        if sample.name in seconds
    ]
    bodies.append((HAMMER_NAME, HAMMER_MEASURANDS, first.results.hammer, second.results.hammer))
    rows: list[tuple[str, ...]] = []
    marked = []
    for name, measurands, one, other in bodies:
        for item in measurands:
            old, new = item.read(one), item.read(other)
            if not (old.is_known and new.is_known):
                continue
            # By one method both are off by the same; else as if they had nothing in common.
            sources = ({line.source for line in it.budget} for it in (old, new))
            one_method = BY_METHOD.intersection(*sources)
            alike = [leave_out(it, one_method.__contains__) for it in (old, new)]
            expanded = math.hypot(
                alike[0].compute_half_width(new.value), alike[1].compute_half_width(old.value)
            )
            difference = Quantity(new.value - old.value, expanded=expanded)
            is_whole = all(shows_scatter(run.results, name, item) for run in (first, second))
            is_known = is_whole and is_beyond_rounding(expanded, new.value)
            ratio = difference.value / expanded if is_known else math.nan
            if abs(ratio) > 1.0:
                marked.append(len(rows))
            values = map(item.format, (old, new, difference))
            header = f"{item.symbol} [{item.unit}]"
            rows.append((name, header, *values, format_number(ratio, 2)))
    if not rows:
        return []
    names = shorten_paths([first.recording, second.recording])
    counted = f"{len(marked)} of {len(rows)} values changed beyond their uncertainty."
    headers = ("Body", "Quantity", "First", "Second", "Difference", "En")
    columns = [
        Column(header, cells, is_text=header in ("Body", "Quantity"))
        for header, cells in zip(headers, zip(*rows, strict=True), strict=True)
    ]
    caption = "Changes" if names[0] == names[-1] else f"Changes from {names[0]} to {names[1]}"
    return [make_table(caption, columns, [counted, CHANGE_NOTE], marked)]


def shorten_paths(paths: Sequence[Path]) -> list[str]:
    """Return distinct names of paths, without the folders and the file name that all share."""
    if len(set(paths)) < 2:  # noqa: PLR2004 - a single path
        return [path.name for path in paths]
    parents = [path.parent for path in paths]
    if len({path.name for path in paths}) == 1:
        return shorten_paths(parents)
    common = os.path.commonpath([parent.absolute() for parent in parents])
    return [str(path.absolute().relative_to(common)) for path in paths]


def _make_header(measurand: Measurand) -> str:
    return f"{measurand.sample_symbol} [{measurand.unit}]"


def _tabulate_spread(samples: Sequence[SampleEstimate]) -> list[Table]:
    by_name: dict[str, list[SampleEstimate]] = {}
    for sample in samples:
        by_name.setdefault(sample.name, []).append(sample)
    enough = {name: found for name, found in by_name.items() if len(found) >= ENOUGH_RECORDINGS}
    columns = [
        make_text_column("Sample", list(enough)),
        Column("n", [str(len(found)) for found in enough.values()]),
    ]
    for measurand in SAMPLE_MEASURANDS:
        cells = [_describe_spread(measurand, found) for found in enough.values()]
        columns += [
            Column(_make_header(measurand), [mean for mean, _ in cells]),
            Column("s [%]", [spread for _, spread in cells]),
        ]
    return list_table("Between the recordings", columns, [SPREAD_NOTE])


def _describe_spread(measurand: Measurand, samples: Sequence[SampleEstimate]) -> tuple[str, str]:
    """Return mean and relative standard deviation of the values that are determined."""
    values = [found.value for found in map(measurand.read, samples) if found.is_known]
    if len(values) < ENOUGH_RECORDINGS:
        return MISSING, MISSING
    mean = fmean(values)
    return (
        format_number(mean * measurand.scale, measurand.digits),
        format_number(100.0 * stdev(values) / abs(mean), 2),
    )
