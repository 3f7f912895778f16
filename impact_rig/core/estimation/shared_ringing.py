"""What rings alike on all samples, whatever they weigh, is a sensor or its mount and no sample."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impact_rig.core.estimation.fits import NO_DECAY, find_frequency
from impact_rig.core.estimation.sample import DRIVEN_PEAK, SampleEstimate
from impact_rig.core.estimation.sensor_check import SAME_FREQUENCY
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.setup.samples import RigSetup

FEWEST_SAMPLES = 3
"""That ring at one frequency [-], our choice: of two samples k/m may well be alike."""
LEAST_MASS_RATIO = 1.5
"""Of the heaviest over the lightest of them [-], our choice."""


def withdraw_shared_ringing(
    samples: Sequence[SampleEstimate], setup: RigSetup
) -> tuple[SampleEstimate, ...]:
    """Take free decay, damping and model from samples that all ring at one frequency."""
    rings = [sample for sample in samples if sample.free_decay.is_known]
    masses = [setup.samples.get_moving_mass(sample.name) for sample in rings]
    if len(rings) < FEWEST_SAMPLES or not max(masses) >= LEAST_MASS_RATIO * min(masses):
        return tuple(samples)
    shared = float(np.median([sample.free_decay.frequency for sample in rings]))

    def is_shared(frequency: float) -> bool:
        return abs(frequency - shared) < SAME_FREQUENCY * shared

    if not all(is_shared(sample.free_decay.frequency) for sample in rings):
        return tuple(samples)
    note = (
        f"what rings at {shared * 1e-3:.2g} kHz does so on all samples, though their masses"
        " differ: it is a sensor or its mount, and no sample's k, zeta or c comes from it"
    )

    def withdraw(sample: SampleEstimate) -> SampleEstimate:
        period = sample.second_peak_time - sample.first_peak_time
        if is_shared(1.0 / period if period else 0.0):
            sample = replace(
                sample,
                damping_ratio=UNKNOWN,
                damping_coefficient=UNKNOWN,
                log_decrement=float("nan"),
            )
        if any(
            is_shared(find_frequency(model, sample.name, setup))
            for model in sample.identifications
            if model.stiffness.is_known
        ):
            sample = replace(sample, identifications=())
        return replace(
            sample,
            free_decay=NO_DECAY,
            warnings=tuple(text for text in sample.warnings if text != DRIVEN_PEAK),
            notes=(*sample.notes, note),
        )

    names = {sample.name for sample in rings}
    return tuple(withdraw(sample) if sample.name in names else sample for sample in samples)
