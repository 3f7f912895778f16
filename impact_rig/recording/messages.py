"""From the rig's messages to core types, whoever decoded them (rclpy or a file reader).

Only attributes are read, so that the same functions serve a node and a recording: both give
bit-identical numbers.
"""

import math
from typing import Any

import numpy as np

from impact_rig.core.setup.samples import (
    DEFAULT_CLOCK_UNCERTAINTY,
    RigSetup,
    Sample,
    SampleSet,
)
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import Block, ChannelBlock, HitLabel


def stamp_from_msg(stamp: Any) -> int:
    """Return a `builtin_interfaces/Time` as nanoseconds since the epoch."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def label_from_msg(message: Any) -> HitLabel:
    """Return the hit that a message with record, sample, impact and attempt belongs to."""
    return HitLabel(
        sample=str(message.sample),
        record=int(message.record),
        impact=int(message.impact),
        attempt=int(message.attempt),
    )


def _channel_from_msg(message: Any) -> ChannelBlock:
    # Recordings made before this field existed hold counts only.
    values = np.frombuffer(memoryview(getattr(message, "values", b"")), dtype=np.float64)
    return ChannelBlock(
        output=values
        if values.size
        else np.frombuffer(memoryview(message.counts), dtype=np.int32),
        scale=float(message.scale),
        offset=float(message.offset),
        full_scale=float(message.full_scale),
    )


def block_from_msg(message: Any) -> Block:
    """Return an `AccelerationBlock` as a `Block`.

    Raises
    ------
    SignalError
        If the channels differ in length or the calibration cannot be meant.
    ParameterError
        If the sampling rate is not a positive number.
    """
    return Block(
        label=label_from_msg(message),
        first_sample=int(message.first_sample),
        sampling_rate=float(message.sampling_rate),
        hammer=_channel_from_msg(message.hammer),
        specimen=_channel_from_msg(message.specimen),
        triggered=bool(message.triggered),
        last=bool(message.last),
        stamp=stamp_from_msg(message.header.stamp),
    )


def setup_from_msg(message: Any) -> RigSetup:
    """Return a `RigSetup` message as a `RigSetup`.

    Recordings older than the stated uncertainties lack those fields: then nothing is stated.

    Raises
    ------
    ParameterError
        If a mass, a setting or the sample set cannot be meant.
    """
    analysis = message.analysis
    return RigSetup(
        samples=SampleSet(
            samples=tuple(
                Sample(
                    name=str(sample.name),
                    mass=float(sample.mass),
                    mass_uncertainty=float(getattr(sample, "mass_uncertainty", 0.0)),
                    material=str(sample.material),
                    reference_contact_time=float(sample.reference_contact_time),
                    reference_stiffness=float(sample.reference_stiffness),
                    reference_damping_coefficient=float(sample.reference_damping_coefficient),
                )
                for sample in message.samples
            ),
            control_sample=str(message.control_sample),
            accelerometer_mass=float(message.accelerometer_mass),
            accelerometer_mass_uncertainty=float(
                getattr(message, "accelerometer_mass_uncertainty", 0.0)
            ),
        ),
        hammer_mass=float(message.hammer_mass),
        impact_speed=float(message.impact_speed),
        analysis=AnalysisSettings(
            cutoff_frequency=float(analysis.cutoff_frequency),
            pulse_factor=float(analysis.pulse_factor),
            pre_trigger=float(analysis.pre_trigger),
            record_duration=float(analysis.record_duration),
            detection_level=float(analysis.detection_level),
            minimum_peak=float(analysis.minimum_peak),
            # Recordings made before these settings existed were judged without them.
            maximum_peak=float(getattr(analysis, "maximum_peak", 1.0)),
            overload_run=int(analysis.overload_run),
            double_hit_level=float(analysis.double_hit_level),
            keep_hits=int(getattr(analysis, "keep_hits", 0)),
        ),
        name=str(message.name),
        description=str(message.description),
        hammer_mass_uncertainty=float(getattr(message, "hammer_mass_uncertainty", 0.0)),
        hammer_stiffness=float(getattr(message, "hammer_stiffness", math.nan)),
        clock_uncertainty=float(getattr(message, "clock_uncertainty", DEFAULT_CLOCK_UNCERTAINTY)),
    )
