"""Finds hammer and sample among the channels of a measurement, calibrated and checked."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.setup.calibration import FORCES, UNITS, VOLTAGES, find_scale, normalize_unit
from impact_rig.core.setup.channel_plan import ROLES, ChannelPlan, ChannelUse
from impact_rig.core.signals.record import ChannelBlock
from impact_rig.recording.exchange.time_column import (
    LARGEST_TIME_ERROR,
    RATE_DIGITS,
    find_sampling_rate,
)
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement

DEFAULT_ROLES = {1: ("hammer",), 2: ("time", "hammer"), 3: ("time", "hammer", "specimen")}
"""Roles of columns by their number, where none are given and the file states no rate."""
DEFAULT_UNIT = "m/s^2"
"""What a channel is taken for where neither file nor user state a unit."""

MINIMUM_POINTS = 16
"""Shortest trace that is taken for one [points], our choice: a pulse and some baseline."""

NO_SPECIMEN = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)
BODIES = {"hammer": "hammer", "specimen": "sample"}
"""What a person calls the body of a role."""


@dataclass(frozen=True)
class MappedChannels:
    """Both channels of one hit as they stand in its file, with their calibration.

    Attributes
    ----------
    sampling_rate : float
        [Hz]
    hammer, specimen : ChannelBlock
        Numbers or counts of the file, bit by bit; the specimen's without points: not measured.
    has_scale : bool
        The hammer's are accelerations; False: a force on an unknown mass, as large as the force.
    assumed : tuple of str
        Bodies of whose channels neither file nor user state a unit: `DEFAULT_UNIT` was taken.
    names : tuple of str
        Of the channels in the file.
    stamp : int
        When the hammer's first point was taken, nanoseconds since the epoch; 0: not known.
    """

    sampling_rate: float
    hammer: ChannelBlock
    specimen: ChannelBlock = NO_SPECIMEN
    has_scale: bool = True
    assumed: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    stamp: int = 0


def map_channels(
    measurement: Measurement,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = True,
) -> MappedChannels:
    """Find, check and calibrate the channels of one hit.

    Parameters
    ----------
    measurement : Measurement
        As read from its file.
    plan : ChannelPlan
        What the user says of its channels.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Refuse a force without a mass; False: contact times are all that is wanted.

    Returns
    -------
    MappedChannels

    Raises
    ------
    SignalError
        If channels are missing, too short, not finite, of different lengths, rates or starts, or
        time does not run in even steps.
    ParameterError
        If the units do not fit, or the user contradicts the file.
    """
    path = measurement.path
    found = _find_channels(measurement, plan)
    for role, channel in found.items():
        _check_values(path, role, channel)
    hammer, specimen = found["hammer"], found.get("specimen")
    if specimen is not None:
        _check_pair(path, hammer, specimen)
    has_scale = needs_scale or not (_is_force(hammer, plan.hammer) and math.isnan(hammer_mass))
    mass = hammer_mass if has_scale else 1.0
    return MappedChannels(
        sampling_rate=_find_rate(path, plan, hammer, found.get("time")),
        hammer=_calibrate(path, "hammer", hammer, plan.hammer, mass),
        specimen=_calibrate(path, "specimen", specimen, plan.specimen)
        if specimen
        else NO_SPECIMEN,
        has_scale=has_scale,
        assumed=tuple(
            BODIES[role]
            for role, use in (("hammer", plan.hammer), ("specimen", plan.specimen))
            if role in found and not (found[role].unit or use.unit or use.sensitivity)
        ),
        names=tuple(found[role].name for role in BODIES if role in found),
        stamp=hammer.stamp,
    )


def _find_channels(measurement: Measurement, plan: ChannelPlan) -> dict[str, MeasuredChannel]:
    """Return the channels that are used by their roles."""
    channels, path = measurement.channels, measurement.path
    if plan.hammer.channel:
        return _find_named(measurement, plan)
    if plan.columns is not None:
        if len(plan.columns) != len(channels):
            raise SignalError(
                f"{path} has {len(channels)} columns, but {len(plan.columns)} roles are given:"
                f" {', '.join(plan.columns)}"
            )
        roles = plan.columns
    elif not (math.isnan(channels[0].sampling_rate) and math.isnan(plan.sampling_rate)):
        roles = ("hammer", "specimen")
        if math.isnan(channels[0].sampling_rate) and len(channels) > len(roles):
            raise SignalError(_ask_for_roles(measurement))
    elif len(channels) in DEFAULT_ROLES:
        roles = DEFAULT_ROLES[len(channels)]
    else:
        raise SignalError(_ask_for_roles(measurement))
    # More channels than roles: a file that states rates may hold what is of no use here.
    return {role: item for role, item in zip(roles, channels, strict=False) if role != "skip"}


def _find_named(measurement: Measurement, plan: ChannelPlan) -> dict[str, MeasuredChannel]:
    found = {
        role: _find_by_name(measurement, use.channel)
        for role, use in (("hammer", plan.hammer), ("specimen", plan.specimen))
        if use.channel
    }
    if found.get("specimen") is found["hammer"]:
        raise ParameterError(
            f"{measurement.path}: {plan.hammer.channel!r} and {plan.specimen.channel!r} are the"
            " same channel: hammer and sample have one each"
        )
    first = measurement.channels[0]
    needs_time = math.isnan(found["hammer"].sampling_rate) and math.isnan(plan.sampling_rate)
    if needs_time and not any(first is channel for channel in found.values()):
        found["time"] = first
    return found


def _find_by_name(measurement: Measurement, name: str) -> MeasuredChannel:
    channels = measurement.channels
    same = [channel for channel in channels if channel.name == name]
    if len(same) == 1:
        return same[0]
    if len(same) > 1:
        raise SignalError(
            f"{measurement.path} has {len(same)} channels {name!r}: name one by its number"
        )
    if name.isdecimal() and 1 <= int(name) <= len(channels):
        return channels[int(name) - 1]
    raise SignalError(
        f"{measurement.path} has no channel {name!r}: it has {_list_channels(measurement)}"
    )


def _list_channels(measurement: Measurement) -> str:
    return ", ".join(
        f"{number} {channel.name!r}" for number, channel in enumerate(measurement.channels, 1)
    )


def _ask_for_roles(measurement: Measurement) -> str:
    return (
        f"{measurement.path} has {len(measurement.channels)} columns: give the role of each"
        f" ({', '.join(ROLES)})"
    )


def _check_values(path: Path, role: str, channel: MeasuredChannel) -> None:
    values = channel.values
    if values.size < MINIMUM_POINTS:
        raise SignalError(
            f"{path} has {values.size} points in {channel.name!r}: a trace needs at least"
            f" {MINIMUM_POINTS}"
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise SignalError(
            f"{path}: {BODIES.get(role, role)} is {values[bad[0]]} at point {bad[0]} ({bad.size}"
            " such points): every point must be a finite number"
        )


def _check_pair(path: Path, hammer: MeasuredChannel, specimen: MeasuredChannel) -> None:
    """Require two channels that were taken at the same instants."""
    names = f"{hammer.name!r} and {specimen.name!r}"
    advice = "hammer and sample need the same; name the channels that belong together"
    if hammer.values.size != specimen.values.size:
        raise SignalError(
            f"{path}: {names} have {hammer.values.size} and {specimen.values.size} points:"
            f" {advice}"
        )
    rates = hammer.sampling_rate, specimen.sampling_rate
    if rates[0] != rates[1] and not all(map(math.isnan, rates)):
        raise SignalError(
            f"{path}: {names} are sampled at {rates[0]:g} Hz and {rates[1]:g} Hz: {advice}"
        )
    delay = specimen.start - hammer.start
    if abs(delay) * np.nan_to_num(rates[0], nan=0.0) > LARGEST_TIME_ERROR:
        raise SignalError(f"{path}: {names} start {abs(delay):g} s apart: {advice}")


def _find_rate(
    path: Path, plan: ChannelPlan, hammer: MeasuredChannel, time: MeasuredChannel | None
) -> float:
    stated, given = hammer.sampling_rate, plan.sampling_rate
    if time is not None:
        return find_sampling_rate(path, time.values.astype(np.float64), time.unit)
    if math.isnan(stated) and math.isnan(given):
        raise SignalError(f"{path} has no time and states no rate: give its sampling rate")
    if math.isnan(given):
        return stated
    if not math.isnan(stated) and not math.isclose(stated, given, rel_tol=10.0**-RATE_DIGITS):
        raise ParameterError(
            f"{path} is sampled at {stated:g} Hz, as it states, not at {given:g} Hz"
        )
    return given


def _find_unit(path: Path, role: str, channel: MeasuredChannel, use: ChannelUse) -> str:
    """Return the unit of a channel; what the file states goes, and must not be contradicted."""
    stated, given = normalize_unit(channel.unit), normalize_unit(use.unit)
    if use.sensitivity and not given:
        given = stated if stated in VOLTAGES else "V"
    what = f"{path}: the {BODIES[role]}'s channel {channel.name!r} is in {stated}"
    if given and stated in UNITS and stated != given:
        raise ParameterError(f"{what}, as the file states, not in {given}")
    if not given and stated and stated not in UNITS:
        raise ParameterError(f"{what}, which is no unit known here: give {', '.join(UNITS)}")
    return given or stated or DEFAULT_UNIT


def _is_force(channel: MeasuredChannel, use: ChannelUse) -> bool:
    """Tell whether the channel is a force, or the voltage of one."""
    unit = normalize_unit(use.unit or channel.unit)
    if use.sensitivity and (not unit or unit in VOLTAGES):
        unit = normalize_unit(use.sensitivity.unit)
    return unit in FORCES


def _calibrate(
    path: Path, role: str, channel: MeasuredChannel, use: ChannelUse, mass: float = math.nan
) -> ChannelBlock:
    unit = _find_unit(path, role, channel, use)
    if role == "specimen" and _is_force(channel, use):
        raise ParameterError(
            f"{path}: the sample's channel {channel.name!r} is a force: it must be an acceleration"
        )
    try:
        scale = find_scale(unit, mass, use.sensitivity)
        full_scale = use.full_scale and use.full_scale * abs(
            find_scale(use.full_scale_unit, mass, use.sensitivity)
        )
    except ParameterError as error:
        raise ParameterError(f"{path}: {BODIES[role]}: {error}") from None
    return ChannelBlock(channel.values, scale, 0.0, full_scale)
