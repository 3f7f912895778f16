"""The control sample from run to run: where rig or sensors change, it shows first."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from statistics import fmean

import numpy as np

from impact_rig.core.quantity import UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.records import MEASURED
from impact_rig.core.trends import FEWEST_HITS, find_trend
from impact_rig.results.batch import BatchCampaign, shorten_paths
from impact_rig.results.numbers import CONTACT_TIME, STIFFNESS, format_number
from impact_rig.results.table import Column, Table, make_table, make_text_column

NOTE = (
    "Half-widths of the 95 % intervals; of their masses and clock all runs share the same part."
    " Check: mass by the traces over that of the free rigid body, less 1; ISO 7626-1 asks for 5 %."
)


@dataclass(frozen=True)
class TrendPoint(Comparable):
    """Results of one campaign on its control sample."""

    run: str
    sample: str  # the control sample
    began: str  # date and time of the first hit, UTC
    origin: str = MEASURED  # of its hits: their kind
    contact_time: Quantity = field(default=UNKNOWN, metadata=describe("s"))
    stiffness: Quantity = field(default=UNKNOWN, metadata=describe("N/m"))
    # Deviation of the operational check [-]; NaN: none was made.
    check_deviation: float = field(default=math.nan, metadata=describe(least=-1.0))


def gather_trend(
    campaigns: Sequence[BatchCampaign],
) -> tuple[tuple[TrendPoint, ...], tuple[str, ...]]:
    """Return the control sample of each campaign in the order of time; why others have none."""
    names = shorten_paths([campaign.recording for campaign in campaigns])
    points, left_out = [], []
    for name, campaign in sorted(zip(names, campaigns, strict=True), key=lambda it: it[1].began):
        results = campaign.results
        samples, estimates = results.setup.samples, {it.name: it for it in results.samples}
        control = estimates.get(samples.control_sample)
        if control is None or not control.impacts_accepted:
            wanted = samples.control_sample
            why = f"no accepted hit on {wanted}" if wanted else "it has no control sample"
            left_out.append(f"{name}: {why}")
            continue
        began = datetime.fromtimestamp(campaign.began / 1e9, UTC)
        deviation = math.nan
        if check := estimates.get(samples.check_sample):
            deviation = check.checks.traced_mass.value / check.checks.stated_mass - 1.0
        points.append(
            TrendPoint(
                name,
                control.name,
                f"{began:%Y-%m-%d %H:%M}",
                results.find_origin(control.name).kind,
                CONTACT_TIME.read(control),
                STIFFNESS.read(control),
                deviation,
            )
        )
    return tuple(points), tuple(left_out)


def tabulate_trend(points: Sequence[TrendPoint]) -> list[Table]:
    """Return a table for each control sample, and whether it changes from run to run."""
    samples = dict.fromkeys(point.sample for point in points)
    return [_tabulate([point for point in points if point.sample == name]) for name in samples]


def _tabulate(points: Sequence[TrendPoint]) -> Table:
    columns = [
        make_text_column("Run", [point.run for point in points]),
        make_text_column("Began, UTC", [point.began for point in points]),
        make_text_column("Origin", [point.origin for point in points]),
    ]
    told = []
    for item, values in (
        (CONTACT_TIME, [point.contact_time for point in points]),
        (STIFFNESS, [point.stiffness for point in points]),
    ):
        header = f"{item.sample_symbol} [{item.unit}]"
        columns.append(Column(header, [item.format(value) for value in values]))
        columns.append(Column("From mean [%]", _compare([value.value for value in values])))
        told.append(f"{item.sample_symbol} {_describe([value.value for value in values])}")
    checks = [format_number(100.0 * point.check_deviation, 2) for point in points]
    columns.append(Column("Check [%]", checks))
    caption = f"Control sample from run to run: {points[0].sample}"
    return make_table(caption, columns, [f"{'; '.join(told)}. {NOTE}"])


def _compare(values: Sequence[float]) -> list[str]:
    """Return how far values are from their mean [%]."""
    known = [value for value in values if math.isfinite(value)]
    mean = fmean(known) if known else math.nan
    return [format_number(100.0 * (value / mean - 1.0), 2) for value in values]


def _describe(values: Sequence[float]) -> str:
    """Return whether values change from the first to the last, more than chance makes."""
    known = np.array([value for value in values if math.isfinite(value)])
    if known.size < FEWEST_HITS:
        return f"of {known.size} runs shows no trend, it takes {FEWEST_HITS}"
    change = find_trend(np.log(known))
    if not change:
        return "shows no trend"
    return f"changes by {100.0 * change:+.2g} % from the first run to the last, beyond chance"
