"""What plain traces of other laboratories say of every hit by itself."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from impact_rig.core.estimation.paper_method import CONTACT_TIME
from impact_rig.core.estimation.sample import PEAK, TIME
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.origin import Origin, join_origins
from impact_rig.core.quantity import INLINE, UNKNOWN, Quantity
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    MISSING,
    show_unit,
)
from impact_rig.results.results_file import origin_to_json, results_to_json
from impact_rig.results.tables import (
    Column,
    Table,
    make_optional,
    make_table,
    make_text_column,
    read_column,
)
from impact_rig.results.wire import Json, to_json

FORMAT_NAME = "impact-rig trace results"
FORMAT_VERSION = 5
NAN = math.nan


@dataclass(frozen=True)
class FileResults:
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
    half_amplitude_width: float = field(default=NAN, metadata=TIME)
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    width_ratio: float = NAN
    hammer_peak: float = field(default=NAN, metadata=PEAK)
    specimen_peak: float = field(default=NAN, metadata=PEAK)
    best_shape: str = ""
    shape_residual_percent: float = NAN
    measured_peak: float = NAN
    measured_unit: str = "m/s^2"


def file_results_from_judged(hit: JudgedHit) -> FileResults:
    """Return the verdict on a hit that was imported."""
    return FileResults(
        origin=hit.origin,
        accepted=hit.accepted,
        reasons=tuple(str(rejection) for rejection in hit.rejections),
        half_amplitude_width=hit.half_amplitude_width,
        contact_time=Quantity(hit.contact_time),
        width_ratio=hit.width_ratio,
        hammer_peak=hit.hammer_peak,
        measured_peak=hit.hammer_peak,
        specimen_peak=hit.specimen_peak,
    )


def trace_results_to_json(results: Results, files: Sequence[FileResults]) -> Json:
    """Return results as `results_to_json` does, with all that every file says of its hit."""
    return {
        **results_to_json(results),
        "format": {"name": FORMAT_NAME, "version": FORMAT_VERSION},
        **origin_to_json(join_origins(file.origin for file in files)),
        "hits": [to_json(file) for file in files],
    }


def tabulate_hits(hits: Sequence[FileResults]) -> Table:
    """Return what was found in every file; those that were rejected are marked."""
    unit = hits[0].measured_unit if hits else ""
    columns = [
        make_text_column("File", _shorten([hit.origin.file for hit in hits])),
        read_column("τp [µs]", hits, "contact_time", 2, note="±: of the one hit, 95 %."),
        make_text_column(
            "Verdict", ["accepted" if hit.accepted else "\n".join(hit.reasons) for hit in hits]
        ),
        read_column("w50 [µs]", hits, "half_amplitude_width", 2, is_optional=True),
        read_column("w10/w50", hits, "width_ratio", 3, is_optional=True),
        Column(
            "Best shape",
            [hit.best_shape or MISSING for hit in hits],
            is_text=True,
            is_optional=True,
        ),
        read_column(
            "leaves [%]",
            hits,
            "shape_residual_percent",
            1,
            is_optional=True,
            note="leaves: RMS of what the best shape leaves, over the peak.",
        ),
        make_optional(
            f"Peak [{show_unit(unit)}]" if unit else "Peak",
            [_format_peak(hit.measured_peak) for hit in hits],
        ),
        Column("Place", [hit.origin.place for hit in hits], is_text=True, is_optional=True),
    ]
    wrong = [place for place, hit in enumerate(hits) if not hit.accepted]
    return make_table("Hits", columns, marked=wrong)


def _shorten(files: Sequence[str]) -> Sequence[str]:
    """Return the names without their folders, where these tell them apart."""
    names = [PurePath(file).name for file in files]
    return names if len(set(names)) == len(names) else files


def _format_peak(peak: float) -> str:
    return f"{peak:.4g}" if math.isfinite(peak) else MISSING
