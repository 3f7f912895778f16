"""What plain traces of other laboratories say, in a terminal."""

import math
from collections.abc import Sequence
from pathlib import PurePath

from rich.console import Console

from impact_rig.reporting.terminal.columns import Column, make_optional
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table
from impact_rig.reporting.terminal.model_tables import (
    print_free_decays,
    print_identifications,
    print_pulse_shapes,
)
from impact_rig.reporting.terminal.remarks import print_notes, print_warnings
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_number, format_uncertain
from impact_rig.results.trace_series import TraceResults

NAN = math.nan


def print_trace_results(console: Console, results: TraceResults) -> None:
    """Print every hit, then the mean of the accepted ones."""
    hits = results.hits
    columns = [
        Column("File", _shorten([hit.file for hit in hits]), is_text=True),
        Column(
            "τp [µs]",
            [
                format_uncertain(
                    hit.contact_time_s * MICRO, hit.contact_time_expanded_s * MICRO, 2
                )
                for hit in hits
            ],
            note="±: of the one hit, 95 %.",
        ),
        Column(
            "Verdict",
            ["accepted" if hit.accepted else "\n".join(hit.reasons) for hit in hits],
            is_text=True,
            styles=[GOOD if hit.accepted else ALARM for hit in hits],
        ),
        make_optional(
            "w50 [µs]", [format_number(hit.half_amplitude_width_s * MICRO, 2) for hit in hits]
        ),
        make_optional("w10/w50", [format_number(hit.width_ratio, 3) for hit in hits]),
        Column(
            "Best shape",
            [hit.best_shape or MISSING for hit in hits],
            is_text=True,
            is_optional=True,
        ),
        make_optional(
            "leaves\n[%]",
            [format_number(hit.shape_residual_percent, 1) for hit in hits],
            "leaves: RMS of what the best shape leaves, over the peak.",
        ),
        make_optional(
            "Peak\n[m/s²]",
            [
                f"{hit.hammer_peak_m_per_s2:.4g}"
                if math.isfinite(hit.hammer_peak_m_per_s2)
                else MISSING
                for hit in hits
            ],
        ),
    ]
    print_table(console, "Hits", columns)
    for sample in results.samples:
        _print_mean(console, sample, results.hammer)
    print_pulse_shapes(console, results.samples)
    print_free_decays(console, results.samples)
    print_identifications(console, results.samples)
    print_warnings(console, results.samples)
    print_notes(console, results.samples)


def _shorten(files: Sequence[str]) -> Sequence[str]:
    """Return the names without their folders, where these tell them apart."""
    names = [PurePath(file).name for file in files]
    return names if len(set(names)) == len(names) else files


def _print_mean(console: Console, sample: SampleResults, hammer: HammerResults) -> None:
    rows = [
        ("contact time τp", sample.contact_time_s, sample.contact_time_expanded_s, MICRO, 2, "µs"),
        ("spread of τp over the hits", sample.contact_time_spread_s, NAN, MICRO, 2, "µs"),
        ("width at half amplitude w50", sample.half_amplitude_width_s, NAN, MICRO, 2, "µs"),
        ("w10/w50", sample.width_ratio, NAN, 1.0, 3, ""),
        (
            "stiffness in contact k_eq",
            sample.equivalent_stiffness_n_per_m,
            sample.equivalent_stiffness_expanded_n_per_m,
            MEGA,
            3,
            "MN/m",
        ),
        (
            "hammer stiffness k1",
            hammer.stiffness_n_per_m,
            hammer.stiffness_expanded_n_per_m,
            MEGA,
            3,
            "MN/m",
        ),
        (
            "hammer damping coefficient c1",
            hammer.damping_coefficient_n_s_per_m,
            hammer.damping_coefficient_expanded_n_s_per_m,
            1.0,
            1,
            "N s/m",
        ),
        (
            "stiffness k2",
            sample.stiffness_n_per_m,
            sample.stiffness_expanded_n_per_m,
            MEGA,
            3,
            "MN/m",
        ),
        (
            "damping coefficient c2",
            sample.damping_coefficient_n_s_per_m,
            sample.damping_coefficient_expanded_n_s_per_m,
            1.0,
            1,
            "N s/m",
        ),
        ("damping ratio ζ", sample.damping_ratio, sample.damping_ratio_expanded, 1.0, 3, ""),
        ("log decrement Δ", sample.log_decrement, NAN, 1.0, 3, ""),
        ("model MSE, hammer", sample.mse_hammer_percent, NAN, 1.0, 3, "%"),
        ("model MSE, sample", sample.mse_sample_percent, NAN, 1.0, 2, "%"),
    ]
    known = [row for row in rows if math.isfinite(row[1])]
    columns = [
        Column("Quantity", [name for name, *_ in known], is_text=True),
        Column(
            "Value",
            [
                format_uncertain(value * scale, expanded * scale, digits)
                for _, value, expanded, scale, digits, _ in known
            ],
        ),
        Column("Unit", [unit for *_, unit in known], is_text=True),
    ]
    count = sample.impacts_accepted
    title = f"{sample.name}: mean of {count} hit{'s' if count != 1 else ''}"
    print_table(console, title, columns)
