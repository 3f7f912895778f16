"""What was estimated of hammer and samples, flat, with the names and units that leave the core.

The field names are those of results.json, and without their units those of the messages. Nothing
in here depends on when, where or with which libraries the numbers were found: the same hits give
the same results, character by character.
"""

import math
from dataclasses import dataclass

from impact_rig.results.cross_checks import (
    NO_DECAY,
    NO_SHAPE,
    FreeDecayResults,
    IdentificationResults,
    PulseShapeResults,
)

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
    pulse_shape: PulseShapeResults = NO_SHAPE
    free_decay: FreeDecayResults = NO_DECAY
    identifications: tuple[IdentificationResults, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def identification(self) -> IdentificationResults | None:
        """That of the preferred variant of the model."""
        return next((item for item in self.identifications if item.is_preferred), None)
