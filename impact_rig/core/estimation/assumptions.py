"""Which assumptions of the paper's method a sample's hits contradict, in words."""

import numpy as np

from impact_rig.core.estimation.fits import FittedModel, FreeDecayEstimate
from impact_rig.core.estimation.paper_method import BodyEstimate
from impact_rig.core.estimation.pulse_shape import PulseShapeEstimate
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.samples import RigSetup

DITHER = 0.4
"""Noise over one count below which the converter's steps show in the mean [-]: their remainder
exp(-2 pi^2 0.4^2) is 4 % of that of a noiseless converter."""
LARGEST_MASS_DIFFERENCE = 0.2
"""Of control sample and hammer, over the hammer's mass [-], our choice: the paper's are 5 %
apart."""
LARGEST_IMBALANCE = 0.05
"""Of the forces on hammer and sample [-], our choice: accelerometers are calibrated to a few per
cent."""
STEPS = (
    "the noise is smaller than the converter's steps and does not average them out: the"
    " uncertainties of free decay and identification leave that out; amplify the signals, or use"
    " more bits"
)
DRIVEN_PEAK = (
    "damping by the log decrement and by the free decay differ by more than their uncertainties:"
    " the body is still driven at its largest peak, and the free decay is to be preferred"
)


def check_shape(shape: PulseShapeEstimate | None) -> tuple[str, ...]:
    """Warn unless the pulse is a versed-sine."""
    return (shape.warning,) if shape is not None and shape.warning else ()


def check_damping(decay: FreeDecayEstimate | None, body: BodyEstimate) -> tuple[str, ...]:
    """Warn unless the body decays freely from its largest peak."""
    if decay is None:
        return ()
    difference = abs(body.damping_ratio - decay.damping_ratio)
    # Both come from the same hits: the sum is more than the uncertainty of the difference.
    together = body.damping_ratio_uncertainty.expanded + decay.uncertainties.damping_ratio.expanded
    return (DRIVEN_PEAK,) if difference > together else ()


def check_steps(mean: MeanHit) -> tuple[str, ...]:
    """Warn unless the noise dithers the converter."""
    step, noise = mean.summary.largest_step, mean.summary.least_noise
    return (STEPS,) if np.any((step > 0.0) & (noise < DITHER * step)) else ()


def check_control(setup: RigSetup) -> tuple[str, ...]:
    """Warn unless control sample and hammer are alike."""
    control = setup.samples.control_sample
    if not control:
        return ()
    mass, hammer = setup.samples.find_moving_mass(control), setup.hammer_mass
    if abs(mass - hammer) <= LARGEST_MASS_DIFFERENCE * hammer:
        return ()
    warning = (
        f"the control sample {control!r} of {mass * 1e3:.4g} g is not alike to the hammer of"
        f" {hammer * 1e3:.4g} g, as k1 = 2 k_eq assumes: k1, and with it every k2 and c2, may be"
        " wrong"
    )
    return (warning,)


def check_balance(models: tuple[FittedModel, ...]) -> tuple[str, ...]:
    """Warn unless hammer and sample feel the same force."""
    for model in models:
        found = model.identification
        if (
            model.is_preferred
            and found.variant is ModelVariant.DRIVEN
            and abs(found.force_balance - 1.0) > LARGEST_IMBALANCE
        ):
            warning = (
                f"by the identification the sample feels {found.force_balance:.3g} times the"
                " force of the hammer: check masses and calibrations"
            )
            return (warning,)
    return ()
