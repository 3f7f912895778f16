"""What was found in every file of other laboratories, as a table."""

import math
from collections.abc import Sequence
from pathlib import PurePath

from impact_rig.results.campaign import FileResults
from impact_rig.results.numbers import MISSING, show_unit
from impact_rig.results.tables import (
    Column,
    Table,
    make_optional,
    make_table,
    make_text_column,
    read_column,
)


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
            [
                f"{hit.measured_peak:.4g}" if math.isfinite(hit.measured_peak) else MISSING
                for hit in hits
            ],
        ),
        Column("Place", [hit.origin.place for hit in hits], is_text=True, is_optional=True),
    ]
    wrong = [place for place, hit in enumerate(hits) if not hit.accepted]
    return make_table("Hits", columns, marked=wrong)


def _shorten(files: Sequence[str]) -> Sequence[str]:
    """Return the names without their folders, where these are distinct."""
    names = [PurePath(file).name for file in files]
    return names if len(set(names)) == len(names) else files
