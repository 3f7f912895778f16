"""Analog inputs: a sensor's calibration sheet in NI-DAQmx's terms.

NI-DAQmx scales by itself, with the device's own calibration and the sensor's sensitivity. Its
scaled numbers are taken as they are, in 64-bit floating point, rather than raw counts: how counts
lie in memory and by which polynomial they become volts differs from device to device. So the
source does not count, and says nothing of its resolution.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.calibration import STANDARD_GRAVITY
from impact_rig.core.signals.record import ChannelBlock, FloatArray
from impact_rig.devices.acceleration_source import SourceChannel
from impact_rig.devices.nidaqmx.errors import report_errors

if TYPE_CHECKING:
    from nidaqmx import Task
    from nidaqmx.system.device import Device

COUPLINGS = ("AC", "DC")
RAIL = 0.999
"""Part of the input's range from which on a number counts as overload [-], our choice: 16 bits end
three parts in 100 000 below the range."""
HIGHEST_RANGE = 1000.0
"""[V] What no input exceeds."""
HIGHEST_CURRENT = 0.1
"""[A] What no IEPE supply exceeds."""


@dataclass(frozen=True)
class Input:
    """A channel of a task, and what its numbers mean.

    Attributes
    ----------
    name : str
        Of the virtual channel.
    scale : float
        Acceleration for one unit of the task's numbers, signed [m/s^2].
    full_scale : float
        Largest acceleration that sensor and input can show [m/s^2].
    limit : float
        The task's number at the end of the input's range.
    """

    name: str
    scale: float
    full_scale: float
    limit: float

    def make_block(self, numbers: FloatArray, *, overloaded: bool = False) -> ChannelBlock:
        """Return some numbers as a block; at the end of the range they are overloaded, too."""
        at_rail = bool(np.any(np.abs(numbers) >= RAIL * self.limit))
        return ChannelBlock(numbers, self.scale, 0.0, self.full_scale, overloaded or at_rail)


def check_terminal(device: "Device", channel: SourceChannel) -> None:
    """Require that the device has the analog input.

    Raises
    ------
    ParameterError
        If it has not.
    """
    known = device.ai_physical_chans.channel_names
    if channel.name not in known:
        raise channel.options.make_error(
            "channel",
            f"{device.name} has no analog input {channel.name!r}: it has {', '.join(known)}",
        )


def add_input(task: "Task", channel: SourceChannel) -> Input:
    """Add a sensor's channel to a task.

    Parameters
    ----------
    task : Task
        Not yet started.
    channel : SourceChannel
        Options: iepe_current, coupling, range.

    Raises
    ------
    ParameterError
        If an option cannot be meant, or the device cannot do it.
    """
    from nidaqmx.constants import Coupling

    options = channel.options
    options.check_keys("iepe_current", "coupling", "range")
    volts_scale = _find_scale(channel)
    limit = _take_range(channel)
    current = _take_current(channel)
    coupling = _take_coupling(channel, current)
    add, unit_per_volt = _choose_channel(task, channel, current)
    subject = f"analog input {channel.name}"
    with report_errors(subject, options, "range"):
        largest = limit * unit_per_volt
        found = add(channel.name, channel.sensor.channel, min_val=-largest, max_val=largest)
    if coupling:
        with report_errors(subject, options, "coupling"):
            found.ai_coupling = Coupling[coupling]
    electrical = float(found.ai_rng_high)
    return Input(
        name=channel.sensor.channel,
        # Sensitivities are positive in NI-DAQmx: their sign is here.
        scale=volts_scale / unit_per_volt,
        full_scale=channel.find_full_scale(electrical),
        limit=electrical * unit_per_volt,
    )


def _choose_channel(
    task: "Task", channel: SourceChannel, current: float
) -> tuple[Callable[..., Any], float]:
    """Return how the channel is added, and its units per volt."""
    from functools import partial

    from nidaqmx.constants import (
        AccelSensitivityUnits,
        AccelUnits,
        ExcitationSource,
        ForceIEPESensorSensitivityUnits,
        ForceUnits,
    )

    if not current:
        return task.ai_channels.add_ai_voltage_chan, 1.0
    excitation = {
        "current_excit_source": ExcitationSource.INTERNAL,
        "current_excit_val": current,
    }
    unit_per_volt = abs(channel.find_scale())
    if channel.sensor.quantity == "force":
        unit_per_volt *= channel.moving_mass
        return partial(
            task.ai_channels.add_ai_force_iepe_chan,
            units=ForceUnits.NEWTONS,
            sensitivity=1e3 / unit_per_volt,
            sensitivity_units=ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON,
            **excitation,
        ), unit_per_volt
    return partial(
        task.ai_channels.add_ai_accel_chan,
        units=AccelUnits.METERS_PER_SECOND_SQUARED,
        sensitivity=1e3 * STANDARD_GRAVITY / unit_per_volt,
        sensitivity_units=AccelSensitivityUnits.MILLIVOLTS_PER_G,
        **excitation,
    ), unit_per_volt


def _find_scale(channel: SourceChannel) -> float:
    """Return the acceleration of one volt, signed [m/s^2 per V]."""
    try:
        return channel.find_scale()
    except ParameterError as error:
        raise channel.options.locate(error) from None


def _take_range(channel: SourceChannel) -> float:
    """Return the largest voltage that is expected [V]."""
    options = channel.options
    default = abs(channel.sensor.full_scale * channel.sensor.sensitivity)
    if "range" not in options and not default:
        raise options.make_error(
            "range",
            f'{options.place} lacks range: give it, for example range = "5 V", or the sensor\'s'
            " full_scale",
        )
    limit = options.take_quantity("range", "V", "5 V", default, low=0.0, high=HIGHEST_RANGE)
    if not limit > 0.0:
        raise options.refuse("range", "above zero")
    return limit


def _take_current(channel: SourceChannel) -> float:
    """Return the current of the sensor's supply [A]; 0: it has one of its own."""
    options = channel.options
    if options.get("iepe_current") == "off":
        return 0.0
    current = options.take_quantity(
        "iepe_current", "A", "4 mA", REQUIRED, low=0.0, high=HIGHEST_CURRENT
    )
    if not current > 0.0:
        raise options.refuse("iepe_current", 'above zero, or "off"')
    return current


def _set_coupling(found: Any, coupling: str) -> None:
    from nidaqmx.constants import Coupling

    found.ai_coupling = Coupling[coupling]


def _take_coupling(channel: SourceChannel, current: float) -> str:
    """Return the input's coupling; empty: the device's own."""
    if not current and "coupling" not in channel.options:
        return ""
    # The bias of a supply is kept out, unless the rig file wants it.
    return channel.options.take_choice("coupling", COUPLINGS, COUPLINGS[0])
