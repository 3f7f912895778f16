"""The Cramer-Rao bound: what no unbiased estimator can beat in white noise."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.checks import check_positive
from impact_rig.core.identification.identifiability import check_independence
from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.model.impact import ImpactModel, ModelVariant
from impact_rig.core.signals.record import FloatArray, make_read_only


@dataclass(frozen=True)
class CramerRaoBound:
    """Smallest covariance of unbiased estimates.

    Attributes
    ----------
    names : tuple of str
        Of the parameters, as an identification has them.
    covariance : ndarray, shape (p, p)
        [SI units]; read-only.
    """

    names: tuple[str, ...]
    covariance: FloatArray


def compute_model_bound(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    start_time: float,
    noise: tuple[float, float],
) -> CramerRaoBound:
    """Compute the bound for all parameters of the driven model from both traces, unfiltered.

    The sample's gain and both offsets are unknown as well; v1 and the masses are known.

    Parameters
    ----------
    model : ImpactModel
        The truth.
    sampling_rate : float
        [Hz]
    start_time : float
        Start of the contact, counted from the first point [s].
    noise : tuple of float
        Standard deviation of the white noise on hammer and sample [m/s^2].

    Raises
    ------
    NotDeterminedError
        If the traces do not determine the parameters, whatever the noise.
    ParameterError
        If a number is impossible.
    """
    for name, value in zip(("hammer noise", "sample noise"), noise, strict=True):
        check_positive(name, value, "m/s^2")
    measured = MeasuredModel(
        ModelVariant.DRIVEN,
        hammer_mass=model.hammer.mass,
        moving_mass=model.specimen.mass,
        impact_speed=model.impact_speed,
        sampling_rate=sampling_rate,
        count=count,
    )
    known = {
        "tau_p": model.contact_time,
        "t0": start_time,
        "k2": model.specimen.stiffness,
        "c2": model.specimen.damping_coefficient,
        "F0": model.peak_force,
        "sample gain": 1.0,
    }
    values = np.array([known.get(name, 0.0) for name in measured.names])
    _, derivatives = measured.evaluate(values)
    weighted = derivatives / np.array(noise)[:, np.newaxis, np.newaxis]
    rows = np.concatenate([weighted[0].T, weighted[1].T])
    check_independence(measured.names, rows)
    # Scaled to unit lengths, since parameters in SI units differ by ten orders of magnitude.
    lengths = np.linalg.norm(rows, axis=0)
    scaled = rows / lengths
    covariance = np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths)
    return CramerRaoBound(measured.names, make_read_only(covariance))
