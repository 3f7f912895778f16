"""The two-body model fitted to both traces of a sample."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from impact_rig.core.findings import Note, Subject
from impact_rig.core.hits import MeanHit
from impact_rig.core.identification import NAMES, Identification, identify_model
from impact_rig.core.model import ModelVariant
from impact_rig.core.paper_method import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    DAMPING_RATIO,
    NAN,
    STIFFNESS,
)
from impact_rig.core.quantity import INTERNAL, NOT_NEGATIVE, UNKNOWN, Comparable, Quantity
from impact_rig.core.setup import RigSetup
from impact_rig.core.uncertainty import find_identified_body, make_rig_numbers, propagate_fit


@dataclass(frozen=True)
class FittedModel(Comparable):
    """One variant of the model laid onto both traces of a sample; NaN: not determined."""

    model: str  # "driven": equation (4) on the hammer, the sample driven by F(t) alone
    is_preferred: bool = False
    contact_time: Quantity = field(default=UNKNOWN, metadata=CONTACT_TIME)
    stiffness: Quantity = field(default=UNKNOWN, metadata=STIFFNESS)
    damping_ratio: Quantity = field(default=UNKNOWN, metadata=DAMPING_RATIO)
    damping_coefficient: Quantity = field(default=UNKNOWN, metadata=DAMPING_COEFFICIENT)
    # Force on the sample over force on the hammer; 1 if masses, calibrations and model are right.
    force_balance: float = NAN
    # RMS over the trace's peak
    residual_hammer_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    residual_sample_percent: float = field(default=NAN, metadata=NOT_NEGATIVE)
    # RMS of both traces; 1: nothing but noise
    residual_over_noise: float = field(default=NAN, metadata=NOT_NEGATIVE)
    parameters: tuple[str, ...] = ()  # names of all fitted parameters
    values: tuple[float, ...] = ()  # of the parameters, in SI units
    covariance: tuple[float, ...] = ()  # by one mean trace's noise, row by row
    undetermined: tuple[str, ...] = ()  # combinations that the traces do not determine
    notes: tuple[Note, ...] = ()
    identification: Identification | None = field(default=None, metadata=INTERNAL)


def fit_model(mean: MeanHit, setup: RigSetup, sample: str) -> FittedModel:
    """Fit the driven model to both mean traces of a sample.

    A model that comes near them without describing them tells the force balance alone.

    Raises
    ------
    NotDeterminedError
        If it does not come near them.
    """
    found = identify_model(mean, setup, sample)
    described = FittedModel(
        model=ModelVariant.DRIVEN.value,
        is_preferred=True,
        force_balance=found.force_balance,
        residual_hammer_percent=found.residual_percent[0],
        residual_sample_percent=found.residual_percent[1],
        residual_over_noise=math.sqrt(found.chi_square),
    )
    if found.misfit is not None:
        return replace(described, notes=(Note(Subject.IDENTIFICATION, found.misfit),))
    columns = [NAMES.index(name) for name in ("tau_p", "k2", "c2")]
    body: dict[str, Any] = propagate_fit(
        f"scatter of the hits on {sample}",
        found.hit_values[:, columns],
        find_identified_body,
        make_rig_numbers(setup, sample),
        estimates=found.values[columns].tolist(),
        averaged=mean.count,
    )
    is_open = set(found.undetermined)
    for name, parameters in (
        ("contact_time", {"tau_p"}),
        ("stiffness", {"k2"}),
        ("damping_coefficient", {"c2"}),
        ("damping_ratio", {"k2", "c2"}),
    ):
        if is_open & parameters:
            body[name] = UNKNOWN
    return replace(
        described,
        **body,
        parameters=NAMES,
        values=tuple(
            math.nan if name in is_open else value
            for name, value in zip(NAMES, found.values.tolist(), strict=True)
        ),
        covariance=tuple(found.covariance.ravel().tolist()),
        undetermined=tuple(
            f"{name}: not determined by these traces" for name in found.undetermined
        ),
        identification=found,
    )


def find_frequency(model: FittedModel, sample: str, setup: RigSetup) -> float:
    """Return the frequency at which a fitted body swings on its spring [Hz]."""
    stiffness = model.stiffness.value / setup.samples.get_moving_mass(sample)
    return math.sqrt(stiffness) / (2.0 * math.pi)
