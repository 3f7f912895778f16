"""Comparisons with the model and estimates, joined to the traces of a sample."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from impact_rig_msgs.msg import ModelComparison, SampleEstimate
from numpy.typing import NDArray

from impact_rig.core.errors import SignalError
from impact_rig.results.sample_traces import ModelTraces, SampleTraces


def sample_traces_from_msgs(
    comparisons: Sequence[ModelComparison], estimate: SampleEstimate | None
) -> SampleTraces:
    """Return the mean hit of a sample in m/s^2, with the models that were laid onto it.

    Parameters
    ----------
    comparisons : sequence of impact_rig_msgs.msg.ModelComparison
        Of one sample, the newest of each model, the newest of all last; those of another mean
        than this one are left out.
    estimate : impact_rig_msgs.msg.SampleEstimate or None
        Of the same sample. Its peaks are taken where the comparisons give none, as those that
        were recorded with an old version.

    Returns
    -------
    SampleTraces

    Raises
    ------
    SignalError
        If nobody knows the peaks: the traces have no scale.
    """
    newest = comparisons[-1]
    hammer_peak = _find_peak(newest.hammer_peak, estimate and estimate.hammer_peak)
    specimen_peak = _find_peak(newest.specimen_peak, estimate and estimate.specimen_peak)
    if math.isnan(hammer_peak) or math.isnan(specimen_peak):
        raise SignalError(
            f"the mean traces of {newest.sample!r} have no scale: neither comparison nor estimate"
            " gives their peaks"
        )
    peaks = np.array([[hammer_peak], [specimen_peak]])
    mean = _stack(newest.hammer_measured, newest.specimen_measured) * peaks
    models = tuple(
        ModelTraces(
            model=comparison.model,
            traces=_stack(comparison.hammer_model, comparison.specimen_model) * peaks,
            mse_hammer_percent=comparison.mse_hammer_percent,
            mse_sample_percent=comparison.mse_sample_percent,
        )
        for comparison in comparisons
        if comparison.impacts_accepted == newest.impacts_accepted
        and len(comparison.hammer_model) == mean.shape[1]
    )
    return SampleTraces(
        name=newest.sample,
        sampling_rate=newest.sampling_rate,
        # There from the start of the contact, here from its middle.
        start_time=newest.start_time - newest.contact_time / 2.0,
        mean=mean,
        contact_time=newest.contact_time,
        half_amplitude_width=estimate.half_amplitude_width if estimate else math.nan,
        first_peak_time=estimate.first_peak_time if estimate else math.nan,
        second_peak_time=estimate.second_peak_time if estimate else math.nan,
        models=models,
    )


def _find_peak(signed: float, magnitude: float | None) -> float:
    """Return what a trace was divided by [m/s^2]; NaN: nobody knows."""
    return next(
        (value for value in (signed, magnitude) if value and math.isfinite(value)), math.nan
    )


def _stack(hammer: Any, specimen: Any) -> NDArray[np.float64]:
    """Return two traces of a message, shape (2, n)."""
    traces = [np.frombuffer(memoryview(trace), np.float32) for trace in (hammer, specimen)]
    count = min(trace.size for trace in traces)
    return np.stack([trace[:count] for trace in traces]).astype(np.float64)
