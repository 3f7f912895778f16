"""What stands beside the paper's numbers, flat: pulse shape, free decay and the fitted model."""

import math
from dataclasses import dataclass

NAN = math.nan


@dataclass(frozen=True)
class ShapeFitResults:
    """One pulse shape fitted to the mean hammer pulse.

    Attributes
    ----------
    shape : str
        Its name.
    residual_percent : float
        RMS of what the fit leaves, over the peak [%].
    contact_time_s : float
        tau_p = F w50 with this shape's F [s].
    stiffness_n_per_m : float
        k2 with this tau_p, and k1 read in the same way [N/m].
    duration_s : float
        Of the fitted pulse [s].
    asymmetry : float
        Of the fitted pulse [-]: the rise takes (1 + asymmetry) / 2 of its duration.
    """

    shape: str
    residual_percent: float
    contact_time_s: float
    stiffness_n_per_m: float = NAN
    duration_s: float = NAN
    asymmetry: float = NAN


@dataclass(frozen=True)
class PulseShapeResults:
    """What the mean hammer pulse looks like; NaN, or empty: not determined.

    Attributes
    ----------
    best_shape : str
        The shape that leaves least.
    is_told_apart : bool
        The next best leaves clearly more.
    fall_over_rise : float
        Time from the peak down to half of it over the time up to the peak [-].
    fits : tuple of ShapeFitResults
        One for each shape.
    """

    best_shape: str = ""
    is_told_apart: bool = False
    fall_over_rise: float = NAN
    fits: tuple[ShapeFitResults, ...] = ()

    @property
    def best_fit(self) -> ShapeFitResults | None:
        """The fit of the best shape."""
        return self.find_fit(self.best_shape)

    def find_fit(self, shape: str) -> ShapeFitResults | None:
        """Return the fit of one shape, if there is one."""
        return next((fit for fit in self.fits if fit.shape == shape), None)


NO_SHAPE = PulseShapeResults()
"""Where it is not determined."""


@dataclass(frozen=True)
class FreeDecayResults:
    """Damping from the free decay after the contact; NaN: not determined.

    `_u` is the standard uncertainty, `_expanded` the half-width of the 95 % interval.

    Attributes
    ----------
    damping_ratio, damping_ratio_u, damping_ratio_expanded : float
        zeta2 [-].
    damping_coefficient_n_s_per_m and its `_u`, `_expanded` : float
        c2 [N s/m].
    stiffness_n_per_m and its `_u`, `_expanded` : float
        m2 times the natural angular frequency squared [N/m].
    frequency_hz : float
        Of the damped oscillation [Hz].
    periods : float
        Of it that stand out of the noise [-].
    r_squared : float
        Part of the tail's variance that the fit explains [-].
    residual_over_noise : float
        RMS of what is left over the noise [-]; 1: nothing but noise.
    """

    damping_ratio: float = NAN
    damping_ratio_u: float = NAN
    damping_ratio_expanded: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_coefficient_u_n_s_per_m: float = NAN
    damping_coefficient_expanded_n_s_per_m: float = NAN
    stiffness_n_per_m: float = NAN
    stiffness_u_n_per_m: float = NAN
    stiffness_expanded_n_per_m: float = NAN
    frequency_hz: float = NAN
    periods: float = NAN
    r_squared: float = NAN
    residual_over_noise: float = NAN


NO_DECAY = FreeDecayResults()
"""Where it is not determined."""


@dataclass(frozen=True)
class IdentificationResults:
    """The two-body model fitted to both mean traces; NaN: the model does not describe them.

    `_u` is the standard uncertainty, `_expanded` the half-width of the 95 % interval.

    Attributes
    ----------
    model : str
        "driven": equation (4) on the hammer, the sample driven by F(t) alone; "printed":
        equations (1) and (2) as they stand.
    is_preferred : bool
        It describes both traces, and of all that do its `criterion` is the smallest.
    criterion : float
        Bayesian information criterion [-]; ten less is very strong evidence.
    contact_time_s, stiffness_n_per_m, damping_coefficient_n_s_per_m, damping_ratio : float
        tau_p [s], k2 [N/m], c2 [N s/m] and zeta2 [-], each with `_u` and `_expanded`.
    force_balance : float
        Force on the sample over force on the hammer [-]; 1 by Newton's third law, if masses
        and calibrations are right and the model holds.
    residual_hammer_percent, residual_sample_percent : float
        RMS of what is left, over the trace's peak [%].
    residual_over_noise : float
        The same over the noise, both traces together [-]; 1: nothing but noise.
    parameters : tuple of str
        Names of all fitted parameters.
    values : tuple of float
        Theirs, in SI units.
    covariance : tuple of float
        Of one mean trace's noise, row by row, as many rows as parameters.
    undetermined : tuple of str
        Which combinations the traces do not determine.
    notes : tuple of str
        What else must be known to read the values.
    """

    model: str
    is_preferred: bool = False
    criterion: float = NAN
    contact_time_s: float = NAN
    contact_time_u_s: float = NAN
    contact_time_expanded_s: float = NAN
    stiffness_n_per_m: float = NAN
    stiffness_u_n_per_m: float = NAN
    stiffness_expanded_n_per_m: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_coefficient_u_n_s_per_m: float = NAN
    damping_coefficient_expanded_n_s_per_m: float = NAN
    damping_ratio: float = NAN
    damping_ratio_u: float = NAN
    damping_ratio_expanded: float = NAN
    force_balance: float = NAN
    residual_hammer_percent: float = NAN
    residual_sample_percent: float = NAN
    residual_over_noise: float = NAN
    parameters: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    covariance: tuple[float, ...] = ()
    undetermined: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
