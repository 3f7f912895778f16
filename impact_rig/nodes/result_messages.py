"""Results as messages, and back.

Each carries the id of the campaign that it was found in.
"""

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from impact_rig_msgs import msg
from numpy.typing import NDArray

from impact_rig.core.estimates.model import ModelComparison
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import SpeedExponents
from impact_rig.core.given.errors import ParameterError, check_not_negative
from impact_rig.core.given.findings import Finding, Note, Subject
from impact_rig.core.given.quantity import make_result
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import Overrule
from impact_rig.nodes.identity import NO_IDENTITY, Identity
from impact_rig.nodes.messages import describe_estimator, make_message, stamp_to_msg
from impact_rig.recordings.fields import fill_message, from_message
from impact_rig.recordings.messages import (
    label_from_msg,
    origin_from_msg,
    setup_from_msg,
    speed_from_msg,
)
from impact_rig.results.campaign import HitResults, Results, hit_results_from_judged
from impact_rig.results.traces import AlignedHit, JudgedTraces, ModelTraces, SampleTraces


def estimate_to_msg(
    record: SampleEstimate | HammerEstimate | SpeedExponents,
    stamp: Time | None = None,
    identity: Identity = NO_IDENTITY,
) -> Any:
    """Return a result as the message of the same name; exponents have no stamp and no id."""
    message = make_message(type(record).__name__)
    return identity.fill(fill_message(message, make_result(record), make_message), stamp)


def hit_to_msg(judged: JudgedHit, identity: Identity) -> msg.Impact:
    """Return a judged hit as a message, stamped with its record's first point's time."""
    found = hit_results_from_judged(judged, ())
    message = msg.Impact(
        impact_time=judged.impact_time,
        reasons=_findings(found.reasons),
        findings=_findings(found.findings),
        **{name: getattr(found, name) for name in SHARED},
    )
    fill_message(message.origin, found.origin)
    return identity.fill(message, stamp_to_msg(judged.stamp))


SHARED = (
    "sample", "impact", "attempt", "record", "accepted", "contact_time", "hammer_peak",
    "specimen_peak", "impact_speed", "impact_speed_uncertainty", "sample_mass",
)  # fmt: skip
"""Fields of a hit that are in its message as they are."""


def _findings(found: Sequence[Finding]) -> list[msg.Finding]:
    return [fill_message(msg.Finding(), item) for item in found]


def overrule_to_msg(overrule: Overrule, identity: Identity, stamp: Time) -> msg.Overrule:
    """Return a person's verdict as a message."""
    message = fill_message(msg.Overrule(), overrule)
    message.header.stamp = stamp
    identity.fill(message)
    return message


def trace_to_msg(
    judged: JudgedHit, aligned: AlignedHit, full_scale: Sequence[float], identity: Identity
) -> msg.ImpactTrace:
    """Return a judged hit's traces as a message, stamped as its verdict."""
    hammer, *others = aligned.traces
    message = msg.ImpactTrace(
        **asdict(judged.label),
        accepted=judged.accepted,
        sampling_rate=aligned.sampling_rate,
        contact_time=judged.contact_time,
        full_scale=list(full_scale),
        time=_floats(aligned.time),
        hammer=_floats(hammer),
        specimen=_floats(others[0]) if others else array("f"),
    )
    return identity.fill(message, stamp_to_msg(judged.stamp))


def results_from_msg(message: Any, faults: Mapping[int, Sequence[str]]) -> Results:
    """Return the results in the answer of an estimator or of a campaign.

    The message is a `RunCampaign.Result` or a `GetResults.Response`; `faults` are what the virtual
    rig did on purpose, by record.
    """
    hits = sorted([*message.accepted, *message.rejected], key=lambda hit: hit.record)
    whose = describe_estimator(message.estimator)
    notes = (Note(Subject.ESTIMATOR, whose),) if whose else ()
    samples = (from_message(SampleEstimate, each) for each in message.samples)
    return Results(
        setup=setup_from_msg(message.setup),
        hammer=from_message(HammerEstimate, message.hammer),
        samples=tuple(replace(it, warnings=it.warnings + notes) for it in samples),
        hits=tuple(
            replace(hit_results_from_msg(hit), injected_faults=tuple(faults.get(hit.record, ())))
            for hit in hits
        ),
        speed_exponents=tuple(
            from_message(SpeedExponents, each) for each in message.speed_exponents
        ),
    )


def comparison_to_msg(
    estimate: SampleEstimate, compared: ModelComparison, stamp: Time, identity: Identity
) -> msg.ModelComparison:
    """Return the traces of a model comparison as a message."""
    message = msg.ModelComparison(
        sample=estimate.name,
        model=compared.variant.value,
        impacts_accepted=estimate.impacts_accepted,
        sampling_rate=compared.sampling_rate,
        start_time=compared.start_time,
        contact_time=compared.contact_time,
        hammer_measured=_floats(compared.hammer.measured),
        hammer_model=_floats(compared.hammer.model),
        specimen_measured=_floats(compared.specimen.measured),
        specimen_model=_floats(compared.specimen.model),
        hammer_peak=compared.hammer.peak,
        specimen_peak=compared.specimen.peak,
        hammer_shift=compared.hammer.shift,
        specimen_shift=compared.specimen.shift,
        mse_hammer_percent=compared.hammer.mse_percent,
        mse_sample_percent=compared.specimen.mse_percent,
    )
    return identity.fill(message, stamp)


def _floats(values: FloatArray) -> "array[float]":
    return array("f", values.astype("float32").tobytes())


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
