"""The model as two sensors show it: each trace with its polarity, gain and offset."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.model.sensitivities import compute_sensitivities, find_parameter_names
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray

OFFSETS = ("hammer offset", "sample offset")
SENSOR_PARAMETERS = ("sample gain", *OFFSETS)
"""What the sensors add: gain of the sample's channel, signed [-], and both offsets [m/s^2]."""


def name_parameters(variant: ModelVariant) -> tuple[str, ...]:
    """Return what is identified: the model's parameters, then the sensors'."""
    return (*find_parameter_names(variant), *SENSOR_PARAMETERS)


@dataclass(frozen=True)
class MeasuredModel:
    """The model seen through two sensors and a low-pass.

    Attributes
    ----------
    variant : ModelVariant
        How the bodies are driven.
    hammer_mass, moving_mass : float
        m1, and m2 with its accelerometer [kg].
    impact_speed : float
        v1 [m/s]; only the printed model has it.
    sampling_rate : float
        [Hz]
    count : int
        Points of each trace.
    cutoff_frequency : float
        Of the low-pass [Hz]; 0: none.
    hammer_polarity : float
        1 or -1: how the hammer's sensor is mounted.
    """

    variant: ModelVariant
    hammer_mass: float
    moving_mass: float
    impact_speed: float
    sampling_rate: float
    count: int
    cutoff_frequency: float = 0.0
    hammer_polarity: float = 1.0

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters in order."""
        return name_parameters(self.variant)

    def make_model(self, values: FloatArray) -> ImpactModel:
        """Return the model of parameter values in SI units, shape (p,).

        The driven model has neither k1 nor c1: its hammer's spring is 1 N/m.
        """
        found = dict(zip(self.names, values.tolist(), strict=True))
        return ImpactModel(
            hammer=Body(self.hammer_mass, found.get("k1", 1.0), found.get("c1", 0.0)),
            specimen=Body(self.moving_mass, found["k2"], found["c2"]),
            contact_time=found["tau_p"],
            impact_speed=self.impact_speed,
            peak_force=found["F0"],
        )

    def evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the traces and their derivatives, low-passed.

        Parameters
        ----------
        values : ndarray, shape (p,)
            In the order of `names`, SI units; t0 is counted from the first point.

        Returns
        -------
        traces : ndarray, shape (2, n)
            [m/s^2]
        derivatives : ndarray, shape (2, p, n)
            [m/s^2 per unit of the parameter]
        """
        start, gain = float(values[1]), float(values[-3])
        bodies = compute_sensitivities(
            self.make_model(values),
            self.sampling_rate,
            self.count,
            start=-start,
            variant=self.variant,
        )
        rows = np.concatenate([bodies.traces[:, np.newaxis], bodies.derivatives], axis=1)
        filtered = self.low_pass(rows)
        derivatives = np.zeros((2, len(self.names), self.count))
        derivatives[0, :-3] = self.hammer_polarity * filtered[0, 1:]
        derivatives[1, :-3] = gain * filtered[1, 1:]
        derivatives[1, -3] = filtered[1, 0]
        derivatives[0, -2] = derivatives[1, -1] = 1.0
        scales = np.array([[self.hammer_polarity], [gain]])
        return scales * filtered[:, 0] + values[-2:, np.newaxis], derivatives

    def low_pass(self, rows: FloatArray) -> FloatArray:
        """Low-pass rows, shape (..., n); rows of zeros stay as they are and cost nothing."""
        if self.cutoff_frequency == 0.0:
            return rows
        filtered = np.zeros_like(rows)
        # The driven hammer knows nothing of the sample.
        needed = rows.any(axis=-1)
        filtered[needed] = low_pass(rows[needed], self.cutoff_frequency, self.sampling_rate)
        return filtered
