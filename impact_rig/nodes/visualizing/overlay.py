"""Hits of one sample laid over each other: filtered as the estimator does it, if it accepts them.

Nobody publishes filtered traces, which are as large as the recorded ones: they are made again.
Of a long series ever fewer hits are shown, so that neither this node nor a viewer has to hold
thousands of traces.
"""

from collections import Counter, OrderedDict

from impact_rig.core.errors import RigError
from impact_rig.core.hits.hit import judge_hit
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.results.sample_traces import AlignedHit, align_hit

WAITING_HITS = 16
"""Hits that wait for their verdict, and verdicts for their hit, at most [-], our choice: blocks
and verdicts travel apart, but not for long."""
SHOWN_HITS = 100
"""Of one sample, so many hits are shown one by one [-], our choice: more are a black band. Up to
ten times as many every tenth is shown, up to a hundred times every hundredth, and so on: of 10 000
hits 280."""


def is_shown(number: int) -> bool:
    """Whether the hit of this number, counted from 1 for each sample, is shown."""
    step = 1
    while number >= step * SHOWN_HITS:
        step *= 10
    return number % step == 0


class HitOverlay:
    """Brings hits and verdicts together, whichever comes first.

    Parameters
    ----------
    settings : AnalysisSettings
        How hits are found and filtered.
    """

    def __init__(self, settings: AnalysisSettings) -> None:
        self._settings = settings
        self._detector = ImpactDetector(settings)
        self._label: HitLabel | None = None
        self._numbers: Counter[str] = Counter()
        self._hits: OrderedDict[HitLabel, AlignedHit] = OrderedDict()
        self._accepted: OrderedDict[HitLabel, None] = OrderedDict()
        self.fault = ""

    def feed(self, block: Block) -> tuple[AlignedHit, ...]:
        """Take the next block; return the hits that it completes and that are accepted already.

        Hits that are not shown are not looked at, see `is_shown`. One that cannot be filtered is
        not there: `fault` says why.
        """
        if block.label != self._label:
            self._label = block.label
            self._numbers[block.label.sample] += 1
        if not is_shown(self._numbers[block.label.sample]):
            return ()
        shown = []
        try:
            for record in self._detector.feed(block):
                judged = judge_hit(record, self._settings)
                hit = align_hit(judged) if judged.accepted else None
                if hit is None:
                    continue
                if hit.label in self._accepted:
                    shown.append(hit)
                else:
                    self._hits[hit.label] = hit
        except RigError as error:
            self.fault = f"hits are not laid over each other: {error}"
        _forget_oldest(self._hits)
        return tuple(shown)

    def accept(self, label: HitLabel) -> AlignedHit | None:
        """Take the estimator's word that a hit is accepted; return the hit if it is there."""
        hit = self._hits.pop(label, None)
        if hit is None:
            self._accepted[label] = None
            _forget_oldest(self._accepted)
        return hit


def _forget_oldest(waiting: OrderedDict) -> None:
    while len(waiting) > WAITING_HITS:
        waiting.popitem(last=False)
