"""Hits that a person names, accepts or rejects."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum

from impact_rig.core.errors import ParameterError
from impact_rig.core.findings import Finding, Reason
from impact_rig.core.quantity import INTERNAL
from impact_rig.core.records import HitLabel


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
        return "accepted by hand" if self.verdict is Verdict.ACCEPT else "left out by hand"

    @property
    def finding(self) -> Finding:
        """The decision as a finding in the hit."""
        by, why = f", by {self.who}" * bool(self.who), f": {self.reason}" * bool(self.reason)
        return Finding(Reason.OPERATOR, f"{self.decision}{by}{why}")


@dataclass(frozen=True)
class Overrules:
    """Hits that a person accepts or rejects, before the verdicts of the analysis."""

    # As the analysis was asked; they go before what is recorded.
    accepted: frozenset[HitLabel] = frozenset()
    rejected: frozenset[HitLabel] = frozenset()
    reason: str = ""  # for these, in the words of the person
    who: str = ""  # that person; empty: not given
    stamp: int = 0  # when they were decided [ns since the epoch]; 0: not given
    # The newest of each hit of a campaign, by record.
    recorded: Mapping[int, Overrule] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a hit that is named in both."""
        for label in self.accepted & self.rejected:
            raise ParameterError(f"hit {label} is both accepted and rejected by hand: choose one")

    def find(self, label: HitLabel) -> Overrule | None:
        """Return the verdict that holds of a hit; None: there is none."""
        return next(reversed(self.list_verdicts(label)), None)

    def list_verdicts(self, label: HitLabel) -> list[Overrule]:
        """Return the persons' verdicts on a hit; the last one holds."""
        found = [self.recorded[label.record]] if label.record in self.recorded else []
        for labels, verdict in ((self.accepted, Verdict.ACCEPT), (self.rejected, Verdict.REJECT)):
            if label in labels:
                found.append(Overrule(label.record, verdict, self.reason, self.who, self.stamp))
        return found

    def add(self, overrule: Overrule) -> "Overrules":
        """Return them with one more; an undo takes that of its hit away."""
        others = {key: each for key, each in self.recorded.items() if key != overrule.record}
        if overrule.verdict is not Verdict.UNDO:
            others[overrule.record] = overrule
        return replace(self, recorded=others)


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
