"""What was estimated of hammer and samples, flat, with the names and units that leave the core.

The field names are those of results.json, and without their units those of the messages. Nothing
in here depends on when, where or with which libraries the numbers were found: the same hits give
the same results, character by character.
"""

import math
from dataclasses import dataclass

NAN = math.nan


@dataclass(frozen=True)
class BudgetLineResults:
    """One contribution to the uncertainty of one quantity.

    Attributes
    ----------
    quantity : str
        Of which the uncertainty is: "contact_time", "stiffness", "damping_ratio",
        "damping_coefficient".
    source : str
        Where it comes from, in words.
    kind : str
        "A": from the hits; "B": from what else is known.
    contribution : float
        Standard uncertainty that it causes, in the quantity's SI unit.
    share : float
        Of the variance [-]; the shares of a quantity add up to 1.
    """

    quantity: str
    source: str
    kind: str
    contribution: float
    share: float


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


@dataclass(frozen=True)
class HammerResults:
    """What the control experiment says of the hammer; NaN: not determined.

    `_u` is the standard uncertainty, `_expanded` the half-width of the 95 % interval.

    Attributes
    ----------
    control_sample : str
        Sample of the control experiment; empty: the set has none.
    stiffness_n_per_m and its `_u`, `_expanded` : float
        k1 [N/m].
    damping_coefficient_n_s_per_m and its `_u`, `_expanded` : float
        c1 [N s/m].
    damping_ratio and its `_u`, `_expanded` : float
        zeta1 [-].
    log_decrement : float
        Delta1 [-].
    budget : tuple of BudgetLineResults
        Of all of these, the largest contribution first.
    notes : tuple of str
        What could not be determined, and why.
    """

    control_sample: str = ""
    stiffness_n_per_m: float = NAN
    stiffness_u_n_per_m: float = NAN
    stiffness_expanded_n_per_m: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_coefficient_u_n_s_per_m: float = NAN
    damping_coefficient_expanded_n_s_per_m: float = NAN
    damping_ratio: float = NAN
    damping_ratio_u: float = NAN
    damping_ratio_expanded: float = NAN
    log_decrement: float = NAN
    budget: tuple[BudgetLineResults, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class SampleResults:
    """What is known of one sample; NaN: not determined, see the notes.

    `_u` is the standard uncertainty, `_expanded` the half-width of the 95 % interval.

    Attributes
    ----------
    name : str
        Of the sample.
    impacts_accepted, impacts_rejected : int
        Hits in the mean and left out.
    contact_time_s and its `_u`, `_expanded` : float
        tau_p of the mean trace [s].
    contact_time_spread_s : float
        Its standard deviation over the hits [s].
    half_amplitude_width_s : float
        w50 [s].
    width_ratio : float
        w10 / w50 [-].
    equivalent_stiffness_n_per_m, stiffness_n_per_m, each with `_u` and `_expanded` : float
        k_eq and k2 [N/m].
    damping_coefficient_n_s_per_m and its `_u`, `_expanded` : float
        c2 [N s/m].
    damping_ratio and its `_u`, `_expanded` : float
        zeta2 [-].
    log_decrement : float
        Delta2 [-].
    first_peak_m_per_s2, second_peak_m_per_s2 : float
        Magnitudes of U1 and U2, from which it is read [m/s^2].
    first_peak_time_s, second_peak_time_s : float
        Of U1 and U2 from the middle of the hammer pulse [s].
    hammer_peak_m_per_s2, specimen_peak_m_per_s2 : float
        Of the mean traces [m/s^2].
    mse_hammer_percent, mse_sample_percent : float
        Mean square error of the force-driven model over the record, as in Fig. 6 [%].
    contact_error_hammer_percent, contact_error_sample_percent : float
        RMS error of the same over the contact alone [%].
    shift_hammer_s, shift_sample_s : float
        Applied to that model's traces, later is positive [s].
    printed_mse_hammer_percent, printed_mse_sample_percent : float
        Mean square error of equations (1) and (2) as printed [%].
    budget : tuple of BudgetLineResults
        Of the uncertainties above, the largest contribution of each quantity first.
    pulse_shape : PulseShapeResults
        Whether the pulse is a versed-sine, and what else it may be.
    free_decay : FreeDecayResults
        Damping from the decay after the contact.
    identifications : tuple of IdentificationResults
        One for each variant of the model that could be fitted.
    warnings : tuple of str
        What a reader of the numbers must know.
    notes : tuple of str
        What could not be determined, and why.
    """

    name: str
    impacts_accepted: int
    impacts_rejected: int
    contact_time_s: float = NAN
    contact_time_u_s: float = NAN
    contact_time_expanded_s: float = NAN
    contact_time_spread_s: float = NAN
    half_amplitude_width_s: float = NAN
    width_ratio: float = NAN
    equivalent_stiffness_n_per_m: float = NAN
    equivalent_stiffness_u_n_per_m: float = NAN
    equivalent_stiffness_expanded_n_per_m: float = NAN
    stiffness_n_per_m: float = NAN
    stiffness_u_n_per_m: float = NAN
    stiffness_expanded_n_per_m: float = NAN
    damping_coefficient_n_s_per_m: float = NAN
    damping_coefficient_u_n_s_per_m: float = NAN
    damping_coefficient_expanded_n_s_per_m: float = NAN
    damping_ratio: float = NAN
    damping_ratio_u: float = NAN
    damping_ratio_expanded: float = NAN
    log_decrement: float = NAN
    first_peak_m_per_s2: float = NAN
    first_peak_time_s: float = NAN
    second_peak_m_per_s2: float = NAN
    second_peak_time_s: float = NAN
    hammer_peak_m_per_s2: float = NAN
    specimen_peak_m_per_s2: float = NAN
    mse_hammer_percent: float = NAN
    mse_sample_percent: float = NAN
    contact_error_hammer_percent: float = NAN
    contact_error_sample_percent: float = NAN
    shift_hammer_s: float = NAN
    shift_sample_s: float = NAN
    printed_mse_hammer_percent: float = NAN
    printed_mse_sample_percent: float = NAN
    budget: tuple[BudgetLineResults, ...] = ()
    pulse_shape: PulseShapeResults = PulseShapeResults()
    free_decay: FreeDecayResults = FreeDecayResults()
    identifications: tuple[IdentificationResults, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def identification(self) -> IdentificationResults | None:
        """That of the preferred variant of the model."""
        return next((item for item in self.identifications if item.is_preferred), None)
