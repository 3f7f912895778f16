"""Do the assumptions hold? Model against measurement, pulse shape, free decay, identification."""

import math
from collections.abc import Sequence

from impact_rig.core.setup.paper import PULSE_NAME
from impact_rig.reporting.report.document import (
    Column,
    Table,
    make_column,
    make_table,
    make_text_column,
)
from impact_rig.results.cross_checks import IdentificationResults
from impact_rig.results.estimates import SampleResults
from impact_rig.results.numbers import MEGA, MICRO, MISSING, format_number, format_uncertain

SMALLEST_ERROR = 1e-4
"""Below which an error is not told in digits [%], our choice."""


def tabulate_errors(samples: Sequence[SampleResults]) -> list[Table]:
    """Return how far model and measurement lie apart; nothing if no sample was compared."""
    if all(math.isnan(sample.mse_hammer_percent) for sample in samples):
        return []

    def column(header: str, name: str) -> Column:
        values = [getattr(sample, name) for sample in samples]
        return make_column(header, [_format_error(value) for value in values])

    def shift(header: str, name: str) -> Column:
        values = [getattr(sample, name) for sample in samples]
        return make_column(header, _format(values, 1, MICRO))

    columns = [
        make_text_column("Sample", [sample.name for sample in samples]),
        column("MSE hammer [%]", "mse_hammer_percent"),
        column("MSE sample [%]", "mse_sample_percent"),
        column("Contact hammer [%]", "contact_error_hammer_percent"),
        column("Contact sample [%]", "contact_error_sample_percent"),
        column("Printed hammer [%]", "printed_mse_hammer_percent"),
        column("Printed sample [%]", "printed_mse_sample_percent"),
        shift("Shift hammer [µs]", "shift_hammer_s"),
        shift("Shift sample [µs]", "shift_sample_s"),
    ]
    note = (
        "MSE: mean square error over the record, with the force of equation (4) alone driving the"
        " sample, traces normalised and shifted as in the paper. Contact: RMS error of the same"
        " over the contact alone, which the MSE is too long to show. Printed: MSE of equations (1)"
        " and (2) as printed. Shift: applied to the model of MSE, later is positive."
    )
    return [make_table("Model against measurement", columns, [note])]


def tabulate_pulse_shapes(samples: Sequence[SampleResults]) -> list[Table]:
    """Return what the pulses look like, and tau_p and k2 under the best shape."""
    rows = [
        (sample, sample.pulse_shape, best, sample.pulse_shape.find_fit(PULSE_NAME))
        for sample in samples
        if (best := sample.pulse_shape.best_fit) is not None
    ]
    if not rows:
        return []
    bests = [best for _, _, best, _ in rows]
    columns = [
        make_text_column("Sample", [sample.name for sample, *_ in rows]),
        make_text_column(
            "Best shape",
            [shape.best_shape + ("" if shape.is_told_apart else " ?") for _, shape, *_ in rows],
        ),
        make_column("It leaves [%]", _format([fit.residual_percent for fit in bests], 2)),
        make_column(
            "Versed-sine leaves [%]",
            _format([fit.residual_percent if fit else math.nan for *_, fit in rows], 2),
        ),
        make_column("τp, paper [µs]", [_format_contact_time(sample) for sample, *_ in rows]),
        make_column("τp, shape [µs]", _format([fit.contact_time_s for fit in bests], 2, MICRO)),
        make_column("k2, paper [MN/m]", [_format_stiffness(sample) for sample, *_ in rows]),
        make_column(
            "k2, shape [MN/m]", _format([fit.stiffness_n_per_m for fit in bests], 2, MEGA)
        ),
        make_column("Fall/rise", _format([shape.fall_over_rise for _, shape, *_ in rows], 3)),
    ]
    note = (
        "Shapes fitted to the mean hammer pulse. It leaves: RMS of the rest, over the peak. Paper:"
        " by τp = 2 w50, right for a versed-sine; shape: with the factor of the best shape."
        " ?: not told apart from the next best."
    )
    return [make_table("Pulse shape of the hammer", columns, [note])]


def tabulate_free_decays(samples: Sequence[SampleResults]) -> list[Table]:
    """Return damping by the free decay after the contact, beside the log decrement's."""
    known = [sample for sample in samples if math.isfinite(sample.free_decay.damping_ratio)]
    if not known:
        return []
    decays = [sample.free_decay for sample in known]
    coefficients = [
        (item.damping_coefficient_n_s_per_m, item.damping_coefficient_expanded_n_s_per_m)
        for item in decays
    ]
    paper_ratios = [(item.damping_ratio, item.damping_ratio_expanded) for item in known]
    ratios = [(item.damping_ratio, item.damping_ratio_expanded) for item in decays]
    columns = [
        make_text_column("Sample", [sample.name for sample in known]),
        make_column("c2, paper [N s/m]", [_format_damping(sample) for sample in known]),
        make_column("c2, free decay [N s/m]", _format_uncertain(coefficients, 1)),
        make_column("ζ, paper", _format_uncertain(paper_ratios, 3)),
        make_column("ζ, free decay", _format_uncertain(ratios, 3)),
        make_column("f [kHz]", _format([item.frequency_hz for item in decays], 3, 1e-3)),
        make_column("Periods", _format([item.periods for item in decays], 1)),
        make_column("R²", _format([item.r_squared for item in decays], 4)),
    ]
    note = (
        "Paper: from U1, inside the contact, and U2. Free decay: a damped sinusoid fitted to the"
        " sample's trace after the contact; f: its frequency. Periods: what of it stands out of"
        " the noise. R²: part of the tail that the fit explains."
    )
    return [make_table("Damping by free decay", columns, [note])]


def tabulate_identifications(samples: Sequence[SampleResults]) -> list[Table]:
    """Return the parameters of the preferred model fitted to both traces, beside the paper's."""
    rows = [(s, fit) for s in samples if (fit := s.identification) is not None]
    if not rows:
        return []
    fits = [fit for _, fit in rows]
    contact_times, stiffnesses, coefficients = _make_value_columns(fits)
    columns = [
        make_text_column("Sample", [sample.name for sample, _ in rows]),
        make_column("τp, paper [µs]", [_format_contact_time(sample) for sample, _ in rows]),
        contact_times,
        make_column("k2, paper [MN/m]", [_format_stiffness(sample) for sample, _ in rows]),
        stiffnesses,
        make_column("c2, paper [N s/m]", [_format_damping(sample) for sample, _ in rows]),
        coefficients,
        make_column("Residual/noise", _format([fit.residual_over_noise for fit in fits], 1)),
        make_column("Force balance", _format([fit.force_balance for fit in fits], 3)),
        make_text_column("Model", [fit.model for fit in fits]),
    ]
    note = (
        "Paper: by the paper's method. Fit: least squares on hammer and sample together, with the"
        " variant of the model that the Bayesian information criterion prefers. Residual/noise: 1"
        " where the model leaves nothing but noise. Force balance: force on the sample over that"
        " on the hammer, 1 by Newton's third law."
    )
    return [make_table("Identification of the two-body model", columns, [note])]


def tabulate_variants(sample: SampleResults) -> list[Table]:
    """Return every variant of the model that was fitted to one sample, and what it leaves."""
    fits = sample.identifications
    if not fits:
        return []
    columns = [
        make_text_column(
            "Model", [f"{fit.model}, preferred" if fit.is_preferred else fit.model for fit in fits]
        ),
        *_make_value_columns(fits),
        make_column(
            "Leaves of hammer [%]", _format([fit.residual_hammer_percent for fit in fits], 2)
        ),
        make_column(
            "Leaves of sample [%]", _format([fit.residual_sample_percent for fit in fits], 2)
        ),
        make_column("Residual/noise", _format([fit.residual_over_noise for fit in fits], 1)),
        make_column("BIC", _format([fit.criterion for fit in fits], 0)),
    ]
    notes = [f"{fit.model}: {text}." for fit in fits for text in (*fit.undetermined, *fit.notes)]
    return [make_table("Fitted models", columns, notes)]


def _make_value_columns(fits: Sequence[IdentificationResults]) -> tuple[Column, Column, Column]:
    """Return tau_p, k2 and c2 as they were fitted."""
    contact_times = [(fit.contact_time_s, fit.contact_time_expanded_s) for fit in fits]
    stiffnesses = [(fit.stiffness_n_per_m, fit.stiffness_expanded_n_per_m) for fit in fits]
    coefficients = [
        (fit.damping_coefficient_n_s_per_m, fit.damping_coefficient_expanded_n_s_per_m)
        for fit in fits
    ]
    return (
        make_column("τp, fit [µs]", _format_uncertain(contact_times, 2, MICRO)),
        make_column("k2, fit [MN/m]", _format_uncertain(stiffnesses, 2, MEGA)),
        make_column("c2, fit [N s/m]", _format_uncertain(coefficients, 1)),
    )


def _format(values: Sequence[float], digits: int, scale: float = 1.0) -> list[str]:
    return [format_number(value * scale, digits) for value in values]


def _format_error(value: float) -> str:
    """Return an error with two significant digits: they reach over four decades."""
    if not math.isfinite(value):
        return MISSING
    return f"{value:#.2g}".rstrip(".") if value >= SMALLEST_ERROR else f"< {SMALLEST_ERROR:.4f}"


def _format_uncertain(
    pairs: Sequence[tuple[float, float]], digits: int, scale: float = 1.0
) -> list[str]:
    return [format_uncertain(value * scale, wide * scale, digits) for value, wide in pairs]


def _format_contact_time(sample: SampleResults) -> str:
    return format_uncertain(
        sample.contact_time_s * MICRO, sample.contact_time_expanded_s * MICRO, 2
    )


def _format_stiffness(sample: SampleResults) -> str:
    return format_uncertain(
        sample.stiffness_n_per_m * MEGA, sample.stiffness_expanded_n_per_m * MEGA, 2
    )


def _format_damping(sample: SampleResults) -> str:
    return format_uncertain(
        sample.damping_coefficient_n_s_per_m, sample.damping_coefficient_expanded_n_s_per_m, 1
    )
