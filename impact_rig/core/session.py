"""A whole session: blocks in, verdicts and estimates out.

The node and the analysis of files run this same code, so that the same hits give bit-identical
numbers.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import chain

from impact_rig.core.estimation.paper_method import BodyEstimate, estimate_hammer
from impact_rig.core.estimation.sample import (
    SampleEstimate,
    add_models,
    estimate_contact_alone,
    estimate_sample,
)
from impact_rig.core.estimation.traces import TraceEstimates, estimate_traces
from impact_rig.core.hits.averaging import MeanHit, average_hits
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.hits.overrule import (
    Overrules,
    describe_label,
    describe_overruled,
    overrule_hit,
)
from impact_rig.core.hits.selection import Selection, check_consistency, select_hits
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel, Record


@dataclass(frozen=True)
class SessionResults:
    """What a session has found so far.

    Attributes
    ----------
    setup : RigSetup
        Masses and settings.
    hammer : BodyEstimate
        k1, zeta1, c1.
    samples : tuple of SampleEstimate
        Those with hits, in the order of the sample set.
    accepted : tuple of JudgedHit
        Every hit that is in a mean, in the order of arrival.
    rejected : tuple of JudgedHit
        Every hit that is in no mean, with all reasons, in the order of arrival: rejected when it
        came, an outlier among its fellows, surplus, or left out by hand.
    """

    setup: RigSetup
    hammer: BodyEstimate
    samples: tuple[SampleEstimate, ...]
    accepted: tuple[JudgedHit, ...]
    rejected: tuple[JudgedHit, ...]


class Session:
    """Judges hits as they come and keeps the estimates of every sample.

    Parameters
    ----------
    setup : RigSetup
        Masses, sample set and settings.
    """

    def __init__(self, setup: RigSetup) -> None:
        self.setup = setup
        self._detector = ImpactDetector(setup.analysis)
        self._overrules = Overrules()
        self._hits: dict[str, list[JudgedHit]] = {}
        self._selections: dict[str, Selection] = {}
        self._means: dict[str, MeanHit] = {}
        self._hammer: tuple[MeanHit, BodyEstimate] | None = None
        self._traces: dict[str, tuple[MeanHit, TraceEstimates]] = {}
        self._results: SessionResults | None = None

    def feed(self, block: Block) -> tuple[JudgedHit, ...]:
        """Take the next block and return the hits that it completed, judged.

        Raises
        ------
        ParameterError
            If the block names a sample that is not in the set, or is sampled too slowly for
            the low-pass.
        """
        self.setup.samples.find(block.label.sample)
        return tuple(self.judge(record) for record in self._detector.feed(block))

    def judge(self, record: Record) -> JudgedHit:
        """Judge one record, also by its fellows so far, and count it in; errors as `feed`.

        What is accepted here may still turn out an outlier, or surplus, once more hits have come.
        """
        self.setup.samples.find(record.label.sample)
        self._results = None
        hit = judge_hit(record, self.setup.analysis)
        hits = self._hits.setdefault(hit.label.sample, [])
        if hit.accepted:
            fellows = [fellow for fellow in hits if fellow.accepted]
            hit = replace(hit, rejections=check_consistency(hit, (*fellows, hit)))
        hits.append(hit)
        self._selections.pop(hit.label.sample, None)
        if hit.accepted:
            self._means.pop(hit.label.sample, None)
        return hit

    def overrule(self, overrules: Overrules) -> None:
        """Put a person's word on hits before the verdicts of the analysis.

        Hits that this session does not have are nobody's concern here.

        Raises
        ------
        ParameterError
            If a hit is to be accepted that has no pulse that could be measured.
        """
        for hits in self._hits.values():
            for hit in hits:
                overrule_hit(hit, overrules)
        self._overrules = overrules
        self._results = None
        self._selections.clear()
        self._means.clear()

    @property
    def labels(self) -> tuple[HitLabel, ...]:
        """Of all hits, sample by sample in the order of arrival."""
        return tuple(hit.label for hits in self._hits.values() for hit in hits)

    @property
    def names(self) -> tuple[str, ...]:
        """Samples with hits, in the order of the sample set."""
        return tuple(name for name in self.setup.samples.names if name in self._hits)

    def estimate_hammer(self) -> BodyEstimate:
        """Return what the control experiment says of the hammer so far."""
        if math.isfinite(self.setup.hammer_stiffness):
            return BodyEstimate(self.setup.hammer_stiffness)
        control = self.setup.samples.control_sample
        if not control:
            return BodyEstimate(notes=("k1: the sample set has no control sample",))
        mean = self.find_mean(control)
        if mean is None:
            note = f"k1: the control sample {control!r} has no accepted hit yet"
            return BodyEstimate(notes=(note,))
        if unknown := self.setup.find_unknown_masses(control):
            return BodyEstimate(notes=(f"k1: the mass of {' and '.join(unknown)} is not known",))
        if self._hammer is None or self._hammer[0] is not mean:
            self._hammer = mean, estimate_hammer(mean, self.setup)
        return self._hammer[1]

    def estimate_sample(self, name: str) -> SampleEstimate:
        """Return what is known of one sample so far, the model not fitted: after every hit."""
        return self._estimate_sample(name, self.estimate_hammer())

    def _estimate_sample(self, name: str, hammer: BodyEstimate) -> SampleEstimate:
        selection = self.find_selection(name)
        rejected = len(selection.left_out)
        mean = self.find_mean(name)
        if mean is None:
            note = f"{name}: not determined, none of {rejected} hits was accepted"
            return SampleEstimate(name, 0, rejected, notes=(note,))
        contact_times = tuple(hit.contact_time for hit in selection.kept)
        if unknown := self.setup.find_unknown_masses(name):
            estimate = self._estimate_without_masses(name, mean, contact_times, unknown)
        else:
            estimate = self._estimate_with_masses(name, mean, contact_times, hammer)
        warnings = tuple(
            describe_overruled(hit, f"hit {describe_label(hit.label)}")
            for hit in selection.kept
            if hit.overruled
        )
        return replace(estimate, warnings=estimate.warnings + warnings)

    def _estimate_without_masses(
        self,
        name: str,
        mean: MeanHit,
        contact_times: tuple[float, ...],
        unknown: tuple[str, ...],
    ) -> SampleEstimate:
        rejected = len(self.find_selection(name).left_out)
        estimate = estimate_contact_alone(name, mean, contact_times, rejected, self.setup.analysis)
        note = f"k and c: the mass of {' and '.join(unknown)} is not known"
        return replace(estimate, notes=(*estimate.notes, note))

    def _estimate_with_masses(
        self,
        name: str,
        mean: MeanHit,
        contact_times: tuple[float, ...],
        hammer: BodyEstimate,
    ) -> SampleEstimate:
        # Another k1, as each hit on the control sample brings one, changes nothing in these.
        if name not in self._traces or self._traces[name][0] is not mean:
            self._traces[name] = mean, estimate_traces(name, mean, self.setup)
        rejected = len(self.find_selection(name).left_out)
        return estimate_sample(
            name, mean, contact_times, rejected, hammer, self.setup, self._traces[name][1]
        )

    def estimate_all(self, report: Callable[[int], None] | None = None) -> SessionResults:
        """Return everything found so far, the model fitted to every sample.

        Asked again before another hit has come, it costs nothing.

        Parameters
        ----------
        report : callable, optional
            Is told after each sample how many are done.
        """
        if self._results is not None:
            return self._results

        def estimate(name: str, hammer: BodyEstimate) -> SampleEstimate:
            found = self._estimate_with_models(name, hammer)
            if report is not None:
                report(self.names.index(name) + 1)
            return found

        self._results = self._gather(estimate)
        return self._results

    def estimate_all_without_models(self) -> SessionResults:
        """Return the same without the fitted models, which take most of the time."""
        return self._gather(self._estimate_sample)

    def _gather(self, estimate: Callable[[str, BodyEstimate], SampleEstimate]) -> SessionResults:
        hammer = self.estimate_hammer()
        selections = [self.find_selection(name) for name in self._hits]
        return SessionResults(
            setup=self.setup,
            hammer=hammer,
            samples=tuple(estimate(name, hammer) for name in self.names),
            accepted=_sort_hits(selection.kept for selection in selections),
            rejected=_sort_hits(selection.left_out for selection in selections),
        )

    def _estimate_with_models(self, name: str, hammer: BodyEstimate) -> SampleEstimate:
        estimate, mean = self._estimate_sample(name, hammer), self.find_mean(name)
        if mean is None or self.setup.find_unknown_masses(name):
            return estimate
        return add_models(estimate, mean, hammer, self.setup)

    def find_mean(self, name: str) -> MeanHit | None:
        """Return the mean hit of one sample so far; None: no hit was accepted."""
        if name not in self._means:
            filtered = [hit.filtered for hit in self.find_selection(name).kept if hit.filtered]
            if not filtered:
                return None
            self._means[name] = average_hits(filtered)
        return self._means[name]

    def find_selection(self, name: str) -> Selection:
        """Return which hits of one sample are averaged so far, and which are left out."""
        if name not in self._selections:
            hits = [overrule_hit(hit, self._overrules) for hit in self._hits.get(name, [])]
            self._selections[name] = select_hits(hits, self.setup.analysis.keep_hits)
        return self._selections[name]


def _sort_hits(groups: Iterable[tuple[JudgedHit, ...]]) -> tuple[JudgedHit, ...]:
    return tuple(sorted(chain.from_iterable(groups), key=lambda hit: hit.label.record))
