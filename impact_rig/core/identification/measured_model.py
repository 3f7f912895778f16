"""The model as two sensors show it: each trace with its polarity, gain and offset."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant
from impact_rig.core.model.sensitivities import (
    compute_sensitivities,
    list_parameters,
)
from impact_rig.core.setup.sensors import FLAT, SensorResponse
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray
from impact_rig.core.signals.sensor_response import respond

OFFSETS = ("hammer offset", "sample offset")
SENSOR_PARAMETERS = ("sample gain", *OFFSETS)
"""What the sensors add: gain of the sample's channel, signed [-], and both offsets [m/s^2]."""

ALL_POINTS = slice(None)


def name_parameters(variant: ModelVariant) -> tuple[str, ...]:
    """Return what is identified: the model's parameters, then the sensors'."""
    return (*list_parameters(variant), *SENSOR_PARAMETERS)


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
    responses : tuple of SensorResponse
        Of the sensors.
    """

    variant: ModelVariant
    hammer_mass: float
    moving_mass: float
    impact_speed: float
    sampling_rate: float
    count: int
    cutoff_frequency: float = 0.0
    hammer_polarity: float = 1.0
    responses: tuple[SensorResponse, SensorResponse] = (FLAT, FLAT)

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

    def evaluate(
        self, values: FloatArray, points: slice = ALL_POINTS
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the traces and their derivatives, low-passed.

        Parameters
        ----------
        values : ndarray, shape (p,)
            In the order of `names`, SI units; t0 is counted from the first point.
        points : slice
            Which points to return.

        Returns
        -------
        traces : ndarray, shape (2, m)
            [m/s^2]
        derivatives : ndarray, shape (2, p, m)
            [m/s^2 per unit of the parameter]
        """
        gain = float(values[-3])
        bodies = compute_sensitivities(
            self.make_model(values),
            self.sampling_rate,
            self.count,
            start=-float(values[1]),
            variant=self.variant,
        )
        together = np.concatenate([bodies.derivatives, bodies.traces[:, np.newaxis]], axis=1)
        filtered = self.send_through(together, points)
        rows, traces = filtered[:, :-1], filtered[:, -1]
        derivatives = np.zeros((2, len(self.names), traces.shape[1]))
        derivatives[0, :-3] = self.hammer_polarity * rows[0]
        derivatives[1, :-3] = gain * rows[1]
        derivatives[1, -3] = traces[1]
        derivatives[0, -2] = derivatives[1, -1] = 1.0
        scales = np.array([[self.hammer_polarity], [gain]])
        return scales * traces + values[-2:, np.newaxis], derivatives

    def send_through(self, rows: FloatArray, points: slice = ALL_POINTS) -> FloatArray:
        """Send rows of both bodies, shape (2, ..., n), through sensors and low-pass.

        Zeros cost nothing. Returns `points` of them.
        """
        if not all(response.is_flat for response in self.responses):
            rows = np.stack(
                [
                    respond(body, response, self.sampling_rate)
                    for body, response in zip(rows, self.responses, strict=True)
                ]
            )
        if self.cutoff_frequency == 0.0:
            return rows[..., points]
        filtered = np.zeros_like(rows[..., points])
        # The driven hammer knows nothing of the sample.
        needed = rows.any(axis=-1)
        chosen = low_pass(rows[needed], self.cutoff_frequency, self.sampling_rate)
        filtered[needed] = chosen[..., points]
        return filtered
