"""What a count of a sound card stands for."""

import math

from impact_rig.configuration.toml_table import REQUIRED
from impact_rig.devices.acceleration_source import SourceChannel
from impact_rig.devices.sound.name_calibration import NameCalibration
from impact_rig.devices.streaming.count_scale import CountScale

FULL_COUNT = 2**31
"""Counts of PortAudio at full scale [-]: fewer bits stand at the upper end of its 32."""
RAIL_COUNT = FULL_COUNT - 2**16
"""From here on a channel is overloaded [-]: the largest count of a converter of 16 bits, which is
3e-5 below full scale; those of more bits reach it, too."""


def find_count_scale(channel: SourceChannel, known: NameCalibration | None) -> CountScale:
    """Return what a count of a channel stands for.

    A sensor with a sensitivity gives a voltage, and its channel needs the voltage at full scale,
    `input_range`. One without gives its acceleration, and `full_scale` is that at the largest
    count. What the rig file does not say is taken from the device's name.

    Parameters
    ----------
    channel : SourceChannel
        As the rig file describes it.
    known : NameCalibration or None
        What the device's name says of this channel.

    Raises
    ------
    ParameterError
        If neither tells it.
    """
    options, sensor = channel.options, channel.sensor
    options.check_keys("input_range")
    if not math.isnan(sensor.sensitivity):
        is_known = known is not None and known.unit == "V"
        voltage = options.take_quantity(
            "input_range",
            "V",
            "1.4 V",
            known.full_scale if known is not None and is_known else REQUIRED,
            low=1e-6,
            high=1e6,
        )
        scale = channel.find_scale() * voltage / FULL_COUNT
        return CountScale(scale, channel.find_full_scale(voltage), -RAIL_COUNT, RAIL_COUNT)
    full_scale = sensor.find_full_scale(channel.moving_mass)
    if not full_scale and known is not None and known.unit == "m/s^2":
        full_scale = known.full_scale
    if not full_scale:
        raise options.make_error(
            "full_scale",
            f"{options.place} says neither sensitivity nor full_scale, and nor does the device's"
            ' name: give sensitivity = "10 mV/g" and input_range = "1.4 V" for a sensor at a'
            ' sound card, or full_scale = "20 g", the acceleration of the largest count',
        )
    return CountScale(full_scale / FULL_COUNT, full_scale, -RAIL_COUNT, RAIL_COUNT)
