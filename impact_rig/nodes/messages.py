"""Core types to the rig's messages.

What a recording holds too is read by `impact_rig.recording.interfaces.messages`.
"""

from array import array
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import (
    AccelerationBlock,
    AnalysisSettings,
    Channel,
    Impact,
    RigSetup,
    Sample,
    Sensor,
    VirtualImpact,
)

from impact_rig import __version__
from impact_rig.core.setup import samples
from impact_rig.core.signals import record
from impact_rig.results.campaign import HitResults

if TYPE_CHECKING:
    # Who only passes on what others have measured needs no physics.
    from impact_rig.devices.virtual.rig import VirtualHit


def stamp_to_msg(nanoseconds: int) -> Time:
    """Return nanoseconds since the epoch as a `builtin_interfaces/Time`."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def channel_to_msg(channel: record.ChannelBlock) -> Channel:
    """Return one channel over one block as a message."""
    message = Channel()
    fill_channel_msg(message, channel)
    return message


def fill_channel_msg(message: Channel, channel: record.ChannelBlock) -> None:
    """Let a message be that of one channel over one block.

    It keeps its memory if that is as long: to get some costs more than to copy a block into it.
    """
    output = channel.output
    nothing = output[:0]
    is_counted = output.dtype == np.int32
    message.counts = _fill(message.counts, output if is_counted else nothing)
    message.values = _fill(message.values, nothing if is_counted else output)
    message.scale = channel.scale
    message.offset = channel.offset
    message.full_scale = channel.full_scale
    message.overload = channel.overloaded


def _fill(room: "array[Any]", output: record.RawArray) -> "array[Any]":
    """Return an array that holds a channel's output: the one there is, or a new one."""
    if output.size and len(room) == output.size:
        np.frombuffer(room, dtype=output.dtype)[:] = output
        return room
    # An array.array is taken over as it is; numpy would be checked item by item.
    fresh = array(room.typecode)
    fresh.frombytes(np.ascontiguousarray(output).view(np.uint8).data)
    return fresh


def block_to_msg(block: record.Block) -> AccelerationBlock:
    """Return a block as a message, stamped with its first point's time."""
    message = AccelerationBlock(
        record=block.label.record,
        sample=block.label.sample,
        impact=block.label.impact,
        attempt=block.label.attempt,
        first_sample=block.first_sample,
        sampling_rate=block.sampling_rate,
        triggered=block.triggered,
        last=block.last,
        hammer=channel_to_msg(block.hammer),
        specimen=channel_to_msg(block.specimen),
    )
    message.header.stamp = stamp_to_msg(block.stamp)
    return message


def virtual_hit_to_msg(virtual: "VirtualHit", stamp: Time) -> VirtualImpact:
    """Return the truth behind a simulated hit as a message."""
    message = VirtualImpact(
        record=virtual.label.record,
        sample=virtual.label.sample,
        impact=virtual.label.impact,
        attempt=virtual.label.attempt,
        faults=[fault.value for fault in virtual.faults],
        contact_time=virtual.model.contact_time,
        peak_force=virtual.model.peak_force,
    )
    message.header.stamp = stamp
    return message


def setup_to_msg(setup: samples.RigSetup, stamp: Time) -> RigSetup:
    """Return a rig's set-up as a message."""
    analysis = setup.analysis
    message = RigSetup(
        name=setup.name,
        description=setup.description,
        software_version=__version__,
        hammer_mass=float(setup.hammer_mass),
        hammer_mass_uncertainty=float(setup.hammer_mass_uncertainty),
        hammer_stiffness=float(setup.hammer_stiffness),
        accelerometer_mass=float(setup.samples.accelerometer_mass),
        accelerometer_mass_uncertainty=float(setup.samples.accelerometer_mass_uncertainty),
        clock_uncertainty=float(setup.clock_uncertainty),
        impact_speed=float(setup.impact_speed),
        control_sample=setup.samples.control_sample,
        samples=[
            Sample(
                name=sample.name,
                material=sample.material,
                mass=float(sample.mass),
                mass_uncertainty=float(sample.mass_uncertainty),
                reference_contact_time=float(sample.reference_contact_time),
                reference_stiffness=float(sample.reference_stiffness),
                reference_damping_coefficient=float(sample.reference_damping_coefficient),
            )
            for sample in setup.samples.samples
        ],
        analysis=AnalysisSettings(
            cutoff_frequency=float(analysis.cutoff_frequency),
            pulse_factor=float(analysis.pulse_factor),
            pre_trigger=float(analysis.pre_trigger),
            record_duration=float(analysis.record_duration),
            detection_level=float(analysis.detection_level),
            minimum_peak=float(analysis.minimum_peak),
            maximum_peak=float(analysis.maximum_peak),
            overload_run=analysis.overload_run,
            double_hit_level=float(analysis.double_hit_level),
            keep_hits=int(analysis.keep_hits),
        ),
        sensors=[Sensor(**asdict(sensor)) for sensor in setup.sensors],
    )
    message.header.stamp = stamp
    return message


def hit_results_from_msg(message: Impact, injected_faults: Sequence[str]) -> HitResults:
    """Return a judged hit as the results that leave the rig."""
    return HitResults(
        sample=message.sample,
        impact=message.impact,
        attempt=message.attempt,
        record=message.record,
        accepted=message.accepted,
        reasons=tuple(message.reasons),
        contact_time_s=message.contact_time,
        hammer_peak_m_per_s2=message.hammer_peak,
        specimen_peak_m_per_s2=message.specimen_peak,
        injected_faults=tuple(injected_faults),
    )
