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

    def compute_standard_deviation(self, name: str) -> float:
        """Return the smallest standard deviation of one parameter [its SI unit]."""
        index = self.names.index(name)
        return float(np.sqrt(self.covariance[index, index]))


def compute_model_bound(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    start_time: float,
    noise: tuple[float, float],
    variant: ModelVariant = ModelVariant.DRIVEN,
) -> CramerRaoBound:
    """Compute the bound for all parameters of the model from both traces, unfiltered.

    The sample's gain and both offsets are unknown as well; v1 and the masses are known.

    Parameters
    ----------
    model : ImpactModel
        The truth.
    sampling_rate : float
        [Hz]
    count : int
        Points of each trace.
    start_time : float
        Start of the contact, counted from the first point [s].
    noise : tuple of float
        Standard deviation of the white noise on hammer and sample [m/s^2].
    variant : ModelVariant
        How the bodies are driven.

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
        variant,
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
        "k1": model.hammer.stiffness,
        "c1": model.hammer.damping_coefficient,
        "sample gain": 1.0,
    }
    values = np.array([known.get(name, 0.0) for name in measured.names])
    _, derivatives = measured.evaluate(values)
    weighted = derivatives / np.array(noise)[:, np.newaxis, np.newaxis]
    return _bound(measured.names, np.concatenate([weighted[0].T, weighted[1].T]))


def compute_pulse_bound(
    contact_time: float,
    peak: float,
    sampling_rate: float,
    count: int,
    start_time: float,
    noise: float,
) -> CramerRaoBound:
    """Compute the bound for tau_p from the hammer's trace alone.

    A versed-sine of unknown duration, start, height and offset.

    Parameters
    ----------
    contact_time : float
        tau_p [s].
    peak : float
        Height of the pulse [m/s^2].
    sampling_rate : float
        [Hz]
    count : int
        Points.
    start_time : float
        Start of the pulse, counted from the first point [s].
    noise : float
        Standard deviation of the white noise [m/s^2].

    Returns
    -------
    CramerRaoBound
        Of tau_p, t0 [s], peak and offset [m/s^2].

    Raises
    ------
    NotDeterminedError
        If the record does not have the pulse.
    ParameterError
        If a number is impossible.
    """
    for name, value, unit in (
        ("contact time", contact_time, "s"),
        ("sampling rate", sampling_rate, "Hz"),
        ("noise", noise, "m/s^2"),
    ):
        check_positive(name, value, unit)
    phase = (np.arange(count) / sampling_rate - start_time) / contact_time
    inside = (phase >= 0.0) & (phase <= 1.0)
    slope = np.where(inside, np.pi * np.sin(2.0 * np.pi * phase), 0.0)
    derivatives = np.stack(
        [
            -peak / contact_time * phase * slope,
            -peak / contact_time * slope,
            np.where(inside, np.sin(np.pi * phase) ** 2, 0.0),
            np.ones(count),
        ],
        axis=1,
    )
    return _bound(("tau_p", "t0", "peak", "offset"), derivatives / noise)


def _bound(names: tuple[str, ...], derivatives: FloatArray) -> CramerRaoBound:
    check_independence(names, derivatives)
    # Scaled to unit lengths, since parameters in SI units differ by ten orders of magnitude.
    lengths = np.linalg.norm(derivatives, axis=0)
    scaled = derivatives / lengths
    covariance = np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths)
    return CramerRaoBound(names, make_read_only(covariance))
