"""Hits accepted or rejected by hand, whatever the analysis says of them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from impact_rig.core.errors import ParameterError
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.signals.record import HitLabel


@dataclass(frozen=True)
class Overrules:
    """Hits accepted or rejected by hand.

    Attributes
    ----------
    accepted, rejected : frozenset of HitLabel
        In the mean whatever the analysis says, and not in it.
    """

    accepted: frozenset[HitLabel] = frozenset()
    rejected: frozenset[HitLabel] = frozenset()

    def __post_init__(self) -> None:
        """Refuse a hit that is named in both."""
        for label in self.accepted & self.rejected:
            raise ParameterError(
                f"hit {describe_label(label)} is both accepted and rejected by hand: choose one"
            )


NO_OVERRULES = Overrules()
"""No hit is accepted or rejected by hand."""


def describe_label(label: HitLabel) -> str:
    """Return ``17 (steel small/3.1)``: record, sample, impact and attempt."""
    return f"{label.record} ({label.sample}/{label.impact}.{label.attempt})"


def find_label(name: str, labels: Collection[HitLabel]) -> HitLabel:
    """Find a hit by name.

    Parameters
    ----------
    name : str
        The number of its record, or ``SAMPLE/IMPACT`` where there was one attempt, or
        ``SAMPLE/IMPACT.ATTEMPT``.
    labels : collection of HitLabel
        Of all hits.

    Raises
    ------
    ParameterError
        If no hit is called so, or several are.
    """
    found = [label for label in dict.fromkeys(labels) if _is_called(label, name)]
    if len(found) == 1:
        return found[0]
    if found:
        raise ParameterError(
            f"hit {name!r} may be any of {', '.join(map(describe_label, found))}: name one of"
            " them, by its record or as SAMPLE/IMPACT.ATTEMPT"
        )
    records = sorted({label.record for label in labels})
    known = f"records {records[0]} to {records[-1]}" if records else "none"
    raise ParameterError(
        f"there is no hit {name!r}: name one by the number of its record or as SAMPLE/IMPACT or"
        f" SAMPLE/IMPACT.ATTEMPT, for example 17 or 'steel small/3.1'; there are {known}"
    )


def make_overrules(
    accept: Sequence[str], reject: Sequence[str], labels: Collection[HitLabel]
) -> Overrules:
    """Return overrules of hits by name; see `find_label` and `Overrules` for errors."""
    return Overrules(
        frozenset(find_label(name, labels) for name in accept),
        frozenset(find_label(name, labels) for name in reject),
    )


def overrule_hit(hit: JudgedHit, overrules: Overrules) -> JudgedHit:
    """Return a hit as it is accepted or rejected by hand.

    Raises
    ------
    ParameterError
        If a hit is to be accepted that has no pulse that could be measured, or the other sign.
    """
    if hit.label in overrules.rejected:
        return replace(
            hit, rejections=(*hit.rejections, Rejection(Reason.OPERATOR, "left out by hand"))
        )
    if hit.label not in overrules.accepted:
        return hit
    if hit.filtered is None:
        why = "; ".join(map(str, hit.rejections))
        raise ParameterError(
            f"hit {describe_label(hit.label)} cannot be accepted by hand: it has no pulse that"
            f" could be measured ({why})"
        )
    if any(item.reason is Reason.POLARITY for item in hit.rejections):
        raise ParameterError(
            f"hit {describe_label(hit.label)} cannot be accepted by hand: a mean of both signs is"
            " of neither; --polarity auto turns it"
        )
    confirmed = Rejection(Reason.OPERATOR, "accepted by hand")
    return replace(hit, rejections=(), overruled=(*hit.rejections, confirmed))


def describe_overruled(hit: JudgedHit, name: str) -> str:
    """Say that the hit called `name` is in the mean by hand, and what was against it."""
    against = "; ".join(
        str(rejection) for rejection in hit.overruled if rejection.reason is not Reason.OPERATOR
    )
    what = f"although {against}" if against else "with nothing against it"
    return f"{name} accepted by hand, {what}"


def _is_called(label: HitLabel, name: str) -> bool:
    place = f"{label.sample}/{label.impact}"
    return name in (str(label.record), place, f"{place}.{label.attempt}")
