"""Free decay and identified model of one sample, with masses, clock and uncertainties."""

import math
from dataclasses import dataclass, field, replace

from impact_rig.core.damping.free_decay import estimate_free_decay
from impact_rig.core.errors import RigError
from impact_rig.core.estimation.paper_method import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    NAN,
    STIFFNESS,
)
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.identification.fitting import MisfitError
from impact_rig.core.identification.identifiability import GOOD_CHI_SQUARE, LARGEST_RESIDUAL
from impact_rig.core.identification.identification import Identification, identify_model
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.quantity import INTERNAL, UNKNOWN, Quantity, describe
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.propagation import (
    FittedBody,
    find_decaying_body,
    find_identified_body,
    make_rig_numbers,
    propagate_fit,
)

SPECIMEN_CHANNEL = 1
NO_MODEL = (
    "identification: not determined, since no variant of the two-body model describes both"
    f" traces; one must leave {100.0 * LARGEST_RESIDUAL:g} % of the peak or less"
)


@dataclass(frozen=True)
class FreeDecayEstimate:
    """What the decay after the contact says of a sample; NaN: not determined.

    Attributes
    ----------
    stiffness : Quantity
        m2 times the natural angular frequency squared [N/m].
    damping_ratio, damping_coefficient : Quantity
        zeta2 [-] and c2 [N s/m].
    frequency : float
        Of the damped oscillation [Hz].
    periods : float
        Of it that stand out of the noise [-].
    r_squared : float
        Part of the tail's variance that the fit explains [-].
    residual_over_noise : float
        RMS of what is left over the noise [-]; 1: nothing but noise.
    """

    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    frequency: float = field(default=NAN, metadata=describe("Hz", "f", "frequency", shown="kHz"))
    periods: float = NAN
    r_squared: float = NAN
    residual_over_noise: float = NAN

    @property
    def is_known(self) -> bool:
        """Whether it is determined."""
        return self.damping_ratio.is_known


NO_DECAY = FreeDecayEstimate()
"""Where it is not determined."""


@dataclass(frozen=True)
class FittedModel:
    """One variant of the model laid onto both traces of a sample.

    NaN: the model does not describe them, and the nearest parameters of a model that is not this
    body's are no measurement of it.

    Attributes
    ----------
    model : str
        "driven": equation (4) on the hammer, the sample driven by F(t) alone; "printed":
        equations (1) and (2) as they stand.
    is_preferred : bool
        It describes both traces, and of all variants that do its criterion is the smallest.
    criterion : float
        Bayesian information criterion [-]; ten less is very strong evidence.
    contact_time, stiffness, damping_ratio, damping_coefficient : Quantity
        tau_p [s], k2 [N/m], zeta2 [-] and c2 [N s/m].
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
    identification : Identification or None
        As fitted, with the traces.
    """

    model: str
    is_preferred: bool = False
    criterion: float = NAN
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    force_balance: float = NAN
    residual_hammer_percent: float = NAN
    residual_sample_percent: float = NAN
    residual_over_noise: float = NAN
    parameters: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    covariance: tuple[float, ...] = ()
    undetermined: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    identification: Identification | None = field(default=None, metadata=INTERNAL)


def estimate_decay(
    mean: MeanHit, setup: RigSetup, sample: str, contact_time: float
) -> FreeDecayEstimate:
    """Estimate stiffness and damping of a sample from the decay after the contact.

    Parameters
    ----------
    contact_time : float
        tau_p [s].

    Raises
    ------
    NotDeterminedError
        If the tail does not say.
    """
    decay = estimate_free_decay(
        mean, SPECIMEN_CHANNEL, contact_time, setup.analysis.cutoff_frequency
    )
    body = propagate_fit(
        f"scatter of the hits on {sample}",
        decay.hit_values,
        find_decaying_body,
        make_rig_numbers(setup, sample),
        estimates=(decay.decay_rate, decay.angular_frequency),
        averaged=mean.count,
        owner=f"{sample}, free decay",
    )
    return FreeDecayEstimate(
        stiffness=body.stiffness,
        damping_ratio=body.damping_ratio,
        damping_coefficient=body.damping_coefficient,
        frequency=decay.frequency,
        periods=decay.periods,
        r_squared=decay.r_squared,
        residual_over_noise=decay.residual_over_noise,
    )


def fit_models(
    mean: MeanHit, setup: RigSetup, sample: str, start: StartingValues
) -> tuple[tuple[FittedModel, ...], tuple[str, ...]]:
    """Fit the variants of the model to both mean traces of a sample.

    One that leaves nothing but noise cannot be outdone: then the next is not tried.

    Returns
    -------
    models : tuple of FittedModel
        Those that could be fitted.
    notes : tuple of str
        Why there is no preferred one.
    """
    found: list[Identification] = []
    notes: list[str] = []
    for variant in ModelVariant:
        try:
            found.append(identify_model(mean, setup, sample, variant, start))
        except MisfitError:
            notes.append(NO_MODEL)
            continue
        except RigError as error:
            notes.append(str(error))
            continue
        if found[-1].chi_square < GOOD_CHI_SQUARE:
            break
    good = [item for item in found if item.describes_traces]
    best = min(good, key=lambda item: item.criterion, default=None)
    models = tuple(
        _describe_model(item, setup, sample, averaged=mean.count, is_preferred=item is best)
        for item in found
    )
    if best is not None:
        # What else could not be fitted is of no concern where one variant fits.
        return models, ()
    return models, tuple(dict.fromkeys([*notes, NO_MODEL] if found else notes))


def _describe_model(
    found: Identification, setup: RigSetup, sample: str, *, averaged: int, is_preferred: bool
) -> FittedModel:
    model = FittedModel(
        model=found.variant.value,
        is_preferred=is_preferred,
        criterion=found.criterion,
        force_balance=found.force_balance,
        residual_hammer_percent=found.residual_percent[0],
        residual_sample_percent=found.residual_percent[1],
        residual_over_noise=math.sqrt(found.chi_square),
        parameters=found.names,
        values=tuple(found.values.tolist()),
        covariance=tuple(found.covariance.ravel().tolist()),
        undetermined=found.undetermined,
        notes=found.notes,
        identification=found,
    )
    if not found.describes_traces:
        return model
    body = estimate_fitted_body(found, setup, sample, averaged)
    return replace(model, **vars(body))


def find_frequency(model: FittedModel, sample: str, setup: RigSetup) -> float:
    """Return the frequency at which a fitted body swings on its spring [Hz]."""
    stiffness = model.stiffness.value / setup.samples.get_moving_mass(sample)
    return math.sqrt(stiffness) / (2.0 * math.pi)


def estimate_fitted_body(
    found: Identification, setup: RigSetup, sample: str, averaged: int
) -> FittedBody:
    """Estimate tau_p, k2, zeta2 and c2 by a model fitted to the mean of `averaged` hits."""
    columns = [found.names.index(name) for name in ("tau_p", "k2", "c2")]
    return propagate_fit(
        f"scatter of the hits on {sample}",
        found.hit_values[:, columns],
        find_identified_body,
        make_rig_numbers(setup, sample),
        estimates=found.values[columns].tolist(),
        averaged=averaged,
        owner=f"{sample}, {found.variant.value} model",
    )
