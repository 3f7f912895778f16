"""What plain traces of other laboratories say: every hit, and the mean of the accepted ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from rich.console import Console

from impact_rig.core.hits.hit import JudgedHit
from impact_rig.reporting.numbers import MISSING, format_number
from impact_rig.reporting.remarks import print_notes
from impact_rig.reporting.results import HammerResults, SampleResults
from impact_rig.reporting.results_file import record_to_json
from impact_rig.reporting.terminal import Column, print_table

FORMAT_NAME = "impact-rig trace results"
FORMAT_VERSION = 2
NAN = math.nan


@dataclass(frozen=True)
class HitResults:
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
    """

    file: str
    accepted: bool
    reasons: tuple[str, ...]
    half_amplitude_width_s: float = NAN
    contact_time_s: float = NAN
    width_ratio: float = NAN
    hammer_peak_m_per_s2: float = NAN
    specimen_peak_m_per_s2: float = NAN


@dataclass(frozen=True)
class TraceResults:
    """All hits of one sample, and what their mean says.

    Attributes
    ----------
    hammer : HammerResults
        k1, c1, as far as they are known.
    samples : tuple of SampleResults
        The sample; none where no hit was accepted.
    hits : tuple of HitResults
        In the order of the files.
    """

    hammer: HammerResults
    samples: tuple[SampleResults, ...]
    hits: tuple[HitResults, ...]


def hit_results_from_judged(file: str, hit: JudgedHit) -> HitResults:
    """Flatten the verdict on one file."""
    return HitResults(
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


def print_trace_results(console: Console, results: TraceResults) -> None:
    """Print every hit, then the mean of the accepted ones."""
    hits = results.hits
    columns = [
        Column("File", _shorten([hit.file for hit in hits]), is_text=True),
        Column("w50 [µs]", [format_number(hit.half_amplitude_width_s * 1e6, 2) for hit in hits]),
        Column("τp [µs]", [format_number(hit.contact_time_s * 1e6, 2) for hit in hits]),
        Column("w10/w50", [format_number(hit.width_ratio, 3) for hit in hits]),
        Column(
            "Peak\n[m/s²]",
            [
                f"{hit.hammer_peak_m_per_s2:.4g}"
                if math.isfinite(hit.hammer_peak_m_per_s2)
                else MISSING
                for hit in hits
            ],
            is_optional=True,
        ),
        Column("Verdict", ["\n".join(hit.reasons) or "accepted" for hit in hits], is_text=True),
    ]
    print_table(console, "Hits", columns)
    for sample in results.samples:
        _print_mean(console, sample, results.hammer)
        print_notes(console, results.samples)


def _shorten(files: Sequence[str]) -> Sequence[str]:
    """Return the names without their folders, where these tell them apart."""
    names = [PurePath(file).name for file in files]
    return names if len(set(names)) == len(names) else files


def _print_mean(console: Console, sample: SampleResults, hammer: HammerResults) -> None:
    rows = [
        ("contact time τp", sample.contact_time_s * 1e6, 2, "µs"),
        ("spread of τp over the hits", sample.contact_time_spread_s * 1e6, 2, "µs"),
        ("width at half amplitude w50", sample.half_amplitude_width_s * 1e6, 2, "µs"),
        ("w10/w50", sample.width_ratio, 3, ""),
        ("stiffness in contact k_eq", sample.equivalent_stiffness_n_per_m / 1e6, 3, "MN/m"),
        ("hammer stiffness k1", hammer.stiffness_n_per_m / 1e6, 3, "MN/m"),
        ("hammer damping coefficient c1", hammer.damping_coefficient_n_s_per_m, 1, "N s/m"),
        ("stiffness k2", sample.stiffness_n_per_m / 1e6, 3, "MN/m"),
        ("damping coefficient c2", sample.damping_coefficient_n_s_per_m, 1, "N s/m"),
        ("damping ratio ζ", sample.damping_ratio, 3, ""),
        ("log decrement Δ", sample.log_decrement, 3, ""),
        ("model MSE, hammer", sample.mse_hammer_percent, 3, "%"),
        ("model MSE, sample", sample.mse_sample_percent, 2, "%"),
    ]
    known = [row for row in rows if math.isfinite(row[1])]
    columns = [
        Column("Quantity", [row[0] for row in known], is_text=True),
        Column("Value", [format_number(row[1], row[2]) for row in known]),
        Column("Unit", [row[3] for row in known], is_text=True),
    ]
    count = sample.impacts_accepted
    title = f"{sample.name}: mean of {count} hit{'s' if count != 1 else ''}"
    print_table(console, title, columns)
