"""A whole session: blocks in, verdicts and estimates out.

The node and the analysis of files run this same code, so that the same hits give bit-identical
numbers.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from impact_rig.core.estimates.checks import ask_for_mass
from impact_rig.core.estimates.mean_reading import UNSEEN, MeanReading, read_mean_hit
from impact_rig.core.estimates.paper_method import HammerEstimate, estimate_hammer, estimate_paper
from impact_rig.core.estimates.ringing import NO_DECAY
from impact_rig.core.estimates.sample import (
    SampleEstimate,
    SampleParts,
    TraceEstimates,
    assemble_samples,
    estimate_traces,
)
from impact_rig.core.estimates.speed_exponents import SpeedExponents, estimate_speed_exponents
from impact_rig.core.estimates.uncertainty import RigInputs
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import SIMULATED, Block, HitLabel, PackedRecord, Record
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.detection import ImpactDetector
from impact_rig.core.hit.judging import FilteredHit, JudgedHit, judge_hit
from impact_rig.core.hit.overrules import (
    NO_OVERRULES,
    Overrule,
    Overrules,
    Verdict,
    describe_overruled,
    find_objection,
    overrule_hit,
)
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.core.mean.series import HitCount, HitSeries, Selection


@dataclass(frozen=True)
class SessionResults:
    """The results of a session so far; the hits are without their traces."""

    setup: RigSetup
    hammer: HammerEstimate
    samples: tuple[SampleEstimate, ...]  # those with hits, in the order of the sample set
    accepted: tuple[JudgedHit, ...]  # hits in the means, in the order of arrival
    rejected: tuple[JudgedHit, ...]  # all others, with every reason, in the order of arrival
    speed_exponents: tuple[SpeedExponents, ...] = ()  # of samples struck from several angles


NO_CONTROL = Note(
    Subject.K1,
    "no control sample, which is alike to the hammer, and no stiffness of the hammer is stated:"
    " k_eq is given, and neither k nor c of a sample",
)
"""Properties to be stated for k and c."""


class Session:
    """Judges hits as they come and keeps the estimates of every sample.

    Verdicts and packed records of all hits stay in memory; see `HitSeries`. Overrules go before
    the verdicts of the analysis; those for unknown hits are ignored. What is one uncertain
    input and what is two is decided here: a rig's are made once, a mean hit is read once.
    """

    def __init__(self, setup: RigSetup, overrules: Overrules = NO_OVERRULES) -> None:
        self.setup = setup
        self._records: dict[str, list[PackedRecord]] = {}  # of each sample, to be judged again
        self._detector = ImpactDetector(setup.analysis)
        self._overrules = overrules
        self._series: dict[str, HitSeries] = {}
        self._labels: dict[int, HitLabel] = {}  # of the hits so far, by the hash of their points
        self._traces: dict[str, tuple[MeanHit, TraceEstimates]] = {}
        self._inputs = RigInputs(setup)
        self._readings: dict[str, MeanReading] = {}
        self._hammers: dict[str, tuple[MeanReading, HammerEstimate]] = {}
        self._estimated: tuple[SampleEstimate, ...] = ()

    def feed(self, block: Block) -> tuple[JudgedHit, ...]:
        """Take the next block and return the hits that it completed, judged.

        Raises
        ------
        ParameterError
            If the block names a sample that is not in the set, or a hit is to be accepted by
            hand that cannot be.
        """
        return tuple(hit for _, hit in self.feed_records(block))

    def feed_records(self, block: Block) -> tuple[tuple[PackedRecord, JudgedHit], ...]:
        """Take the next block as `feed`; return the hits with their records."""
        self.setup.samples.find(block.label.sample)
        found = [(PackedRecord.pack(record), record) for record in self._detector.feed(block)]
        return tuple((packed, self._judge(record, packed)) for packed, record in found)

    def _judge(self, record: Record, packed: PackedRecord) -> JudgedHit:
        """Judge one record, compare it with the hits so far, and count it in.

        What is accepted here may still turn out an outlier once more hits have come.
        """
        self._estimated = ()
        hit = self._judge_alone(record)
        name = hit.label.sample
        self._records.setdefault(name, []).append(packed)
        if name not in self._series:
            self._series[name] = self._make_series(name)
        series = self._series[name]
        hit = overrule_hit(series.check(hit), self._overrules)
        series.add(hit)
        return hit

    def _make_series(self, name: str) -> HitSeries:
        """Return an empty series of a sample, which gets traces again from packed records."""
        records = self._records[name]
        return HitSeries(lambda place: self.filter(records[place].unpack()))

    def filter(self, record: Record) -> FilteredHit | None:
        """Return the filtered traces of a hit again, which are not kept; None: it has no pulse."""
        return self._judge_alone(record).filtered

    def _judge_alone(self, record: Record) -> JudgedHit:
        """Judge one record by itself."""
        judged = judge_hit(record, self.setup.analysis, self.setup.responses)
        judged = replace(judged, origin=record.origin, impact_speed=record.impact_speed)
        return ask_for_mass(self._refuse_copy(record, judged), self.setup)

    def _refuse_copy(self, record: Record, hit: JudgedHit) -> JudgedHit:
        """Reject a hit that equals another point by point: no two measured ones ever do."""
        if hit.filtered is None or record.origin.kind == SIMULATED:
            return hit
        points = np.concatenate((record.hammer.output, record.specimen.output), dtype=np.float64)
        first = self._labels.setdefault(hash(points.tobytes()), hit.label)
        if first == hit.label:
            return hit
        copy = Finding(Reason.COPY, f"it has the points of hit {first}: a copy does not count")
        return replace(hit, rejections=(*hit.rejections, copy))

    @property
    def overrules(self) -> Overrules:
        """Persons' verdicts so far."""
        return self._overrules

    def overrule(self, overrule: Overrule, *, is_asked: bool = True) -> JudgedHit | None:
        """Judge the hits of a sample again, as if a person's verdict on one had been known before.

        Parameters
        ----------
        overrule : Overrule
            On one of the hits.
        is_asked : bool
            False: it was recorded, and holds also for a hit that is still to come.

        Returns
        -------
        JudgedHit or None
            The hit, without its traces; None: it is still to come.

        Raises
        ------
        ParameterError
            If a person asks for what cannot be; nothing has changed then.
        """
        overrules, record = self._overrules.add(overrule), overrule.record
        kept = self._records.items()
        found = [name for name, items in kept for it in items if it.rest.label.record == record]
        if not found and is_asked:
            raise ParameterError(f"the campaign has no hit of record {record}")
        is_undo = overrule.verdict is Verdict.UNDO
        if is_asked and is_undo and not self._overrules.is_decided(record):
            raise ParameterError(f"record {record} is as the analysis judges it: nothing to undo")
        if not found:
            self._overrules = overrules
            return None
        series = self._make_series(found[0])
        for item in self._records[found[0]]:
            checked = series.check(self._judge_alone(item.unpack()))
            is_meant = checked.label.record == record and overrule.verdict is Verdict.ACCEPT
            if is_asked and is_meant and (objection := find_objection(checked)) is not None:
                raise ParameterError(objection)
            series.add(overrule_hit(checked, overrules))
        self._overrules, self._series[found[0]], self._estimated = overrules, series, ()
        selection = series.select()
        hits = selection.kept + selection.left_out
        return next(hit for hit in hits if hit.label.record == record)

    @property
    def names(self) -> tuple[str, ...]:
        """Samples with hits, in the order of the sample set."""
        return tuple(name for name in self.setup.samples.names if name in self._series)

    def is_control(self, name: str) -> bool:
        """Return whether a sample is the control sample of its release angle."""
        return name == self.setup.for_series(name).samples.control_sample

    def estimate_hammer(self, name: str = "") -> HammerEstimate:
        """Return the hammer's estimate from the control experiment so far.

        Parameters
        ----------
        name : str
            Of the sample whose release angle counts; empty: that of the set's control sample.
        """
        setup = self.setup.for_series(name) if name else self.setup
        control = setup.samples.control_sample
        if math.isfinite(setup.hammer_stiffness):
            return HammerEstimate(Quantity(setup.hammer_stiffness), control_sample=control)
        if not control:
            return HammerEstimate(notes=(NO_CONTROL,))
        mean = self.compute_mean(control)
        problem = None if mean is None else self._find_problem(name or control, control)
        if mean is None or problem is not None:
            why = problem or f"the control sample {control!r} has no accepted hit yet"
            return HammerEstimate(notes=(Note(Subject.K1, why),), control_sample=control)
        reading = self._read_mean(control, mean)
        known = self._hammers.get(control)
        # Every hit on every sample asks for it.
        if known is None or known[0] is not reading:
            known = self._hammers[control] = reading, estimate_hammer(reading, setup)
        return known[1]

    def _find_problem(self, name: str, control: str) -> str | None:
        """Return why a control sample with hits does not give k1 for a sample; None: it does."""
        if unknown := self.setup.find_unknown_masses(control):
            return f"the mass of {' and '.join(unknown)} is not known"
        kinds = [series.kind for key in (name, control) if (series := self._series.get(key))]
        origins = [kind.origin for kind in kinds if kind is not None]
        if len(set(origins)) > 1:
            ours, theirs = origins
            return f"the control sample {control!r} has hits that are {theirs}, not {ours}"
        return None

    def _read_mean(self, name: str, mean: MeanHit) -> MeanReading:
        """Return the reading of a sample's mean hit, the same one until another hit changes it."""
        # The newest fit of its pulse: of this mean, or an older one.
        pulse = self._traces[name][1].pulse if name in self._traces else UNSEEN
        known = self._readings.get(name)
        if known is None or known.mean is not mean or known.pulse is not pulse:
            setup, rig = self.setup.for_series(name), self._inputs.find(name)
            known = self._readings[name] = read_mean_hit(mean, setup, rig, name, pulse)
        return known

    def estimate_numbers(self, name: str) -> SampleEstimate:
        """Return tau_p, k and c of one sample so far: at once after a hit.

        The budget of tau_p has the pulse's form as it was last found, with the hits before: its
        fits take as long as all else together, and `estimate_sample` repeats them. Before the
        first time there is no uncertainty.
        """
        return self._assemble(name, self._find_parts(name))

    def estimate_sample(self, name: str) -> SampleEstimate:
        """Return the same with what stands beside it."""
        return self._assemble(name, self._find_all_parts(name))

    def _assemble(self, name: str, parts: SampleParts | None) -> SampleEstimate:
        """Return the estimate of a sample; without an accepted hit it has no parts."""
        if parts is not None:
            return parts.assemble(self.setup.for_series(name))
        count = len(self._series[name])
        note = Note(Subject.HITS, f"0 of {count} accepted")
        return SampleEstimate(name, 0, count, notes=(note,))

    def _find_parts(self, name: str) -> SampleParts | None:
        """Return the numbers by the paper's method and the series; None: no hit was accepted."""
        series, mean = self._series[name], self.compute_mean(name)
        if mean is None:
            return None
        setup, hammer = self.setup.for_series(name), self.estimate_hammer(name)
        spread = series.contact_time_spread
        corrected, doubtful = series.describe_findings()
        notes: tuple[Note, ...] = ()
        if unknown := self.setup.find_unknown_masses(name):
            why = f"the mass of {' and '.join(unknown)} is not known"
            notes = (Note(Subject.STIFFNESS_AND_DAMPING, why),)
        notes += doubtful
        if len(mean.hits) < mean.count:
            shown = f"{len(mean.hits)} of {mean.count} hits, evenly over the series"
            notes = (*notes, Note(Subject.SCATTER, f"that of {shown}"))
        overruled = tuple(
            Note(Reason.OPERATOR, describe_overruled(hit, f"hit {hit.label}"))
            for hit in series.list_by_hand()
        )
        return SampleParts(
            name=name,
            impacts_rejected=len(series) - mean.count,
            mean=mean,
            paper=estimate_paper(name, self._read_mean(name, mean), spread, hammer, setup),
            hammer=hammer,
            warnings=corrected + overruled,
            notes=notes,
            decay=self._traces[name][1].free_decay if name in self._traces else NO_DECAY,
        )

    def _find_all_parts(self, name: str) -> SampleParts | None:
        """Return the same with what stands beside it."""
        control = self.setup.for_series(name).samples.control_sample
        for struck in {name, control}:
            mean, (known, _) = self.compute_mean(struck), self._traces.get(struck, (None, None))
            if mean is not None and mean is not known:
                self._traces[struck] = (
                    mean,
                    estimate_traces(struck, mean, self.setup.for_series(struck)),
                )
        parts = self._find_parts(name)
        if parts is None:
            return None
        traces = self._traces[name][1]
        return replace(parts, traces=traces, decay=traces.free_decay)

    def estimate_all(self, report: Callable[[int], None] | None = None) -> SessionResults:
        """Return everything found so far.

        Asked again before another hit has come, it costs nothing.

        Parameters
        ----------
        report : callable, optional
            Called after each sample with the number of those that are done.
        """
        samples = self._estimated
        if not samples:
            parts: dict[str, SampleParts | None] = {}
            for name in sorted(self.names, key=lambda name: not self.is_control(name)):
                parts[name] = self._find_all_parts(name)
                if report is not None:
                    report(len(parts))
            known = [part for name in self.names if (part := parts[name]) is not None]
            found = {each.name: each for each in assemble_samples(known, self.setup)}
            samples = tuple(found.get(name) or self._assemble(name, None) for name in self.names)
            self._estimated = samples
        selections = [series.select() for series in self._series.values()]
        return SessionResults(
            setup=self.setup,
            hammer=self.estimate_hammer(),
            samples=samples,
            accepted=_sort_hits(selection.kept for selection in selections),
            rejected=_sort_hits(selection.left_out for selection in selections),
            speed_exponents=estimate_speed_exponents(self.setup, samples),
        )

    def compute_mean(self, name: str) -> MeanHit | None:
        """Return the mean hit of one sample so far; None: no hit was accepted."""
        return self._series[name].compute_mean() if name in self._series else None

    def count_hits(self) -> dict[str, HitCount]:
        """Return the number of hits of each sample that has some."""
        return {name: series.count() for name, series in self._series.items()}

    def get_selection(self, name: str) -> Selection:
        """Return which hits of one sample are averaged so far, and which are left out."""
        return self._series[name].select() if name in self._series else Selection((), ())


def _sort_hits(groups: Iterable[tuple[JudgedHit, ...]]) -> tuple[JudgedHit, ...]:
    return tuple(sorted(chain.from_iterable(groups), key=lambda hit: hit.label.record))
