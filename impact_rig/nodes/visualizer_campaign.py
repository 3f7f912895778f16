"""The campaign that goes on now, as the topics tell it: results, traces, hits over each other."""

import math
from collections import Counter, deque
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from impact_rig_msgs.msg import (
    HammerEstimate,
    Impact,
    ModelComparison,
    SampleEstimate,
    VirtualImpact,
)
from numpy.typing import NDArray

from impact_rig.core import paper_method, sample
from impact_rig.core.contact_law import NO_LAW, ContactLaw
from impact_rig.core.detection import ImpactDetector
from impact_rig.core.hits import filter_record
from impact_rig.core.records import Block, HitLabel, Record
from impact_rig.core.setup import RigSetup
from impact_rig.nodes.result_messages import hit_results_from_msg
from impact_rig.recordings.messages import from_message, label_from_msg
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.traces import AlignedHit, ModelTraces, SampleTraces, align_hit


def sample_traces_from_msgs(
    comparisons: Sequence[ModelComparison], estimate: SampleEstimate | None
) -> SampleTraces:
    """Return the mean hit of a sample in m/s^2, with the models that were laid onto it.

    Parameters
    ----------
    comparisons : sequence of impact_rig_msgs.msg.ModelComparison
        Of one sample, the newest of each model, the newest of all last; those of another mean
        than this one are left out.
    estimate : impact_rig_msgs.msg.SampleEstimate or None
        Of the same sample.

    Returns
    -------
    SampleTraces
    """
    newest = comparisons[-1]
    peaks = np.array([[newest.hammer_peak], [newest.specimen_peak]])
    mean = _stack(newest.hammer_measured, newest.specimen_measured) * peaks
    models = tuple(
        ModelTraces(
            model=comparison.model,
            traces=_stack(comparison.hammer_model, comparison.specimen_model) * peaks,
            mse_percent=(comparison.mse_hammer_percent, comparison.mse_sample_percent),
        )
        for comparison in comparisons
        if comparison.impacts_accepted == newest.impacts_accepted
        and len(comparison.hammer_model) == mean.shape[1]
    )
    return SampleTraces(
        name=newest.sample,
        sampling_rate=newest.sampling_rate,
        # There from the start of the contact, here from its middle.
        start_time=newest.start_time - newest.contact_time / 2.0,
        mean=mean,
        contact_time=newest.contact_time,
        half_amplitude_width=estimate.half_amplitude_width if estimate else math.nan,
        first_peak_time=estimate.first_peak_time if estimate else math.nan,
        second_peak_time=estimate.second_peak_time if estimate else math.nan,
        models=models,
    )


def _stack(hammer: Any, specimen: Any) -> NDArray[np.float64]:
    """Return two traces of a message, shape (2, n)."""
    traces = [np.frombuffer(memoryview(trace), np.float32) for trace in (hammer, specimen)]
    count = min(trace.size for trace in traces)
    return np.stack([trace[:count] for trace in traces]).astype(np.float64)


SHOWN_HITS = 100
"""Hits of one sample that are shown one by one [-], our choice: more are a black band. Up to ten
times as many every tenth is shown, up to a hundred times every hundredth, and so on: of 10 000
hits 280."""


def is_shown(number: int) -> bool:
    """Whether the hit of this number, counted from 1 for each sample, is shown."""
    step = 1
    while number >= step * SHOWN_HITS:
        step *= 10
    return number % step == 0


Finding: TypeAlias = VirtualImpact | Impact | SampleEstimate | HammerEstimate | ModelComparison
WAITING_RECORDS = 10
"""Records that may wait for the estimator's verdict [-], our choice: in a campaign one does."""
LARGEST_CAMPAIGN = 1000
"""Most hits that tables show, the newest [-]: eight of the paper's campaigns."""


class ShownCampaign:
    """Keeps the newest message about each hit, sample and model of a campaign."""

    def __init__(self, setup: RigSetup, campaign_id: bytes) -> None:
        self.setup = setup
        self.campaign_id = campaign_id
        self._detector = ImpactDetector(setup.analysis)
        self._low_corners = [response.low_corner for response in setup.responses]
        self._records: deque[Record] = deque(maxlen=WAITING_RECORDS)
        self._numbers: Counter[str] = Counter()
        self._shown: set[int] = set()  # records whose traces came
        self._hits: dict[HitLabel, HitResults] = {}
        self._faults: dict[HitLabel, tuple[str, ...]] = {}
        self._hammer: HammerEstimate | None = None
        self._estimates: dict[str, SampleEstimate] = {}
        self._comparisons: dict[str, dict[str, ModelComparison]] = {}

    def align(self, block: Block) -> tuple[AlignedHit, ...]:
        """Take a block; return the good hits that it completes, to be laid over the others."""
        records = tuple(self._detector.feed(block))
        self._records.extend(records)
        return tuple(hit for it in records if (hit := self.align_judged(it.label)) is not None)

    def align_judged(self, label: HitLabel) -> AlignedHit | None:
        """Return a good hit once both its record and its verdict came, in either order.

        Of a long series only some are shown, see `is_shown`.
        """
        verdict = self._hits.get(label)
        record = next((it for it in self._records if it.label == label), None)
        # A flaw is a block that was lost on the way to this node.
        if verdict is None or record is None or not verdict.accepted or record.flaws:
            return None
        self._numbers[label.sample] += 1
        if not is_shown(self._numbers[label.sample]):
            return None
        hit = filter_record(record, self.setup.analysis, self._low_corners)
        return align_hit(label, hit)

    def add(self, message: Finding) -> None:
        """Keep what was found, in place of what was known of the same hit, sample and model."""
        match message:
            case VirtualImpact():
                self._faults[label_from_msg(message)] = tuple(message.faults)
            case Impact():
                label = label_from_msg(message)
                self._hits[label] = hit_results_from_msg(message, self._faults.get(label, ()))
            case SampleEstimate():
                self._estimates[message.name] = message
            case HammerEstimate():
                self._hammer = message
            case ModelComparison():
                models = self._comparisons.setdefault(message.sample, {})
                models.pop(message.model, None)
                models[message.model] = message

    def note_shown(self, label: HitLabel) -> None:
        """Keep that all traces of a record came."""
        self._shown.add(label.record)

    @property
    def missing(self) -> int:
        """How many hits have a verdict but no traces, between the first and the last shown."""
        first, last = min(self._shown, default=0), max(self._shown, default=0)
        judged = {label.record for label in self._hits}
        return sum(first < record < last for record in judged - self._shown)

    @property
    def newest_hit(self) -> HitResults:
        """The hit that was kept last."""
        return next(reversed(self._hits.values()))

    def make_results(self) -> Results:
        """Return what is known now."""
        hammer, estimates = self._hammer, self._estimates
        return Results(
            setup=self.setup,
            hammer=paper_method.HammerEstimate()
            if hammer is None
            else from_message(paper_method.HammerEstimate, hammer),
            samples=tuple(
                from_message(sample.SampleEstimate, estimates[name])
                for name in self.setup.samples.names
                if name in estimates
            ),
            hits=tuple(self._hits.values())[-LARGEST_CAMPAIGN:],
        )

    def make_traces(self, sample: str) -> SampleTraces:
        """Return the traces of one sample as they are known now; errors as they are joined."""
        comparisons = tuple(self._comparisons[sample].values())
        estimate = self._estimates.get(sample)
        return sample_traces_from_msgs(comparisons, estimate)

    def make_law(self, sample: str) -> ContactLaw:
        """Return the contact law of one sample as it is known now."""
        estimate = self._estimates.get(sample)
        return from_message(ContactLaw, estimate.contact_law) if estimate else NO_LAW
