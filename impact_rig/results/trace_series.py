"""What plain traces of other laboratories say, flat: every hit, and the mean of the accepted."""

import math
from dataclasses import dataclass
from typing import Any

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.results_file import record_to_json

FORMAT_NAME = "impact-rig trace results"
FORMAT_VERSION = 2
NAN = math.nan


@dataclass(frozen=True)
class FileResults:
    """One file with one hit; NaN: not determined.

    Attributes
    ----------
    file : str
        As it was given.
    accepted : bool
        The hit is part of the mean.
    reasons : tuple of str
        Every reason against it, ``code: explanation``.
    half_amplitude_width_s, contact_time_s : float
        w50 and tau_p [s].
    width_ratio : float
        w10 / w50 [-].
    hammer_peak_m_per_s2, specimen_peak_m_per_s2 : float
        Largest |acceleration| after the low-pass [m/s^2].
    contact_time_u_s, contact_time_expanded_s : float
        Standard uncertainty of this hit's tau_p, as it was, and the half-width of its 95 %
        interval [s]; the next hit may well differ by more.
    best_shape : str
        The pulse shape that leaves least; empty: not determined.
    shape_residual_percent : float
        What it leaves, RMS over the peak [%].
    """

    file: str
    accepted: bool
    reasons: tuple[str, ...]
    half_amplitude_width_s: float = NAN
    contact_time_s: float = NAN
    width_ratio: float = NAN
    hammer_peak_m_per_s2: float = NAN
    specimen_peak_m_per_s2: float = NAN
    contact_time_u_s: float = NAN
    contact_time_expanded_s: float = NAN
    best_shape: str = ""
    shape_residual_percent: float = NAN


@dataclass(frozen=True)
class TraceResults:
    """All hits of one sample, and what their mean says.

    Attributes
    ----------
    hammer : HammerResults
        k1, c1, as far as they are known.
    samples : tuple of SampleResults
        The sample; none where no hit was accepted.
    hits : tuple of FileResults
        In the order of the files.
    """

    hammer: HammerResults
    samples: tuple[SampleResults, ...]
    hits: tuple[FileResults, ...]


def file_results_from_judged(file: str, hit: JudgedHit) -> FileResults:
    """Flatten the verdict on one file."""
    return FileResults(
        file=file,
        accepted=hit.accepted,
        reasons=tuple(str(rejection) for rejection in hit.rejections),
        half_amplitude_width_s=hit.half_amplitude_width,
        contact_time_s=hit.contact_time,
        width_ratio=hit.width_ratio,
        hammer_peak_m_per_s2=hit.hammer_peak,
        specimen_peak_m_per_s2=hit.specimen_peak,
    )


def trace_results_to_json(results: TraceResults) -> dict[str, Any]:
    """Return the results as plain dicts, lists, strings and numbers, NaN as None."""
    header = {"format": {"name": FORMAT_NAME, "version": FORMAT_VERSION}}
    return {**header, **record_to_json(results)}
