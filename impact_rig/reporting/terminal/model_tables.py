"""Do the assumptions hold? Model against measurement, pulse shapes, damping, identification."""

import math
from collections.abc import Sequence

from rich.console import Console

from impact_rig.core.setup.paper import PULSE_NAME
from impact_rig.reporting.terminal.columns import Column, make_optional
from impact_rig.reporting.terminal.console import print_item, print_table
from impact_rig.results.cross_checks import IdentificationResults
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MEGA, MICRO, format_number, format_uncertain

MSE_NOTE = "MSE: over the record, with the force of equation (4) alone driving the sample."
CONTACT_NOTE = "contact: RMS error of the same over the contact."
PRINTED_NOTE = "printed: MSE of equations (1) and (2) as printed."
SHIFT_NOTE = "shift [µs]: applied to the model of MSE, later is positive."


def print_comparison(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print how far model and measurement lie apart, if any sample could be compared."""
    if all(math.isnan(sample.mse_hammer_percent) for sample in samples):
        return

    def column(header: str, name: str, digits: int, note: str = "", scale: float = 1.0) -> Column:
        values = [getattr(sample, name) * scale for sample in samples]
        return make_optional(header, [format_number(value, digits) for value in values], note)

    columns = [
        Column("Sample", [sample.name for sample in samples], is_text=True),
        column("MSE\nhammer", "mse_hammer_percent", 3, MSE_NOTE),
        column("MSE\nsample", "mse_sample_percent", 2),
        column("contact\nhammer", "contact_error_hammer_percent", 1, CONTACT_NOTE),
        column("contact\nsample", "contact_error_sample_percent", 1),
        column("printed\nhammer", "printed_mse_hammer_percent", 2, PRINTED_NOTE),
        column("printed\nsample", "printed_mse_sample_percent", 2),
        column("shift\nsample", "shift_sample_s", 1, SHIFT_NOTE, MICRO),
        column("shift\nhammer", "shift_hammer_s", 1, scale=MICRO),
    ]
    print_table(console, "Fig. 6. Model against measurement [%]", columns)


def print_pulse_shapes(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print what the pulses look like, and what tau_p and k2 become under the best shape."""
    rows = [
        (sample.name, sample.pulse_shape, best, sample.pulse_shape.find_fit(PULSE_NAME))
        for sample in samples
        if (best := sample.pulse_shape.best_fit) is not None
    ]
    if not rows:
        return
    names, shapes, best_fits, versed_sines = zip(*rows, strict=True)
    columns = [
        Column("Sample", names, is_text=True),
        Column(
            "Best shape",
            [shape.best_shape + ("" if shape.is_told_apart else " ?") for shape in shapes],
            is_text=True,
            note=""
            if all(shape.is_told_apart for shape in shapes)
            else "?: not told apart from the next.",
        ),
        Column(
            "residual\n[%]",
            _format([fit.residual_percent for fit in best_fits], 2),
            note="residual: RMS of what the best shape leaves, over the peak; versed-sine: what"
            " the paper's shape leaves.",
        ),
        Column(
            "versed-\nsine [%]",
            _format([fit.residual_percent if fit else math.nan for fit in versed_sines], 2),
        ),
        make_optional(
            "τp\n[µs]",
            _format([fit.contact_time_s for fit in best_fits], 2, MICRO),
            "τp and k2: under the best shape.",
        ),
        make_optional(
            "k2\n[MN/m]", _format([fit.stiffness_n_per_m for fit in best_fits], 2, MEGA)
        ),
        make_optional("fall/\nrise", _format([shape.fall_over_rise for shape in shapes], 3)),
    ]
    print_table(console, "Pulse shape of the hammer", columns)


def print_free_decays(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print damping by the free decay after the contact, beside the log decrement's."""
    known = [sample for sample in samples if math.isfinite(sample.free_decay.damping_ratio)]
    if not known:
        return
    decays = [sample.free_decay for sample in known]
    coefficients = [
        (item.damping_coefficient_n_s_per_m, item.damping_coefficient_expanded_n_s_per_m)
        for item in decays
    ]
    ratios = [(item.damping_ratio, item.damping_ratio_expanded) for item in decays]
    columns = [
        Column("Sample", [sample.name for sample in known], is_text=True),
        Column("c\n[N s/m]", _format_uncertain(coefficients, 1)),
        Column("ζ", _format_uncertain(ratios, 3)),
        make_optional("ζ by log\ndecrement", _format([item.damping_ratio for item in known], 3)),
        make_optional("f\n[kHz]", _format([item.frequency_hz for item in decays], 3, 1e-3)),
        make_optional(
            "periods",
            _format([item.periods for item in decays], 1),
            "periods: what of it stands out of the noise.",
        ),
        make_optional(
            "R²",
            _format([item.r_squared for item in decays], 4),
            "R²: part of the tail that the fit explains.",
        ),
    ]
    note = "A damped sinusoid fitted to the sample's trace after the contact."
    print_table(console, "Damping by free decay", columns, [note])


def print_identifications(console: Console, samples: Sequence[SampleResults]) -> None:
    """Print the model's parameters fitted to both traces: those of the preferred variant."""
    rows = [
        (sample.name, sample.identification)
        for sample in samples
        if sample.identification is not None
    ]
    if not rows:
        return
    names, fits = zip(*rows, strict=True)
    contact_times = [(fit.contact_time_s, fit.contact_time_expanded_s) for fit in fits]
    stiffnesses = [(fit.stiffness_n_per_m, fit.stiffness_expanded_n_per_m) for fit in fits]
    coefficients = [
        (fit.damping_coefficient_n_s_per_m, fit.damping_coefficient_expanded_n_s_per_m)
        for fit in fits
    ]
    columns = [
        Column("Sample", names, is_text=True),
        Column("τp\n[µs]", _format_uncertain(contact_times, 2, MICRO)),
        Column("k2\n[MN/m]", _format_uncertain(stiffnesses, 2, MEGA)),
        Column("c2\n[N s/m]", _format_uncertain(coefficients, 1)),
        make_optional(
            "residual\n/ noise",
            _format([fit.residual_over_noise for fit in fits], 1),
            "residual / noise: 1 where the model leaves nothing but noise.",
        ),
        make_optional(
            "force\nbalance",
            _format([fit.force_balance for fit in fits], 3),
            "force balance: force on the sample over that on the hammer.",
        ),
        Column(
            "model",
            [fit.model for fit in fits],
            is_text=True,
            is_optional=True,
            note="model: the variant that the Bayesian information criterion prefers.",
        ),
    ]
    note = "Least squares on hammer and sample together."
    print_table(console, "Identification of the two-body model", columns, [note])
    _print_undetermined(console, rows)


def _format(values: Sequence[float], digits: int, scale: float = 1.0) -> list[str]:
    return [format_number(value * scale, digits) for value in values]


def _format_uncertain(
    pairs: Sequence[tuple[float, float]], digits: int, scale: float = 1.0
) -> list[str]:
    """Format values with their expanded uncertainties."""
    return [format_uncertain(value * scale, wide * scale, digits) for value, wide in pairs]


def _print_undetermined(
    console: Console, fitted: Sequence[tuple[str, IdentificationResults]]
) -> None:
    for name, found in fitted:
        for text in found.undetermined:
            print_item(console, f"{name}: {text}")
    if any(found.undetermined for _, found in fitted):
        console.print()
