"""Free decay and identified model of one sample, with masses, clock and uncertainties."""

from dataclasses import dataclass

from impact_rig.core.damping.free_decay import FreeDecay, estimate_free_decay
from impact_rig.core.damping.log_decrement import estimate_damping_ratio_from_coefficient
from impact_rig.core.errors import RigError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.identification.identifiability import GOOD_CHI_SQUARE, LARGEST_RESIDUAL
from impact_rig.core.identification.identification import Identification, identify_model
from impact_rig.core.identification.search import MisfitError
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.inputs import find_rig_numbers
from impact_rig.core.uncertainty.propagation import (
    BodyUncertainties,
    propagate_free_decay,
    propagate_identification,
)

SPECIMEN_CHANNEL = 1
NO_MODEL = (
    "identification: not determined, since no variant of the two-body model describes both"
    f" traces; one must leave {100.0 * LARGEST_RESIDUAL:g} % of the peak or less"
)


@dataclass(frozen=True)
class FreeDecayEstimate:
    """What the decay after the contact says of a sample.

    Attributes
    ----------
    decay : FreeDecay
        As fitted.
    stiffness : float
        m2 times the natural angular frequency squared [N/m].
    damping_coefficient : float
        c2 [N s/m].
    damping_ratio : float
        zeta2 [-].
    uncertainties : BodyUncertainties
        Of these.
    """

    decay: FreeDecay
    stiffness: float
    damping_coefficient: float
    damping_ratio: float
    uncertainties: BodyUncertainties


@dataclass(frozen=True)
class FittedModel:
    """One variant of the model laid onto both traces of a sample.

    Attributes
    ----------
    identification : Identification
        As fitted: tau_p, k2, c2 and more.
    damping_ratio : float
        zeta2 [-].
    uncertainties : BodyUncertainties
        Of tau_p, k2, c2 and zeta2.
    is_preferred : bool
        It describes both traces, and of all variants that do its criterion is the smallest.
    """

    identification: Identification
    damping_ratio: float
    uncertainties: BodyUncertainties
    is_preferred: bool = False


def estimate_decay(
    mean: MeanHit, setup: RigSetup, sample: str, contact_time: float
) -> FreeDecayEstimate:
    """Estimate stiffness and damping of a sample from the decay after the contact.

    Parameters
    ----------
    mean : MeanHit
        Of the hits on `sample`.
    setup : RigSetup
        Masses, clock and low-pass.
    sample : str
        Name of the sample.
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
    mass = setup.samples.find_moving_mass(sample)
    return FreeDecayEstimate(
        decay=decay,
        stiffness=decay.find_stiffness(mass),
        damping_coefficient=decay.find_damping_coefficient(mass),
        damping_ratio=decay.damping_ratio,
        uncertainties=propagate_free_decay(
            f"scatter of the hits on {sample}",
            decay.hit_values,
            find_rig_numbers(setup, sample),
            estimates=(decay.decay_rate, decay.angular_frequency),
            averaged=mean.count,
            owner=f"{sample}, free decay",
        ),
    )


def fit_models(
    mean: MeanHit, setup: RigSetup, sample: str, start: StartingValues
) -> tuple[tuple[FittedModel, ...], tuple[str, ...]]:
    """Fit the variants of the model to both mean traces of a sample.

    One that leaves nothing but noise cannot be outdone: then the next is not tried.

    Parameters
    ----------
    mean : MeanHit
        Of the hits on `sample`.
    setup : RigSetup
        Masses, clock, v1 and low-pass.
    sample : str
        Name of the sample.
    start : StartingValues
        What is believed.

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
        add_uncertainties(item, setup, sample, averaged=mean.count, is_preferred=item is best)
        for item in found
    )
    if best is not None:
        # What else could not be fitted is of no concern where one variant fits.
        return models, ()
    return models, tuple(dict.fromkeys([*notes, NO_MODEL] if found else notes))


def add_uncertainties(
    found: Identification,
    setup: RigSetup,
    sample: str,
    *,
    averaged: int = 0,
    is_preferred: bool = False,
) -> FittedModel:
    """Add damping ratio and uncertainties to a model that was fitted to the hits on `sample`.

    `averaged` is the number of hits in the mean; 0: those that it was fitted to one by one.
    """
    columns = [found.names.index(name) for name in ("tau_p", "k2", "c2")]
    return FittedModel(
        identification=found,
        damping_ratio=estimate_damping_ratio_from_coefficient(
            found.damping_coefficient, found.stiffness, setup.samples.find_moving_mass(sample)
        ),
        uncertainties=propagate_identification(
            f"scatter of the hits on {sample}",
            found.hit_values[:, columns],
            find_rig_numbers(setup, sample),
            estimates=found.values[columns].tolist(),
            averaged=averaged,
            owner=f"{sample}, {found.variant.value} model",
        ),
        is_preferred=is_preferred,
    )
