"""From the rig's messages to core types, whoever decoded them (rclpy or a file reader).

Only attributes are read, so that the same functions serve a node and a recording: both give
bit-identical numbers.
"""

from typing import Any

import numpy as np

from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import NOT_ARMED, Block, ChannelBlock, HitLabel, RawArray
from impact_rig.recording.interfaces.absent_fields import read_field

_CHANNEL = "impact_rig_msgs/msg/Channel"
_SAMPLE = "impact_rig_msgs/msg/Sample"
_SETUP = "impact_rig_msgs/msg/RigSetup"
_ANALYSIS = "impact_rig_msgs/msg/AnalysisSettings"


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
    values = read_field(message, _CHANNEL, "values")
    output: RawArray = (
        np.asarray(values, dtype=np.float64).view()
        if len(values)
        else np.frombuffer(memoryview(message.counts), dtype=np.int32)
    )
    # The message's own memory: nobody changes a message that has come.
    output.setflags(write=False)
    return ChannelBlock(
        output=output,
        scale=float(message.scale),
        offset=float(message.offset),
        full_scale=float(message.full_scale),
        overloaded=bool(read_field(message, _CHANNEL, "overload")),
    )


def block_from_msg(message: Any) -> Block:
    """Return an `AccelerationBlock` as a `Block`, which reads the message's own counts.

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


def stream_block_from_msg(message: Any) -> Block:
    """Return a `StreamBlock` as a `Block` of the running stream; errors as `block_from_msg`."""
    return Block(
        label=label_from_msg(message) if message.record else NOT_ARMED,
        first_sample=int(message.first_sample),
        sampling_rate=float(message.sampling_rate),
        hammer=_channel_from_msg(message.hammer),
        specimen=_channel_from_msg(message.specimen),
        last=bool(message.last),
        stamp=stamp_from_msg(message.header.stamp),
    )


def setup_from_msg(message: Any) -> RigSetup:
    """Return a `RigSetup` message as a `RigSetup`.

    What a recording of an older version lacks is filled up from `ABSENT_FIELDS`.

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
                    mass_uncertainty=float(read_field(sample, _SAMPLE, "mass_uncertainty")),
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
                read_field(message, _SETUP, "accelerometer_mass_uncertainty")
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
            maximum_peak=float(read_field(analysis, _ANALYSIS, "maximum_peak")),
            overload_run=int(analysis.overload_run),
            double_hit_level=float(analysis.double_hit_level),
            keep_hits=int(read_field(analysis, _ANALYSIS, "keep_hits")),
        ),
        name=str(message.name),
        description=str(message.description),
        hammer_mass_uncertainty=float(read_field(message, _SETUP, "hammer_mass_uncertainty")),
        hammer_stiffness=float(read_field(message, _SETUP, "hammer_stiffness")),
        clock_uncertainty=float(read_field(message, _SETUP, "clock_uncertainty")),
        sensors=tuple(
            Sensor(
                channel=str(sensor.channel),
                quantity=str(sensor.quantity),
                unit=str(sensor.unit),
                sensitivity=float(sensor.sensitivity),
                full_scale=float(sensor.full_scale),
                serial_number=str(sensor.serial_number),
                calibration_date=str(sensor.calibration_date),
            )
            for sensor in read_field(message, _SETUP, "sensors")
        ),
    )
