"""One result where two methods say something of the same: its interval holds both."""

import math
from dataclasses import replace

from impact_rig.core.estimates.paper_estimate import FREE_DECAY, PaperEstimate
from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import BudgetLine, Quantity

BY_FREE_DECAY = "what the free decay says"
"""Line of a budget."""
ONE_PERIOD = 0.25
"""Difference from a period of the decay at which U1 and U2 are one apart [-], our choice: the
contact that still drives the body at U1 makes up to 0.12."""


def reach(found: Quantity, other: Quantity, source: str) -> Quantity:
    """Return a value whose interval reaches what another method says, if both contradict.

    The value stays. The truth lies anywhere between both: half of a rectangle's width over the
    root of 3, which is a line of the budget called `source`. The ± of both must be known.
    """
    apart = other.value - found.value
    reaches = found.compute_half_width(other.value) + other.compute_half_width(found.value)
    if not abs(apart) > reaches:
        return found
    part = abs(apart) / math.sqrt(3.0)
    variance = found.standard**2 + part**2
    kept = found.standard**2 / variance
    lines = [replace(line, share=line.share * kept) for line in found.budget]
    lines.append(BudgetLine(source, "B", part, 1.0 - kept))
    lower, upper = min(found.lower, other.lower), max(found.upper, other.upper)
    return replace(
        found,
        standard=math.sqrt(variance),
        expanded=max(found.value - lower, upper - found.value),
        lower=lower,
        upper=upper,
        degrees_of_freedom=found.degrees_of_freedom / kept**2 if kept else math.inf,
        budget=tuple(sorted(lines, key=lambda line: -line.share)),
    )


def settle_damping(paper: PaperEstimate, decay: FreeDecayEstimate) -> PaperEstimate:
    """Return the paper's estimate with the damping that both methods together tell.

    The log decrement's value stays where one damped oscillation makes the tail, and reaches the
    free decay's. Where c is determined by the free decay alone, it leads.
    """
    if paper.damping_ratio.is_known and (reason := _find_objection(paper, decay)) is not None:
        note = Note(Subject.C2, f"no log decrement, since {reason}")
        paper = replace(paper.without_damping(), notes=(*paper.notes, note))
    if not decay.damping_coefficient.is_known:
        return paper
    if not paper.damping_coefficient.is_known:
        return replace(
            paper,
            damping_ratio=decay.damping_ratio,
            damping_coefficient=decay.damping_coefficient,
            damping_method=FREE_DECAY,
        )
    return replace(
        paper,
        damping_ratio=reach(paper.damping_ratio, decay.damping_ratio, BY_FREE_DECAY),
        damping_coefficient=reach(
            paper.damping_coefficient, decay.damping_coefficient, BY_FREE_DECAY
        ),
    )


def _find_objection(paper: PaperEstimate, decay: FreeDecayEstimate) -> str | None:
    """Return why equation (7b) does not hold of U1 and U2; None: it does, or nothing tells."""
    if decay.has_many_modes:
        return (
            f"one damped oscillation explains only {100.0 * decay.r_squared:.0f} % of the tail: U1"
            " and U2 are of several"
        )
    periods = (paper.second_peak_time - paper.first_peak_time) * decay.frequency
    if abs(periods - 1.0) > ONE_PERIOD:
        return f"U1 and U2 lie {periods:.2g} periods of the free decay apart, not one"
    return None
