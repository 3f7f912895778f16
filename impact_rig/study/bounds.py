"""The least that an unbiased estimator can scatter under the conditions of a case.

The Cramer-Rao bound of the white noise of one hit, sensors and quantiser, with the masses known.
The mean of n hits that scatter by s cannot be known better than s / sqrt(n), whatever the
estimator; and stated masses and clock err by their uncertainties. These parts are independent.
"""

import math
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.identification.cramer_rao import compute_model_bound
from impact_rig.core.model.pulses import VERSED_SINE
from impact_rig.core.setup.samples import RigSetup
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.digitizer import find_scale
from impact_rig.devices.virtual.plants import find_nominal_model
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.study.cases import Case

UNIFORM_VARIANCE = 12.0
"""A step of the quantiser is uniform noise of step^2 / 12."""
NO_BOUND: Mapping[str, float] = MappingProxyType({})


@lru_cache(maxsize=256)
def find_bounds(
    case: Case, rig: VirtualRigSettings, setup: RigSetup, sample: str
) -> Mapping[str, float]:
    """Return the bounds of a campaign's results, relative to the truth [-], by quantity.

    Parameters
    ----------
    case : Case
        Conditions.
    rig : VirtualRigSettings
        As it strikes this sample.
    setup : RigSetup
        As stated.
    sample : str
        Name.

    Returns
    -------
    mapping of str to float
        Empty where the driven model of a versed-sine is not the truth, or there is no noise.
    """
    if rig.plant is not Plant.DYNAMICS or rig.pulse_shape is not VERSED_SINE:
        return NO_BOUND
    digitizer = rig.digitizer
    noise = [
        math.hypot(
            digitizer.noise * full_scale,
            find_scale(full_scale, digitizer.bits) / math.sqrt(UNIFORM_VARIANCE),
        )
        for full_scale in (digitizer.hammer_full_scale, digitizer.specimen_full_scale)
    ]
    model = find_nominal_model(setup, sample, rig.hammer_damping)
    try:
        bound = compute_model_bound(
            model,
            digitizer.sampling_rate,
            digitizer.count,
            digitizer.pre_trigger,
            (noise[0], noise[1]),
        )
    except NotDeterminedError:
        return NO_BOUND

    true = {
        "tau_p": model.contact_time,
        "k2": model.specimen.stiffness,
        "c2": model.specimen.damping_coefficient,
    }

    def covary(first: str, second: str) -> float:
        place = bound.names.index(first), bound.names.index(second)
        return float(bound.covariance[place]) / (true[first] * true[second])

    mass, clock = _find_stated_variances(setup, sample)
    variances = {
        "contact_time": (covary("tau_p", "tau_p") + rig.contact_time_scatter**2) / case.hits
        + clock,
        # k2 goes with the mass and the clock's square, c2 with the mass and the clock.
        "stiffness": covary("k2", "k2") / case.hits + mass + 4.0 * clock,
        "damping_coefficient": covary("c2", "c2") / case.hits + mass + clock,
        # zeta = c / (2 sqrt(k m)): mass and clock cancel.
        "damping_ratio": (covary("c2", "c2") + covary("k2", "k2") / 4.0 - covary("c2", "k2"))
        / case.hits,
    }
    return MappingProxyType({name: math.sqrt(value) for name, value in variances.items()})


def _find_stated_variances(setup: RigSetup, sample: str) -> tuple[float, float]:
    """Return the relative variances of the moving mass and of the clock [-]."""
    samples = setup.samples
    mass = math.hypot(
        samples.find(sample).mass_uncertainty, samples.accelerometer_mass_uncertainty
    )
    return (mass / samples.find_moving_mass(sample)) ** 2, setup.clock_uncertainty**2
