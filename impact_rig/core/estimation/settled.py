"""What a reader must know of estimates from more hits than are kept one by one."""

from dataclasses import replace

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.settled_hits import SettledHits


def add_settled(estimate: SampleEstimate, settled: SettledHits) -> SampleEstimate:
    """Say which part of the hits shows the scatter, and whether others should not be there.

    Parameters
    ----------
    estimate : SampleEstimate
        Of one sample.
    settled : SettledHits
        Its hits that are in the mean for good.
    """
    if not settled.count:
        return estimate
    kept = estimate.impacts_accepted - settled.count
    note = (
        f"scatter of {settled.count} hits: they are in the mean for good, and their traces are not"
        f" kept; that of the other {kept}, evenly over the series, stands for all"
    )
    estimate = replace(estimate, notes=(*estimate.notes, note))
    if not settled.outliers:
        return estimate
    side = "longer" if settled.shift > 0.0 else "shorter"
    warning = (
        f"{settled.outliers} of {settled.count} hits that are in the mean for good are outliers by"
        f" now: they make tau_p {abs(settled.shift) * 100:.2g} % {side}"
    )
    return replace(estimate, warnings=(*estimate.warnings, warning))
