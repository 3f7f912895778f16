"""Traces of one sample, laid over each other: its hits, their mean, the models.

All times count from the middle of the hammer pulse, as the averaging has it, all traces are in
m/s^2 and went through the low-pass.
"""

import math
from dataclasses import dataclass

import numpy as np

from impact_rig.core.hits import FilteredHit, MeanHit
from impact_rig.core.records import FloatArray, HitLabel
from impact_rig.core.sample import SampleEstimate

DRIVEN = "driven"
"""Equation (4) on the hammer, the sample driven by F(t) alone, k and c by the paper's method."""
PRINTED = "printed"
"""Equations (1) and (2) as printed, k and c by the paper's method."""
IDENTIFIED = "identified"
"""The variant that was fitted best to both traces."""


@dataclass(frozen=True)
class AlignedHit:
    """One hit, filtered, in its sample's time."""

    label: HitLabel
    sampling_rate: float  # [Hz]
    start_time: float  # of the first point from the middle of the hammer pulse [s]
    traces: FloatArray  # shape (channels, n): hammer, then sample where measured [m/s^2]

    @property
    def time(self) -> FloatArray:
        """From the middle of the hammer pulse [s], shape (n,)."""
        return make_time(self.start_time, self.sampling_rate, self.traces.shape[1])


@dataclass(frozen=True)
class ModelTraces:
    """One model beside a sample's mean hit."""

    model: str  # `DRIVEN`, `PRINTED` or `IDENTIFIED`
    # Shape (2, n): hammer and sample [m/s^2] on the points of the mean. `DRIVEN` and `PRINTED` are
    # scaled to the peaks of the mean and shifted onto it, each channel by itself.
    traces: FloatArray
    mse_percent: tuple[float, float]  # over the record, as in Fig. 6, by channel


@dataclass(frozen=True)
class SampleTraces:
    """The mean hit of one sample, what was read from it, and the models."""

    name: str  # of the sample
    sampling_rate: float  # [Hz]
    start_time: float  # of the first point from the middle of the hammer pulse [s]
    mean: FloatArray  # shape (channels, n): hammer, then sample where measured [m/s^2]
    contact_time: float  # tau_p [s]; the contact lasts from -tau_p / 2 to tau_p / 2
    half_amplitude_width: float  # w50 [s]; the hammer has half its peak at -w50 / 2 and w50 / 2
    first_peak_time: float  # of the sample's U1 [s]; NaN: not determined
    second_peak_time: float  # of the sample's U2 [s]; NaN: not determined
    models: tuple[ModelTraces, ...]

    @property
    def time(self) -> FloatArray:
        """From the middle of the hammer pulse [s], shape (n,)."""
        return make_time(self.start_time, self.sampling_rate, self.mean.shape[1])

    @property
    def half_amplitude_points(self) -> tuple[tuple[float, float], ...]:
        """Times [s] and accelerations [m/s^2] between which w50 lies; none: not determined."""
        half, level = 0.5 * self.half_amplitude_width, 0.5 * find_peak(self.mean[0])
        return ((-half, level), (half, level)) if math.isfinite(half) else ()

    @property
    def peak_points(self) -> tuple[tuple[str, float, float], ...]:
        """U1 and U2 on the sample's mean, as far as they are determined: name, time, height."""
        return tuple(
            (name, time, float(np.interp(time, self.time, self.mean[1])))
            for name, time in (("U1", self.first_peak_time), ("U2", self.second_peak_time))
            if math.isfinite(time) and len(self.mean) > 1
        )

    def normalise(self, channel: int) -> tuple[FloatArray, FloatArray | None]:
        """Return mean and driven model over the peak of the mean, as Fig. 5 shows them [-].

        The model has the peak of the mean and is shifted onto it; None: there is none.
        """
        peak = find_peak(self.mean[channel]) or 1.0
        model = self.find_model(DRIVEN)
        modelled = None if model is None else model.traces[channel] / peak
        return self.mean[channel] / peak, modelled

    def find_model(self, model: str) -> ModelTraces | None:
        """Return what one model says, if it was drawn."""
        return next((item for item in self.models if item.model == model), None)

    def compute_residual(self, model: ModelTraces) -> FloatArray:
        """Return measured minus model [m/s^2], shape (2, n)."""
        return self.mean - model.traces


def find_peak(trace: FloatArray) -> float:
    """Return the value of largest magnitude of a trace, shape (n,), its sign included.

    Points that are not finite count as nothing; 0 if there are no others.
    """
    finite = np.nan_to_num(trace, nan=0.0, posinf=0.0, neginf=0.0)
    return float(finite[np.argmax(np.abs(finite))])


def make_time(start_time: float, sampling_rate: float, count: int) -> FloatArray:
    """Return the times of equally spaced points [s], shape (count,)."""
    return start_time + np.arange(count) / sampling_rate


def align_hit(label: HitLabel, hit: FilteredHit) -> AlignedHit:
    """Return the traces of a hit in its sample's time."""
    traces, origin = hit.align()
    return AlignedHit(label, hit.sampling_rate, -origin / hit.sampling_rate, traces)


def sample_traces_from_estimate(estimate: SampleEstimate, mean: MeanHit) -> SampleTraces | None:
    """Gather the traces behind the estimate of one sample.

    Parameters
    ----------
    estimate : SampleEstimate
        With or without fitted models.

    Returns
    -------
    SampleTraces or None
        None: the contact was not determined.
    """
    if not estimate.contact_time.is_known:
        return None
    models = [
        ModelTraces(
            found.variant.value,
            np.stack([body.model * body.peak for body in (found.hammer, found.specimen)]),
            (found.hammer.mse_percent, found.specimen.mse_percent),
        )
        for found in estimate.comparisons
    ]
    fitted = estimate.identification
    if fitted is not None and fitted.identification is not None:
        found = fitted.identification
        hammer, specimen = (
            100.0 * float(np.mean(np.square((trace - model) / np.abs(trace).max())))
            for model, trace in zip(found.model, mean.traces, strict=True)
        )
        models.append(ModelTraces(IDENTIFIED, found.model, (hammer, specimen)))
    return SampleTraces(
        name=estimate.name,
        sampling_rate=mean.sampling_rate,
        start_time=-mean.origin / mean.sampling_rate,
        mean=mean.traces,
        contact_time=estimate.contact_time.value,
        half_amplitude_width=estimate.half_amplitude_width,
        first_peak_time=estimate.first_peak_time,
        second_peak_time=estimate.second_peak_time,
        models=tuple(models),
    )
