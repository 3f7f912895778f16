"""From true accelerations to counts: sensors, conditioning and a 12-bit digitizer."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from impact_rig.core.checks import check_between, check_not_negative, check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.record import FloatArray

CountArray = NDArray[np.int32]

SHORTEST_RECORD = 100
"""Least points of a record [-], our choice: fewer show no pulse and its baseline."""


@dataclass(frozen=True)
class DigitizerSettings:
    """The virtual acquisition chain; the paper's digitizer by default.

    Attributes
    ----------
    sampling_rate : float
        [Hz]
    record_duration : float
        [s]
    pre_trigger : float
        Time from the first point to the contact, jitter apart [s].
    bits : int
        Resolution.
    hammer_full_scale, specimen_full_scale : float
        Largest acceleration of each channel [m/s^2]. Our choice: the paper's hits reach 22 to
        53 % and 8 to 45 % of them.
    noise : float
        White noise, standard deviation as part of full scale [-]. Our choice: two steps.
    offset : float
        Unknown offset, part of full scale [-].
    drift : float
        Change of the offset over one record, part of full scale [-].
    coupling_frequency : float
        -3 dB of the AC coupling [Hz]; 0: DC coupled.
    trigger_jitter : float
        Standard deviation of the trigger's position [s].
    """

    sampling_rate: float = 2.5e6
    record_duration: float = 2e-3
    pre_trigger: float = 0.2e-3
    bits: int = 12
    hammer_full_scale: float = 2000.0
    specimen_full_scale: float = 4000.0
    noise: float = 1e-3
    offset: float = 2e-3
    drift: float = 0.0
    coupling_frequency: float = 0.1
    trigger_jitter: float = 1e-6

    def __post_init__(self) -> None:
        """Refuse impossible numbers."""
        check_positive("sampling rate", self.sampling_rate, "Hz")
        check_positive("record duration", self.record_duration, "s")
        if self.count < SHORTEST_RECORD:
            raise ParameterError(
                f"record duration is {self.record_duration:g} s, which is {self.count} points at"
                f" {self.sampling_rate:g} Hz: a record needs {SHORTEST_RECORD}"
            )
        check_between("pre-trigger", self.pre_trigger, 0.0, self.record_duration)
        check_between("bits", self.bits, 4, 31)
        check_positive("hammer full scale", self.hammer_full_scale, "m/s^2")
        check_positive("sample full scale", self.specimen_full_scale, "m/s^2")
        for name in ("noise", "offset", "drift"):
            check_between(name, getattr(self, name), 0.0, 1.0)
        check_not_negative("coupling frequency", self.coupling_frequency, "Hz")
        check_not_negative("trigger jitter", self.trigger_jitter, "s")

    @property
    def count(self) -> int:
        """Points in one record."""
        return round(self.sampling_rate * self.record_duration)


def find_scale(full_scale: float, bits: int) -> float:
    """Return the acceleration of one count [m/s^2]."""
    return full_scale / 2.0 ** (bits - 1)


def digitize(
    acceleration: FloatArray,
    full_scale: float,
    settings: DigitizerSettings,
    generator: np.random.Generator,
) -> CountArray:
    """Couple, offset, add noise, quantise and clip one channel.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        True acceleration [m/s^2].
    full_scale : float
        Of the channel [m/s^2].
    settings : DigitizerSettings
        The chain.
    generator : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    ndarray of int32, shape (n,)
        Counts within the converter's range.
    """
    signal = couple(acceleration, settings.coupling_frequency, settings.sampling_rate)
    count = signal.size
    signal = signal + full_scale * (
        settings.offset
        + settings.drift * np.arange(count) / count
        + settings.noise * generator.standard_normal(count)
    )
    largest = 2 ** (settings.bits - 1)
    counts = np.rint(signal / find_scale(full_scale, settings.bits))
    return np.clip(counts, -largest, largest - 1).astype(np.int32)


def couple(signal: FloatArray, coupling_frequency: float, sampling_rate: float) -> FloatArray:
    """High-pass a signal, shape (n,), at rest before its first point, by one RC stage."""
    if coupling_frequency == 0.0:
        return signal
    pole = math.exp(-2.0 * math.pi * coupling_frequency / sampling_rate)
    gain = (1.0 + pole) / 2.0
    coupled: FloatArray = lfilter([gain, -gain], [1.0, -pole], signal)
    return coupled
