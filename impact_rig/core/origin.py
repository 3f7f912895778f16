"""Where numbers come from: measured, simulated or imported, in their source's own words."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from impact_rig.core.errors import ParameterError
from impact_rig.core.quantity import describe

MEASURED, SIMULATED, IMPORTED = "measured", "simulated", "imported"
UNKNOWN_KIND, MIXED = "unknown", "mixed"
KINDS = (MEASURED, SIMULATED, IMPORTED, UNKNOWN_KIND, MIXED)
"""Of several hits that are not of one kind the origin is mixed."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where the numbers of a hit come from.

    Attributes
    ----------
    kind : str
        One of `KINDS`; nothing: unknown.
    source : str
        What delivered them, in its own words.
    file, place : str
        Of an imported hit the file, as it was named, and where in it.
    """

    kind: str = field(default=UNKNOWN_KIND, metadata=describe(written="origin", since=5))
    source: str = field(default="", metadata=describe(written="origin_source", since=5))
    file: str = field(default="", metadata=describe(since=5))
    place: str = field(default="", metadata=describe(since=5))

    def __post_init__(self) -> None:
        """Refuse an unknown kind; a source's words must not steer a terminal."""
        object.__setattr__(self, "kind", self.kind or UNKNOWN_KIND)
        if self.kind not in KINDS:
            raise ParameterError(
                f"the origin of a hit is {self.kind!r}: it must be one of {', '.join(KINDS)}"
            )
        for name in ("source", "file", "place"):
            text = "".join(item if item.isprintable() else "?" for item in getattr(self, name))
            object.__setattr__(self, name, text)

    def __str__(self) -> str:
        """Return kind and source: ``simulated (virtual rig, plant published)``."""
        return f"{self.kind} ({self.source})" if self.source else self.kind


UNSTATED = Origin()
"""Of what says nothing of its origin."""


def join_origins(origins: Iterable[Origin]) -> Origin:
    """Return the origin of several hits together; of mixed kinds the source names each."""
    found = dict.fromkeys(Origin(item.kind, item.source) for item in origins)
    kinds = {item.kind for item in found}
    if len(kinds) == 1:
        return Origin(kinds.pop(), "; ".join(item.source for item in found if item.source))
    return Origin(MIXED, ", ".join(map(str, found))) if found else UNSTATED
