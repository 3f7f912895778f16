"""Verdicts, estimates and comparisons that come in, as one of our types."""

import math
from typing import Any

import numpy as np
from impact_rig_msgs import msg
from numpy.typing import NDArray

from impact_rig.core.given.errors import ParameterError, check_not_negative
from impact_rig.recordings.messages import (
    from_message,
    label_from_msg,
    origin_from_msg,
    speed_from_msg,
)
from impact_rig.results.campaign import HitResults
from impact_rig.results.traces import AlignedHit, JudgedTraces, ModelTraces, SampleTraces


def hit_results_from_msg(message: msg.Impact) -> HitResults:
    """Return a judged hit as the results that leave the rig, without injected faults.

    Raises
    ------
    ParameterError
        If a number or a reason cannot be meant.
    """
    speed = speed_from_msg(message)
    return from_message(
        HitResults,
        message,
        injected_faults=(),
        origin=origin_from_msg(message),
        impact_speed=speed.value,
        impact_speed_uncertainty=speed.standard,
    )


def traces_from_msg(message: msg.ModelComparison) -> SampleTraces:
    """Return the mean hit of a sample in m/s^2 with one model, and without an estimate's marks.

    Raises
    ------
    ParameterError
        If rate, peaks or traces cannot be meant.
    """
    rate = _read_rate(message)
    for name in ("start_time", "contact_time", "hammer_peak", "specimen_peak"):
        if not math.isfinite(value := getattr(message, name)):
            raise ParameterError(f"{name} is {value:g}: it must be finite")
    measured = (message.hammer_measured, message.specimen_measured)
    modelled = (message.hammer_model, message.specimen_model)
    size = len(message.hammer_measured)
    peaks = np.array([[message.hammer_peak], [message.specimen_peak]])
    return SampleTraces(
        name=message.sample,
        sampling_rate=rate,
        # There from the start of the contact, here from its middle.
        start_time=message.start_time - message.contact_time / 2.0,
        mean=_stack(measured, size) * peaks,
        contact_time=message.contact_time,
        half_amplitude_width=math.nan,
        first_peak_time=math.nan,
        second_peak_time=math.nan,
        models=(
            ModelTraces(
                message.model,
                _stack(modelled, size) * peaks,
                (message.mse_hammer_percent, message.mse_sample_percent),
            ),
        ),
    )


def judged_traces_from_msg(message: msg.ImpactTrace) -> JudgedTraces:
    """Return a hit's traces as they were judged.

    Raises
    ------
    ParameterError
        If rate or traces cannot be meant.
    """
    rate = _read_rate(message)
    channels = [message.hammer] + [message.specimen] * bool(message.specimen)
    traces = _stack(tuple(channels), len(message.time))
    if not (np.isfinite(traces).all() and math.isfinite(message.time[0])):
        raise ParameterError("its traces must be finite")
    for scale in message.full_scale:
        check_not_negative("full_scale", scale, "m/s^2")
    aligned = AlignedHit(label_from_msg(message), rate, float(message.time[0]), traces)
    return JudgedTraces(aligned, message.accepted, message.contact_time, tuple(message.full_scale))


def _read_rate(message: msg.ModelComparison | msg.ImpactTrace) -> float:
    """Return the sampling rate [Hz]; raises `ParameterError` if it cannot be meant."""
    rate = float(message.sampling_rate)
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"sampling_rate is {rate:g} Hz: it must be above 0")
    return rate


def _stack(traces: tuple[Any, ...], size: int) -> NDArray[np.float64]:
    """Return traces of a message, shape (channels, size); raises `ParameterError`."""
    sizes = {size, *map(len, traces)}
    if len(sizes) != 1 or 0 in sizes:
        raise ParameterError(
            f"its traces have {sorted(sizes)} points: they must be as long, and not empty"
        )
    views = [np.frombuffer(memoryview(trace), np.float32) for trace in traces]
    return np.stack(views).astype(np.float64)
