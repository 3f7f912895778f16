"""Results of a campaign: set-up, every hit, and the estimates from them.

Nothing in here depends on when, where or with which libraries the numbers were found: the same
hits give the same results, character by character.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeVar

from impact_rig.core.estimates.checks import NO_CHECKS
from impact_rig.core.estimates.paper_method import (
    BASE_WIDTH,
    CONTACT_TIME,
    PEAK,
    TIME,
    WIDTH,
    HammerEstimate,
    PaperEstimate,
)
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import SpeedExponents
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.quantity import (
    INLINE,
    UNKNOWN,
    Comparable,
    Quantity,
    describe,
    make_result,
)
from impact_rig.core.given.records import UNSTATED, HitLabel, Origin, join_origins
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import SessionResults
from impact_rig.results.numbers import format_count

Peaks = TypeVar("Peaks", PaperEstimate, "HitResults", "FileResults")


@dataclass(frozen=True)
class HitResults(Comparable):
    """One hit with its final verdict."""

    sample: str
    impact: int  # of the series, from 1
    attempt: int  # at this impact, from 1
    record: int  # number of the arming, from 1
    accepted: bool = False  # the hit is part of the sample's mean
    reasons: tuple[Finding, ...] = ()  # every reason against it
    # tau_p of this hit alone [s]; NaN: not determined.
    contact_time: float = field(default=math.nan, metadata=TIME)
    # Largest |acceleration| after the low-pass [m/s^2]; NaN: no pulse, or not measured.
    hammer_peak: float = field(default=math.nan, metadata=PEAK)
    specimen_peak: float = field(default=math.nan, metadata=PEAK)
    # Of the hammer, measured at this hit [m/s], with its standard uncertainty; NaN: not measured.
    impact_speed: float = field(default=math.nan, metadata=describe("m/s"))
    impact_speed_uncertainty: float = field(
        default=math.nan, metadata=describe("m/s", written="impact_speed_u", least=0.0)
    )
    sample_mass: float = field(default=math.nan, metadata=describe("kg"))  # by its traces
    findings: tuple[Finding, ...] = ()  # what was corrected, is doubted or asked
    injected_faults: tuple[str, ...] = ()  # what the virtual rig did on purpose
    origin: Origin = field(default=UNSTATED, metadata=INLINE)

    @property
    def is_by_hand(self) -> bool:
        """Whether a person decided on it."""
        found = (*self.reasons, *self.findings)
        return any(item.reason is Reason.OPERATOR for item in found)

    @property
    def label(self) -> HitLabel:
        """Label of the hit."""
        return HitLabel(self.sample, self.record, self.impact, self.attempt)


@dataclass(frozen=True)
class FileResults(Comparable):
    """One file with one hit; NaN: not determined."""

    origin: Origin = field(metadata=INLINE)  # the file, and where in it
    accepted: bool  # the hit is part of the mean
    reasons: tuple[Finding, ...]  # every reason against it
    # Of this hit [s]; they do not hold the scatter from hit to hit.
    half_amplitude_width: Quantity = field(default=UNKNOWN, metadata=WIDTH)
    base_width: Quantity = field(default=UNKNOWN, metadata=BASE_WIDTH)
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    width_ratio: float = math.nan  # w10 / w50 [-]
    # Largest |acceleration| after the low-pass [m/s^2].
    hammer_peak: float = field(default=math.nan, metadata=PEAK)
    specimen_peak: float = field(default=math.nan, metadata=PEAK)
    best_shape: str = ""  # the pulse shape that leaves least; empty: not determined
    shape_residual_percent: float = math.nan  # what it leaves, RMS over the peak [%]
    measured_peak: float = math.nan  # of the hammer, in the unit that its sensor measures
    # m/s^2, N of a force hammer, V where the sensitivity is not known; empty: not stated.
    measured_unit: str = "m/s^2"


@dataclass(frozen=True)
class Results(Comparable):
    """Everything that a campaign or the analysis of its recording found."""

    setup: RigSetup
    hammer: HammerEstimate
    samples: tuple[SampleEstimate, ...]  # those with hits, in the order of the sample set
    hits: tuple[HitResults, ...]  # all, by record
    speed_exponents: tuple[SpeedExponents, ...] = ()  # of samples with several release angles
    files: tuple[FileResults, ...] = ()  # hits of plain files, each by itself

    @cached_property
    def origin(self) -> Origin:
        """Where the numbers come from."""
        return join_origins(hit.origin for hit in self.hits)

    def find_origin(self, sample: str) -> Origin:
        """Return where those of one sample come from."""
        return join_origins(hit.origin for hit in self.hits if hit.sample == sample)

    @property
    def rejections(self) -> tuple[HitResults, ...]:
        """Hits that are in no mean, by record."""
        return tuple(hit for hit in self.hits if not hit.accepted)

    def count_hits(self) -> str:
        """Return how many hits there are: ``120 hits accepted, 0 rejected``."""
        rejected = len(self.rejections)
        return f"{format_count(len(self.hits) - rejected, 'hit')} accepted, {rejected} rejected"

    def select_accepted(self, sample: str) -> tuple[HitResults, ...]:
        """Return the hits in the mean of one sample, by record."""
        return tuple(hit for hit in self.hits if hit.accepted and hit.sample == sample)


def results_from_session(
    session: SessionResults, faults_by_record: Mapping[int, tuple[str, ...]]
) -> Results:
    """Return the results of a session.

    Parameters
    ----------
    faults_by_record : mapping of int to tuple of str
        Injected faults by number of the arming; what is absent had none.
    """
    judged = sorted(session.accepted + session.rejected, key=lambda hit: hit.label.record)
    return Results(
        setup=session.setup,
        hammer=make_result(session.hammer),
        samples=tuple(map(make_result, session.samples)),
        hits=tuple(
            hit_results_from_judged(hit, faults_by_record.get(hit.label.record, ()))
            for hit in judged
        ),
        speed_exponents=tuple(map(make_result, session.speed_exponents)),
    )


def hit_results_from_judged(hit: JudgedHit, injected_faults: tuple[str, ...]) -> HitResults:
    """Return a hit with its final verdict."""
    found = HitResults(
        **asdict(hit.label),
        accepted=hit.accepted,
        reasons=hit.rejections,
        contact_time=hit.contact_time,
        hammer_peak=hit.hammer_peak,
        specimen_peak=hit.specimen_peak,
        impact_speed=hit.impact_speed.value,
        impact_speed_uncertainty=hit.impact_speed.standard,
        sample_mass=hit.sample_mass,
        findings=hit.findings + hit.overruled,
        injected_faults=injected_faults,
        origin=hit.origin,
    )
    return make_result(found)


LAW_WITHOUT_GAIN: dict[str, Any] = dict.fromkeys(
    ("stiffness", "damping", "impact_speed", "peak_force", "peak_indentation", "impulse",
     "energy_loss", "equivalent_stiffness"), UNKNOWN,
)  # fmt: skip
"""What a law does not tell without the gain of the hammer's channel."""


def drop_scale(results: Results) -> Results:
    """Return results without what depends on the gain of the hammer's channel.

    Widths do not depend on it: a channel of unknown gain is good for contact times. A force whose
    mass is not known makes no acceleration, but is a force.
    """
    samples = tuple(replace(sample, paper=_drop_peaks(sample.paper)) for sample in results.samples)
    if not results.setup.measures_force:
        samples = tuple(
            replace(
                sample,
                paper=replace(sample.paper, peak_force=UNKNOWN),
                contact_law=replace(sample.contact_law, **LAW_WITHOUT_GAIN),
                checks=NO_CHECKS,
            )
            for sample in samples
        )
    return replace(
        results,
        samples=samples,
        hits=tuple(map(_drop_peaks, results.hits)),
        files=tuple(map(_drop_peaks, results.files)),
    )


def _drop_peaks(record: Peaks) -> Peaks:
    peaks: dict[str, Any] = {
        item.name: math.nan for item in fields(record) if item.metadata == PEAK
    }
    return replace(record, **peaks)
