"""What a campaign found: set-up, every hit, and what was estimated from them.

Nothing in here depends on when, where or with which libraries the numbers were found: the same
hits give the same results, character by character.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.hits import JudgedHit
from impact_rig.core.paper_method import CONTACT_TIME, HammerEstimate
from impact_rig.core.quantity import INLINE, UNKNOWN, Comparable, Quantity, drop_internals
from impact_rig.core.records import UNSTATED, Origin, join_origins
from impact_rig.core.sample import PEAK, TIME, SampleEstimate
from impact_rig.core.session import SessionResults
from impact_rig.core.setup import RigSetup
from impact_rig.core.speed_exponents import SpeedExponents

Peaks = TypeVar("Peaks", SampleEstimate, "HitResults", "FileResults")


@dataclass(frozen=True)
class HitResults(Comparable):
    """One hit with the last word on it.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    impact, attempt, record : int
        Impact of the series, attempt at it, number of the arming; counted from 1.
    accepted : bool
        The hit is part of the sample's mean.
    reasons : tuple of str
        Every reason against it, ``code: explanation``.
    contact_time : float
        tau_p of this hit alone [s]; NaN: not determined.
    hammer_peak, specimen_peak : float
        Largest |acceleration| after the low-pass [m/s^2]; NaN: no pulse, or not measured.
    injected_faults : tuple of str
        What the virtual rig did on purpose, by name; empty: nothing, or a real rig.
    origin : Origin
        Where its points come from.
    """

    sample: str
    impact: int
    attempt: int
    record: int
    accepted: bool = False
    reasons: tuple[str, ...] = ()
    contact_time: float = field(default=math.nan, metadata=TIME)
    hammer_peak: float = field(default=math.nan, metadata=PEAK)
    specimen_peak: float = field(default=math.nan, metadata=PEAK)
    injected_faults: tuple[str, ...] = ()
    origin: Origin = field(default=UNSTATED, metadata=INLINE)


@dataclass(frozen=True)
class FileResults(Comparable):
    """One file with one hit; NaN: not determined.

    Attributes
    ----------
    origin : Origin
        The file, and where in it.
    accepted : bool
        The hit is part of the mean.
    reasons : tuple of str
        Every reason against it, ``code: explanation``.
    half_amplitude_width : float
        w50 [s].
    contact_time : Quantity
        tau_p of this hit, as it was [s]; the next may well differ by more.
    width_ratio : float
        w10 / w50 [-].
    hammer_peak, specimen_peak : float
        Largest |acceleration| after the low-pass [m/s^2].
    measured_peak : float
        Of the hammer, in the unit that its sensor measures.
    measured_unit : str
        m/s^2, N of a force hammer, V where the sensitivity is not known; empty: not stated.
    best_shape : str
        The pulse shape that leaves least; empty: not determined.
    shape_residual_percent : float
        What it leaves, RMS over the peak [%].
    """

    origin: Origin = field(metadata=INLINE)
    accepted: bool
    reasons: tuple[str, ...]
    half_amplitude_width: float = field(default=math.nan, metadata=TIME)
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    width_ratio: float = math.nan
    hammer_peak: float = field(default=math.nan, metadata=PEAK)
    specimen_peak: float = field(default=math.nan, metadata=PEAK)
    best_shape: str = ""
    shape_residual_percent: float = math.nan
    measured_peak: float = math.nan
    measured_unit: str = "m/s^2"


@dataclass(frozen=True)
class Results(Comparable):
    """Everything that a campaign or the analysis of its recording found.

    Attributes
    ----------
    setup : RigSetup
        With what was measured.
    hammer : HammerEstimate
        k1, c1.
    samples : tuple of SampleEstimate
        Those with hits, in the order of the sample set.
    hits : tuple of HitResults
        All, by record.
    speed_exponents : tuple of SpeedExponents
        Of samples that were struck from several release angles.
    files : tuple of FileResults
        Hits of plain files, each by itself.
    """

    setup: RigSetup
    hammer: HammerEstimate
    samples: tuple[SampleEstimate, ...]
    hits: tuple[HitResults, ...]
    speed_exponents: tuple[SpeedExponents, ...] = ()
    files: tuple[FileResults, ...] = ()

    @property
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

    def select_accepted(self, sample: str) -> tuple[HitResults, ...]:
        """Return the hits in the mean of one sample, by record."""
        return tuple(hit for hit in self.hits if hit.accepted and hit.sample == sample)


def results_from_session(
    session: SessionResults, faults_by_record: Mapping[int, tuple[str, ...]]
) -> Results:
    """Return what a session found.

    Parameters
    ----------
    faults_by_record : mapping of int to tuple of str
        Injected faults by number of the arming; what is absent had none.
    """
    return Results(
        setup=session.setup,
        hammer=drop_internals(session.hammer),
        samples=tuple(map(drop_internals, session.samples)),
        hits=tuple(
            hit_results_from_judged(hit, faults_by_record.get(hit.label.record, ()))
            for hit in sorted(
                session.accepted + session.rejected, key=lambda hit: hit.label.record
            )
        ),
        speed_exponents=tuple(map(drop_internals, session.speed_exponents)),
    )


def hit_results_from_judged(hit: JudgedHit, injected_faults: tuple[str, ...]) -> HitResults:
    """Return the last word on one hit."""
    return HitResults(
        sample=hit.label.sample,
        impact=hit.label.impact,
        attempt=hit.label.attempt,
        record=hit.label.record,
        accepted=hit.accepted,
        reasons=tuple(str(rejection) for rejection in hit.rejections),
        contact_time=hit.contact_time,
        hammer_peak=hit.hammer_peak,
        specimen_peak=hit.specimen_peak,
        injected_faults=injected_faults,
        origin=hit.origin,
    )


def drop_scale(results: Results) -> Results:
    """Return results without what depends on the gain of the hammer's channel.

    Widths do not depend on it: a channel of unknown gain is good for contact times.
    """
    samples = (
        replace(sample, peak_force=UNKNOWN, contact_law=_drop_scale_of_law(sample.contact_law))
        for sample in map(_drop_peaks, results.samples)
    )
    return replace(
        results,
        samples=tuple(samples),
        hits=tuple(map(_drop_peaks, results.hits)),
        files=tuple(map(_drop_peaks, results.files)),
    )


def _drop_peaks(record: Peaks) -> Peaks:
    peaks: dict[str, Any] = {
        item.name: math.nan for item in fields(record) if item.metadata == PEAK
    }
    return replace(record, **peaks)


def _drop_scale_of_law(law: ContactLaw) -> ContactLaw:
    return ContactLaw(
        exponent=law.exponent,
        duration=law.duration,
        restitution=law.restitution,
        residual_percent=law.residual_percent,
        notes=law.notes,
        form=law.form,
        loss=law.loss,
        excludes_versed_sine=law.excludes_versed_sine,
    )
