"""Hits that a person names, accepts or rejects."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Finding, Reason, join_findings
from impact_rig.core.given.quantity import INTERNAL
from impact_rig.core.given.records import HitLabel
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.verdict import SHARE_NO_MEAN


class Verdict(IntEnum):
    """A person's verdict on a hit."""

    UNDO = 0  # as the analysis judges it
    ACCEPT = 1
    REJECT = 2


@dataclass(frozen=True)
class Overrule:
    """A person's verdict on a hit, before that of the analysis."""

    record: int  # the arming that the hit belongs to
    verdict: Verdict
    reason: str = ""  # in the person's words
    who: str = ""  # empty: not given
    # When it was taken [ns since the epoch]; 0: not given.
    stamp: int = field(default=0, compare=False, metadata=INTERNAL)

    @property
    def decision(self) -> str:
        """The person's decision."""
        return _DECISIONS[self.verdict]

    @property
    def finding(self) -> Finding:
        """The decision as a finding in the hit."""
        by, why = f", by {self.who}" * bool(self.who), f": {self.reason}" * bool(self.reason)
        return Finding(Reason.OPERATOR, f"{self.decision}{by}{why}")


_DECISIONS = {
    Verdict.UNDO: "left to the analysis again",
    Verdict.ACCEPT: "accepted by hand",
    Verdict.REJECT: "left out by hand",
}


@dataclass(frozen=True)
class Overrules:
    """Hits that a person accepts or rejects, before the verdicts of the analysis."""

    # As the analysis was asked; they go before what is recorded.
    accepted: frozenset[HitLabel] = frozenset()
    rejected: frozenset[HitLabel] = frozenset()
    reason: str = ""  # for these, in the words of the person
    who: str = ""  # that person; empty: not given
    stamp: int = 0  # when they were decided [ns since the epoch]; 0: not given
    # All on each hit of a campaign, by record; the last one holds.
    recorded: Mapping[int, tuple[Overrule, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a hit that is named in both."""
        for label in self.accepted & self.rejected:
            raise ParameterError(f"hit {label} is both accepted and rejected by hand: choose one")

    def find(self, label: HitLabel) -> Overrule | None:
        """Return the verdict that holds of a hit; None: there is none."""
        return _find_last(self.list_verdicts(label))

    def list_verdicts(self, label: HitLabel) -> list[Overrule]:
        """Return the persons' verdicts on a hit; the last one holds."""
        found = list(self.recorded.get(label.record, ()))
        for labels, verdict in ((self.accepted, Verdict.ACCEPT), (self.rejected, Verdict.REJECT)):
            if label in labels:
                found.append(Overrule(label.record, verdict, self.reason, self.who, self.stamp))
        return found

    def is_decided(self, record: int) -> bool:
        """Return whether a recorded verdict holds of a hit."""
        return _find_last(self.recorded.get(record, ())) is not None

    def add(self, overrule: Overrule) -> "Overrules":
        """Return them with one more."""
        before = self.recorded.get(overrule.record, ())
        return replace(self, recorded={**self.recorded, overrule.record: (*before, overrule)})


def _find_last(verdicts: Sequence[Overrule]) -> Overrule | None:
    """Return the verdict that holds; None: there is none, or it was undone."""
    return verdicts[-1] if verdicts and verdicts[-1].verdict is not Verdict.UNDO else None


NO_OVERRULES = Overrules()
"""No hit is accepted or rejected by hand."""


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
            f"hit {name!r} may be any of {', '.join(map(str, found))}: name one of"
            " them, by its record or as SAMPLE/IMPACT.ATTEMPT"
        )
    records = sorted({label.record for label in labels})
    known = f"records {records[0]} to {records[-1]}" if records else "none"
    raise ParameterError(
        f"there is no hit {name!r}: name one by the number of its record or as SAMPLE/IMPACT or"
        f" SAMPLE/IMPACT.ATTEMPT, for example 17 or 'steel small/3.1'; there are {known}"
    )


def _is_called(label: HitLabel, name: str) -> bool:
    place = f"{label.sample}/{label.impact}"
    return name in (str(label.record), place, f"{place}.{label.attempt}")


def overrule_hit(hit: JudgedHit, overrules: Overrules) -> JudgedHit:
    """Return a hit as it is accepted or rejected by hand.

    One that was recorded as accepted, and cannot be by other settings, is as it is judged.

    Raises
    ------
    ParameterError
        If the analysis is asked to accept a hit that cannot be.
    """
    overrule = overrules.find(hit.label)
    if overrule is None:
        return hit
    if overrule.verdict is Verdict.REJECT:
        return replace(hit, rejections=(*hit.rejections, overrule.finding))
    if (objection := find_objection(hit)) is None:
        return replace(hit, rejections=(), overruled=(*hit.rejections, overrule.finding))
    if hit.label in overrules.accepted:
        raise ParameterError(objection)
    return hit


def find_objection(hit: JudgedHit) -> str | None:
    """Return why a person may not accept a hit by hand; None: a person may."""
    start = f"hit {hit.label} cannot be accepted by hand:"
    if hit.filtered is None:
        why = join_findings(hit.rejections)
        return f"{start} it has no pulse that could be measured ({why})"
    apart = [item for item in hit.rejections if item.reason in SHARE_NO_MEAN]
    return f"{start} it shares no mean with the others ({join_findings(apart)})" if apart else None


def describe_overruled(hit: JudgedHit, name: str) -> str:
    """Say that the hit called `name` is in the mean by hand, and what was against it."""
    *reasons, by_hand = hit.overruled
    what = f"although {join_findings(reasons)}" if reasons else "with nothing against it"
    return f"{name} {by_hand.explanation}, {what}"
