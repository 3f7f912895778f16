"""The channels of measured files, as the user states them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from impact_rig.core.given.errors import ParameterError, check_if_known, check_not_negative
from impact_rig.core.given.quantity import Comparable
from impact_rig.core.given.sensors import FORCES, UNITS, VOLTAGES, Sensitivity, normalize_unit
from impact_rig.files.times import SAMPLES, TIME_UNITS, normalize_time_unit

ROLES = ("time", "hammer", "specimen", "skip")
"""Contents of a column: time [s], the hammer's or the sample's signal, or nothing of use."""


@dataclass(frozen=True)
class ChannelUse:
    """Properties of one body's channel that its file does not state."""

    # Its name in the file, or its number there, counted from 1; empty: by its place.
    channel: str = ""
    unit: str = ""  # one of `UNITS`; empty: as the file states it
    sensitivity: Sensitivity | None = None  # of the sensor, for a channel in V
    full_scale: float = 0.0  # largest value that the channel can show, either sign; 0: not known
    full_scale_unit: str = "m/s^2"  # one of `UNITS`
    # What is stated of the sensor's response and gain, by the fields of `Sensor`.
    stated: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse unknown units, and a sensitivity of what is no voltage."""
        for what, unit in (("", self.unit), ("full scale: ", self.full_scale_unit)):
            if unit and normalize_unit(unit) not in UNITS:
                raise ParameterError(
                    f"{what}unit {unit!r} is unknown: a channel is in {', '.join(UNITS)}"
                )
        check_not_negative("full scale", self.full_scale, self.full_scale_unit)
        if self.sensitivity and self.unit and normalize_unit(self.unit) not in VOLTAGES:
            raise ParameterError(
                f"a channel in {self.unit} has no use for a sensitivity: that is for channels in"
                " V",
                "sensitivity",
            )


@dataclass(frozen=True)
class ChannelPlan(Comparable):
    """Roles of the files' channels."""

    hammer: ChannelUse = field(default_factory=ChannelUse)  # of both bodies
    specimen: ChannelUse = field(default_factory=ChannelUse)
    # Role of each channel in its place, one of `ROLES`; several hammers are as many hits. None: by
    # the names in `hammer` and `specimen`, or by their number.
    columns: tuple[str, ...] | None = None
    # Of files that do not state it [Hz]; goes before a column of times. NaN: not given.
    sampling_rate: float = math.nan
    # Of times whose file does not state it: one of `TIME_UNITS`; empty: not given.
    time_unit: str = ""

    def __post_init__(self) -> None:
        """Refuse roles that contradict each other."""
        check_if_known("sampling rate", self.sampling_rate, "Hz")
        if self.time_unit:
            unit = normalize_time_unit(self.time_unit)
            if unit == SAMPLES:
                raise ParameterError(
                    "times that count samples need a sampling rate in place of a unit"
                )
            if not unit:
                known = ", ".join(TIME_UNITS)
                raise ParameterError(f"time unit {self.time_unit!r} is unknown: it is {known}")
            object.__setattr__(self, "time_unit", unit)
        if self.columns is not None:
            self._check_columns(self.columns)
        if normalize_unit(self.specimen.unit) in FORCES:
            raise ParameterError(
                f"the sample's channel is in {self.specimen.unit}: it must be an acceleration,"
                " or a voltage of one"
            )
        if self.hammer.channel and self.hammer.channel == self.specimen.channel:
            raise ParameterError(
                f"channel {self.hammer.channel!r} is the hammer's and the sample's: name two"
            )

    def _check_columns(self, columns: tuple[str, ...]) -> None:
        for role in columns:
            if role not in ROLES:
                raise ParameterError(f"column role {role!r} is unknown: it is {', '.join(ROLES)}")
        if columns.count("time") > 1:
            raise ParameterError("column role 'time' is given twice")
        hits, specimens = columns.count("hammer"), columns.count("specimen")
        if not hits:
            raise ParameterError("no column has the role 'hammer': its pulse is what is measured")
        if specimens not in (0, hits):
            raise ParameterError(
                f"{hits} columns are the hammer's and {specimens} the sample's: several hits need"
                " as many of both, or only the hammer's"
            )
        if self.hammer.channel or self.specimen.channel:
            raise ParameterError(
                "channels are told by the roles of all columns or by name: one of the two"
            )
