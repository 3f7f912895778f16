"""The control sample from run to run: where rig or sensors change, it shows first."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np
import scipy

from impact_rig.core.estimates.checks import CHAIN_TOLERANCE, Checks
from impact_rig.core.given.quantity import UNKNOWN, Comparable, Quantity, describe
from impact_rig.core.given.records import MEASURED, FloatArray
from impact_rig.results.batch import BatchCampaign, shorten_paths
from impact_rig.results.campaign import HitResults
from impact_rig.results.numbers import (
    CONTACT_TIME,
    STIFFNESS,
    Measurand,
    format_number,
    format_quantity,
)
from impact_rig.results.references import SCATTER_HITS
from impact_rig.results.table import Column, Table, make_optional, make_table, make_text_column

PEAK_RATIO = Measurand("ratio of the peaks", "a2/a1", "", 4, "peak_ratio")
FOLLOWED = (CONTACT_TIME, STIFFNESS, PEAK_RATIO)
"""What is followed from run to run; the ratio of both peaks changes with the gains."""
FALSE_ALARM = 0.005
"""Probability of a false alarm among runs in which nothing changed [-], our choice."""
RUN_SCATTER = 0.005
"""Standard deviation of the ratio of both peaks from run to run, over it [-], our choice: sensors
that are mounted anew, and hits beside the axis."""
FEWEST_FOR_DRIFT = 3  # runs [-]: a line goes through any two
NOTE = (
    "±: 95 %; of their masses and clock all runs share the same part. En: difference from the"
    " weighted mean of the other runs, over √(U² + U²); marked where it is more than chance makes"
    " among so many comparisons. a2/a1: peak of the sample over that of the hammer; it changes"
    " where the gain of a sensor does. Check: mass by the traces over that of the free rigid body,"
    " less 1; passed: it lies within the 5 % of ISO 7626-1 with all of its ±."
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
    # Peak of the sample over that of the hammer [-]: both gains are in it.
    peak_ratio: Quantity = field(default=UNKNOWN, metadata=describe(least=0.0))
    # Of the free rigid mass by its traces over that stated, less 1 [-]; none: it was not struck.
    check_deviation: Quantity = field(default=UNKNOWN, metadata=describe(least=-1.0))
    hits: int = SCATTER_HITS  # accepted; below `SCATTER_HITS` their scatter is not known


def gather_trend(
    campaigns: Sequence[BatchCampaign],
) -> tuple[tuple[TrendPoint, ...], tuple[str, ...]]:
    """Return the control sample of each campaign by time, and why some campaigns have none."""
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
        check = estimates.get(samples.check_sample)
        points.append(
            TrendPoint(
                name,
                control.name,
                f"{began:%Y-%m-%d %H:%M}",
                results.find_origin(control.name).kind,
                CONTACT_TIME.read(control),
                STIFFNESS.read(control),
                _compute_peak_ratio(results.select_accepted(control.name)),
                UNKNOWN if check is None else _compute_deviation(check.checks),
                control.impacts_accepted,
            )
        )
    return tuple(points), tuple(left_out)


def _compute_peak_ratio(hits: Sequence[HitResults]) -> Quantity:
    """Return the mean ratio of both peaks, as uncertain as it is from run to run."""
    ratios = np.array([hit.specimen_peak / hit.hammer_peak for hit in hits])
    if not ratios.size or not np.all(np.isfinite(ratios)):
        return UNKNOWN
    mean = float(ratios.mean())
    scatter = float(ratios.std(ddof=1)) / math.sqrt(ratios.size) if ratios.size > 1 else 0.0
    standard = math.hypot(scatter, RUN_SCATTER * mean)
    return Quantity(mean, standard, 1.96 * standard)


def _compute_deviation(checks: Checks) -> Quantity:
    """Return how far the mass by the traces lies from the stated one."""
    traced, stated = checks.traced_mass, checks.stated_mass
    return Quantity(traced.value / stated - 1.0, expanded=traced.expanded / stated)


@dataclass(frozen=True)
class Followed:
    """One quantity from run to run, each run held against all others; NaN: it cannot be."""

    differences: FloatArray  # from the weighted mean of the other runs [-]
    normalized: FloatArray  # En: these over their expanded uncertainty [-]
    limits: FloatArray  # largest differences that chance makes [-]
    drift: float = math.nan  # from the first run to the last by a line [-]
    drift_limit: float = math.nan  # largest one that chance makes [-]

    @property
    def shares(self) -> FloatArray:
        """Differences over what chance makes [-]."""
        return np.abs(self.differences) / self.limits

    @property
    def changed(self) -> list[int]:
        """Places of the runs that differ from the others."""
        return np.flatnonzero(self.shares > 1.0).tolist()

    @property
    def drifts(self) -> bool:
        """Whether there is a drift, and it says more than one run that differs."""
        return abs(self.drift) > self.drift_limit * max(1.0, *np.nan_to_num(self.shares))


def follow(points: Sequence[TrendPoint], item: Measurand) -> Followed:
    """Hold each run against the weighted mean of the others, and a line through all.

    A run's standard uncertainty counts as the root mean square of all at least: a few hits that
    lie close by chance make no change.
    """
    found = [getattr(point, item.field) for point in points]
    known = [
        place
        for place, (it, point) in enumerate(zip(found, points, strict=True))
        if it.is_known and it.standard > 0.0 and point.hits >= SCATTER_HITS
    ]
    differences, normalized, limits = np.full((3, len(points)), math.nan)
    count = len(known)
    if count < 2:  # noqa: PLR2004 - one run and another
        return Followed(differences, normalized, limits)
    values = np.array([found[place].value for place in known])
    standards = np.array([found[place].standard for place in known])
    expanded = np.array([found[place].expanded for place in known])
    freedom = sum(np.nan_to_num(found[place].degrees_of_freedom, nan=math.inf) for place in known)
    chance = FALSE_ALARM / (len(FOLLOWED) * (count + 1))
    factor = float(scipy.special.stdtrit(min(freedom, 1e6), 1.0 - chance / 2.0))
    standards = np.maximum(standards, math.sqrt(float(np.mean(standards**2))))
    weights = standards**-2.0
    for at, place in enumerate(known):
        others = np.arange(count) != at
        mean = float(np.average(values[others], weights=weights[others]))
        error = math.hypot(standards[at], float(weights[others].sum()) ** -0.5)
        apart = math.hypot(expanded[at], float((expanded[others] ** -2.0).sum()) ** -0.5)
        differences[place] = values[at] / mean - 1.0
        normalized[place] = (values[at] - mean) / apart
        limits[place] = factor * error / abs(mean)
    told = Followed(differences, normalized, limits)
    if count < FEWEST_FOR_DRIFT:
        return told
    mean = float(np.average(values, weights=weights))
    number = np.arange(count) - float(np.average(np.arange(count), weights=weights))
    spread = float(weights @ number**2)
    slope = float((weights * number) @ values) / spread / mean
    limit = factor * spread**-0.5 / abs(mean)
    return replace(told, drift=slope * (count - 1), drift_limit=limit * (count - 1))


def tabulate_trend(points: Sequence[TrendPoint]) -> list[Table]:
    """Return a table for each control sample, and whether it changes from run to run."""
    samples = dict.fromkeys(point.sample for point in points)
    return [_tabulate([point for point in points if point.sample == name]) for name in samples]


def _tabulate(points: Sequence[TrendPoint]) -> Table:
    columns = [
        make_text_column("Run", [point.run for point in points]),
        make_text_column("Began, UTC", [point.began for point in points]),
        make_optional("Origin", [point.origin for point in points], is_text=True),
    ]
    told: list[str] = []
    marked: set[int] = set()
    for item in FOLLOWED:
        found = follow(points, item)
        unit = f" [{item.unit}]" if item.unit else ""
        values = [item.format(getattr(point, item.field)) for point in points]
        columns.append(Column(f"{item.sample_symbol}{unit}", values))
        columns.append(Column("En", [format_number(value, 2) for value in found.normalized]))
        marked.update(found.changed)
        told.append(f"{item.sample_symbol} {describe_course(found, points)}.")
    checks = [point.check_deviation for point in points]
    columns.append(Column("Check [%]", [format_quantity(item, 2, 100.0) for item in checks]))
    limits = -CHAIN_TOLERANCE, CHAIN_TOLERANCE
    judged = [item.judge(*limits).value if item.is_known else "" for item in checks]
    columns.append(make_text_column("By ISO 7626-1", judged))
    caption = f"Control sample from run to run: {points[0].sample}"
    return make_table(caption, columns, [*told, NOTE], sorted(marked))


def describe_course(found: Followed, points: Sequence[TrendPoint]) -> str:
    """Return whether a quantity changes, and which change would have been told."""
    if found.drifts:
        return (
            f"changes by {100.0 * found.drift:+.2g} % from the first run to the last by a line,"
            f" more than the {100.0 * found.drift_limit:.2g} % that chance makes"
        )
    if found.changed:
        worst = int(np.nanargmax(found.shares))
        return (
            f"of {points[worst].run} lies {100.0 * found.differences[worst]:+.2g} % off the mean"
            f" of the other runs, more than the {100.0 * found.limits[worst]:.2g} % that chance"
            " makes"
        )
    limits = found.limits[np.isfinite(found.limits)]
    if not limits.size:
        return f"is not followed: it takes two runs with {SCATTER_HITS} hits or more"
    text = f"shows no change: one of {100.0 * limits[-1]:.2g} % in the last run would be told"
    if math.isfinite(found.drift_limit):
        text += f", and a drift of {100.0 * found.drift_limit:.2g} % over all runs"
    return text
