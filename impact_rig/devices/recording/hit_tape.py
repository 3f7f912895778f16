"""Which hit of a recording comes next."""

from collections.abc import Sequence
from pathlib import Path

from impact_rig.core.errors import DeviceError
from impact_rig.core.signals.record import HitLabel
from impact_rig.recording.reading.hit_index import IndexedHit


class HitTape:
    """The hits of one recorded campaign, each handed out once.

    Parameters
    ----------
    path : Path
        Of the recording, for messages.
    hits : sequence of IndexedHit
        In the order in which they were recorded.
    """

    def __init__(self, path: Path, hits: Sequence[IndexedHit]) -> None:
        self._path = path
        self._hits = tuple(hits)
        self._used: set[IndexedHit] = set()

    def __len__(self) -> int:
        """Return how many hits there are, used or not."""
        return len(self._hits)

    def rewind(self) -> None:
        """Hand out all hits again."""
        self._used.clear()

    def find_left(self, sample: str) -> tuple[IndexedHit, ...]:
        """Return the hits of a sample that have not been used.

        Raises
        ------
        DeviceError
            If there is none.
        """
        hits = [hit for hit in self._hits if hit.label.sample == sample]
        left = tuple(hit for hit in hits if hit not in self._used)
        if left:
            return left
        if hits:
            raise DeviceError(
                f"recording {self._path} holds no further hit of {sample!r}: it has {len(hits)}"
            )
        known = ", ".join(dict.fromkeys(hit.label.sample for hit in self._hits))
        raise DeviceError(
            f"recording {self._path} holds no hit of {sample!r}: it has hits of {known}"
        )

    def choose(self, label: HitLabel) -> IndexedHit:
        """Return the hit of this sample, impact and attempt, else the sample's next one.

        Raises
        ------
        DeviceError
            If the sample has none left.
        """
        left = self.find_left(label.sample)
        for hit in left:
            if (hit.label.impact, hit.label.attempt) == (label.impact, label.attempt):
                return hit
        return left[0]

    def use(self, hit: IndexedHit) -> None:
        """Take a hit out, because it has been delivered."""
        self._used.add(hit)
